"""The banded symmetric matrix of one film, L D L^T in place: the price of a film solution is this factorisation.

And L U of those that are not symmetric: films that conserve mass, heat balances across a film.
"""

from __future__ import annotations

from typing import Any

from model.compilation import inner
from model.film.faces import Faces
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray


@inner
def assemble(grid: FilmGrid, work: FilmWork, faces: Faces) -> None:
    """Lower band of the matrix: row k holds its diagonal and the entries below it; ruptured nodes stand alone."""
    band, ruptured, (along, beside) = work.band, work.ruptured.reshape(-1), faces.conductance
    width, line = band.shape[1] - 1, grid.steps[0]
    band[:] = 0.0
    for k in range(len(band)):
        n = grid.node[k]
        if ruptured[n]:
            band[k, 0] = 1.0
            continue
        band[k, 0] = along[n - line] + along[n] + beside[n] + beside[n - 1]
        if (k + 1) % width != 0 and not ruptured[n + 1]:
            band[k, 1] -= beside[n]
        if k + width < len(band) and not ruptured[n + line]:
            band[k, width] -= along[n]


def _factoriser(known: int | None) -> Any:
    """`factorise` for one width: what the compiler knows, it keeps in registers."""

    @inner
    def factorise_band(band: FloatArray) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if known is None else known
        for k in range(n):
            inverse = 1.0 / band[k, 0]
            if k < n - width:
                for r in range(1, width + 1):
                    factor = band[k, r] * inverse
                    for s in range(r, width + 1):
                        band[k + r, s - r] -= factor * band[k, s]
            else:
                for r in range(1, n - k):
                    factor = band[k, r] * inverse
                    for s in range(r, width + 1):
                        band[k + r, s - r] -= factor * band[k, s]
            for r in range(1, width + 1):
                band[k, r] *= inverse

    return factorise_band


def _substitution(known: int | None) -> Any:
    """`substitute` for one width: an unknown's nearest neighbour comes last, so that nothing waits for memory."""

    @inner
    def substitute_band(band: FloatArray, x: FloatArray) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if known is None else known
        for k in range(1, n):
            total = x[k]
            if k >= width:
                for r in range(width, 0, -1):
                    total -= band[k - r, r] * x[k - r]
            else:
                for r in range(k, 0, -1):
                    total -= band[k - r, r] * x[k - r]
            x[k] = total
        for k in range(n):
            x[k] /= band[k, 0]
        for k in range(n - 2, -1, -1):
            total = x[k]
            if k < n - width:
                for r in range(width, 0, -1):
                    total -= band[k, r] * x[k + r]
            else:
                for r in range(n - 1 - k, 0, -1):
                    total -= band[k, r] * x[k + r]
            x[k] = total

    return substitute_band


def _substitution_of_four(known: int | None) -> Any:
    """`substitute_four` for one width, see `_substitution`."""

    @inner
    def substitute_four_bands(band: FloatArray, x: FloatArray) -> None:
        n, width = band.shape[0], band.shape[1] - 1 if known is None else known
        for k in range(1, n):
            a, b, c, d = x[k, 0], x[k, 1], x[k, 2], x[k, 3]
            for r in range(width, 0, -1):
                if r <= k:
                    f = band[k - r, r]
                    a, b = a - f * x[k - r, 0], b - f * x[k - r, 1]
                    c, d = c - f * x[k - r, 2], d - f * x[k - r, 3]
            x[k, 0], x[k, 1], x[k, 2], x[k, 3] = a, b, c, d
        for k in range(n - 1, -1, -1):
            inverse = 1.0 / band[k, 0]
            a, b, c, d = x[k, 0] * inverse, x[k, 1] * inverse, x[k, 2] * inverse, x[k, 3] * inverse
            for r in range(width, 0, -1):
                if k + r < n:
                    f = band[k, r]
                    a, b = a - f * x[k + r, 0], b - f * x[k + r, 1]
                    c, d = c - f * x[k + r, 2], d - f * x[k + r, 3]
            x[k, 0], x[k, 1], x[k, 2], x[k, 3] = a, b, c, d

    return substitute_four_bands


def _for_any_width(make: Any) -> Any:
    """For the default mesh, half a film of 6 intervals, the coarser one where many models are compared, any other."""
    six, four, other = make(6), make(4), make(None)

    @inner
    def for_any_width(band: FloatArray, *right: FloatArray) -> None:
        if band.shape[1] == 7:
            six(band, *right)
        elif band.shape[1] == 5:
            four(band, *right)
        else:
            other(band, *right)

    return for_any_width


#: L D L^T in place: band[k, 0] = D, band[k, r] = L[k + r, k]; `band` (n, width + 1).
factorise = _for_any_width(_factoriser)
#: Solve for one right-hand side in place, with the factor from `factorise`: `band` (n, width + 1), `x` (n,).
substitute = _for_any_width(_substitution)
#: The same for the four derivatives side by side, `x` (n, 4): the inner loop fills a vector register.
substitute_four = _for_any_width(_substitution_of_four)


@inner
def substitute_many(band: FloatArray, x: FloatArray) -> None:
    """`substitute` for any number of right-hand sides, (n, m): `band` (n, width + 1), `x` (n, m)."""
    n, width, columns = band.shape[0], band.shape[1] - 1, x.shape[1]
    for k in range(n):
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r]
            for m in range(columns):
                x[k + r, m] -= factor * x[k, m]
    for k in range(n - 1, -1, -1):
        pivot = 1.0 / band[k, 0]
        for m in range(columns):
            x[k, m] *= pivot
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r]
            for m in range(columns):
                x[k, m] -= factor * x[k + r, m]


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
