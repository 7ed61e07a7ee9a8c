"""The banded symmetric matrix of one film, L D L^T in place: the price of a film solution is this factorisation.

And L U of those that are not symmetric: films that conserve mass, heat balances across a film.
"""

from typing import Any

from model.compilation import inner
from model.film.faces import Faces
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray


@inner
def assemble(grid: FilmGrid, work: FilmWork, faces: Faces) -> None:
    """Lower band of the matrix: row k holds its diagonal and the entries below it; ruptured nodes stand alone."""
    band, ruptured, (along, across) = work.band, work.ruptured.reshape(-1), faces.conductance
    width, line = band.shape[1] - 1, grid.steps[0]
    band[:] = 0.0
    for k in range(len(band)):
        n = grid.node[k]
        if ruptured[n]:
            band[k, 0] = 1.0
            continue
        band[k, 0] = along[n - line] + along[n] + across[n] + across[n - 1]
        if (k + 1) % width != 0 and not ruptured[n + 1]:
            band[k, 1] -= across[n]
        if k + width < len(band) and not ruptured[n + line]:
            band[k, width] -= along[n]


def _factoriser(bandwidth: int | None) -> Any:
    """`factorise` for one width: what the compiler knows, it keeps in registers."""

    @inner
    def factorise_band(band: FloatArray) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if bandwidth is None else bandwidth
        for k in range(n):
            inverse = 1.0 / band[k, 0]
            for r in range(1, width + 1):
                if k + r < n:
                    factor = band[k, r] * inverse
                    for s in range(r, width + 1):
                        band[k + r, s - r] -= factor * band[k, s]
            for r in range(1, width + 1):
                band[k, r] *= inverse

    return factorise_band


def _substitution(bandwidth: int | None) -> Any:
    """`substitute` for one width: an unknown's nearest neighbour comes last, so that nothing waits for memory."""

    @inner
    def substitute_band(band: FloatArray, x: FloatArray) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if bandwidth is None else bandwidth
        for k in range(1, n):
            total = x[k]
            for r in range(width, 0, -1):
                if r <= k:
                    total -= band[k - r, r] * x[k - r]
            x[k] = total
        for k in range(n - 1, -1, -1):
            total = x[k] / band[k, 0]
            for r in range(width, 0, -1):
                if k + r < n:
                    total -= band[k, r] * x[k + r]
            x[k] = total

    return substitute_band


def _substitution_of_four(bandwidth: int | None) -> Any:
    """`substitute_four` for one width, see `_substitution`."""

    @inner
    def substitute_four_bands(band: FloatArray, x: Any, first: int) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if bandwidth is None else bandwidth
        second, third, fourth = first + 1, first + 2, first + 3
        for k in range(1, n):
            a, b, c, d = x[k, first], x[k, second], x[k, third], x[k, fourth]
            for r in range(width, 0, -1):
                if r <= k:
                    f = band[k - r, r]
                    a, b = a - f * x[k - r, first], b - f * x[k - r, second]
                    c, d = c - f * x[k - r, third], d - f * x[k - r, fourth]
            x[k, first], x[k, second], x[k, third], x[k, fourth] = a, b, c, d
        for k in range(n - 1, -1, -1):
            inverse = 1.0 / band[k, 0]
            a, b, c, d = x[k, first] * inverse, x[k, second] * inverse, x[k, third] * inverse, x[k, fourth] * inverse
            for r in range(width, 0, -1):
                if k + r < n:
                    f = band[k, r]
                    a, b = a - f * x[k + r, first], b - f * x[k + r, second]
                    c, d = c - f * x[k + r, third], d - f * x[k + r, fourth]
            x[k, first], x[k, second], x[k, third], x[k, fourth] = a, b, c, d

    return substitute_four_bands


def _for_any_width(make: Any) -> Any:
    """For the default mesh, half a film of 6 intervals, the coarser one where many models are compared, any other."""
    six, four, general = make(6), make(4), make(None)

    @inner
    def for_any_width(band: FloatArray, *vectors: Any) -> None:
        if band.shape[1] == 7:
            six(band, *vectors)
        elif band.shape[1] == 5:
            four(band, *vectors)
        else:
            general(band, *vectors)

    return for_any_width


#: L D L^T in place: band[k, 0] = D, band[k, r] = L[k + r, k]; `band` (n, width + 1).
factorise = _for_any_width(_factoriser)
#: Solve for one right-hand side in place, with the factor from `factorise`: `band` (n, width + 1), `x` (n,).
substitute = _for_any_width(_substitution)
#: The same for four side by side, `x` (n, m) from one column on: the inner loop fills a vector register.
substitute_four = _for_any_width(_substitution_of_four)


@inner
def substitute_many(band: FloatArray, x: Any) -> None:
    """`substitute` for any number of right-hand sides: `band` (n, width + 1), `x` (n, m)."""
    fours = x.shape[1] // 4 * 4
    for m in range(0, fours, 4):
        substitute_four(band, x, m)
    for m in range(fours, x.shape[1]):
        substitute(band, x[:, m])


@inner
def factorise_general(band: FloatArray) -> None:
    """L U of a band that is not symmetric, (n, 2 width + 1), in place: 1 / U on the diagonal, without pivoting."""
    n, width = band.shape[0], band.shape[1] // 2
    for k in range(n):
        inverse = 1.0 / band[k, width]
        band[k, width] = inverse
        upper = band[k, width + 1 : 2 * width + 1]
        for r in range(1, min(width, n - 1 - k) + 1):
            scale = band[k + r, width - r] * inverse
            band[k + r, width - r] = scale
            row_below = band[k + r, width - r + 1 : 2 * width - r + 1]
            for s in range(width):
                row_below[s] -= scale * upper[s]


@inner
def substitute_general(band: FloatArray, x: FloatArray) -> None:
    """Solve for the right-hand sides (n, m) in place, with the factor from `factorise_general`."""
    n = band.shape[0]
    width = band.shape[1] // 2
    count = x.shape[1]
    for k in range(n):
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k + r, width - r]
            if factor != 0.0:
                for m in range(count):
                    x[k + r, m] -= factor * x[k, m]
    for k in range(n - 1, -1, -1):
        for s in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, width + s]
            if factor != 0.0:
                for m in range(count):
                    x[k, m] -= factor * x[k + s, m]
        for m in range(count):
            x[k, m] *= band[k, width]
