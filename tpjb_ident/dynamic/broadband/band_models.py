"""K-C (h = K + i omega C) and K-C-M (h = K - omega^2 M + i omega C) over a band, with intervals.

Weighted instrumental least squares over the lines (`band_equations`). The weights take the noise of each line from its
neighbours too, so that they do not depend on what the line itself happens to show; the covariance is the sandwich with
each line's own. Lines of one record share no bin, so their errors are independent; what they share comes as draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import fdtrc, stdtrit

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.band_equations import Basis, RunSums, complex_h, k_c, k_c_m, line_sums
from tpjb_ident.dynamic.broadband.line_fit import outer_matrix, satterthwaite
from tpjb_ident.dynamic.broadband.line_rows import LineRows

MODELS: dict[str, Basis] = {"K-C": k_c, "K-C-M": k_c_m}
#: Lines to either side whose noise goes into a line's weight.
_NEIGHBOURS = 4
#: Parts of the band in which a model is held against h.
_PARTS = 8
#: A model is refused below this probability of its chi-square.
_REFUSED = 0.01
_ROUNDS = 3


@dataclass(frozen=True)
class BandPart:
    """h in a part of the band, by the lines of that part alone; a model only says how h changes within it."""

    omega: float
    h: ComplexArray  #: (2, 2) complex, N/m
    covariance: FloatArray = field(repr=False)  #: (8, 8)
    dof: FloatArray = field(repr=False)  #: (8,)
    moved: FloatArray = field(repr=False)  #: (n, 8), N/m: change in every draw of what lines share
    span: tuple[float, float]
    bracket: FloatArray = field(repr=False)  #: (8,), N/m
    off: FloatArray = field(repr=False)  #: (8,), N/m: h of the part less that of the model


@dataclass(frozen=True)
class BandModel:
    """One model over the lines of a band."""

    model: str
    parameters: FloatArray  #: (p,)
    covariance: FloatArray = field(repr=False)  #: (p, p): random part
    dof: FloatArray = field(repr=False)  #: (p,): degrees of freedom of its variances
    systematic: FloatArray = field(repr=False)  #: (p, p): what all lines share
    chi_square: float
    spare: int
    probability: float
    misfit: float
    band: tuple[float, float]
    n_lines: int
    parts: tuple[BandPart, ...] = field(default=(), repr=False)

    @property
    def refused(self) -> bool:
        """Whether the lines refuse the model."""
        return self.spare > 0 and self.probability < _REFUSED

    @property
    def standard_error(self) -> FloatArray:
        """Random standard errors; inflated by the reduced chi-square where the lines refuse the model."""
        inflation = max(self.chi_square / self.spare, 1.0) if self.refused else 1.0
        return np.sqrt(inflation * np.diag(self.covariance))

    def half_width(self, level: float = 0.95) -> FloatArray:
        """Half the interval of every parameter: Student's t of the random part and normal of the shared one."""
        quantile = 0.5 + 0.5 * level
        random = stdtrit(self.dof, quantile) * self.standard_error
        return np.hypot(random, stdtrit(np.inf, quantile) * np.sqrt(np.diag(self.systematic)))

    def h(self, omega: FloatArray) -> ComplexArray:
        """Dynamic stiffness of the model, (n, 2, 2) [N/m]; `omega` (n,) [rad/s]."""
        K, C, M = (*self.parameters.reshape(-1, 2, 2), np.zeros((2, 2)))[:3]
        w = np.asarray(omega, dtype=float)[:, None, None]
        return np.asarray(K - w**2 * M + 1j * w * C)


@dataclass(frozen=True)
class SharedErrors:
    """What lines share, as draws."""

    lines: FloatArray  #: (n_lines, n, 8), N/m: change of Re and Im of h at every line
    runs: FloatArray  #: (n, n_runs): relative change of every run's force


@dataclass(frozen=True)
class _Solution:
    """Theta (2, q), the inverse of the normal equations, the noise and its weights of every line and run."""

    theta: FloatArray
    inverse: FloatArray
    weights: list[list[ComplexArray]]
    noise: list[list[ComplexArray]]


def fit_band(rows: Sequence[LineRows], model: str, instrument: str, shared: SharedErrors) -> BandModel | None:
    """Fit one model to the lines of a band; None where they are too few."""
    if instrument in ("displacement", "force"):
        rows = [replace(line, command=line.D if instrument == "displacement" else line.F) for line in rows]
        instrument = "given"
    basis = MODELS[model]
    omegas = np.array([line.omega for line in rows])
    middle = float(np.sqrt(omegas.min() * omegas.max()))
    m = basis(np.ones(1)).shape[1]
    if len(rows) < 2 * m:
        return None
    sums = [line_sums(line, middle, basis, instrument) for line in rows]
    solution = _solve(sums)
    if solution is None:
        return None
    covariance, dof = _covariance(sums, solution)
    moved = _moved(sums, solution, shared)
    parts = _parts(rows, (solution, middle, basis), instrument, shared)
    chi_square, spare, probability, misfit = _held_against(parts, 2 * solution.theta.shape[1])
    scale = np.repeat(1 / middle ** np.arange(m), 4)
    outer = np.outer(scale, scale)
    order = _by_kind(m)
    return BandModel(
        model,
        solution.theta.ravel()[order] * scale,
        covariance[np.ix_(order, order)] * outer,
        dof[order],
        (moved.T @ moved / len(moved))[np.ix_(order, order)] * outer,
        chi_square,
        spare,
        probability,
        misfit,
        (float(omegas.min()) / (2 * np.pi), float(omegas.max()) / (2 * np.pi)),
        len(rows),
        parts,
    )


def _by_kind(m: int) -> list[int]:
    """Places in Theta (2, 2 m), row by row, of kxx, kxy, kyx, kyy, cxx, ..."""
    return [i * 2 * m + 2 * s + j for s in range(m) for i in range(2) for j in range(2)]


def _solve(sums: list[list[RunSums]]) -> _Solution | None:
    """Theta with weights from its own residuals, a few times over."""
    n_runs, q = len(sums[0]), len(sums[0][0].A)
    weights = [[np.eye(2, dtype=complex)] * n_runs for _ in sums]
    theta: FloatArray = np.zeros((2, q))
    inverse: FloatArray = np.zeros((2 * q, 2 * q))
    noise: list[list[ComplexArray]] = []
    for _ in range(_ROUNDS):
        normal, moment = np.zeros((2 * q, 2 * q)), np.zeros(2 * q)
        for line, weight in zip(sums, weights):
            for run, w in zip(line, weight):
                normal += outer_matrix(w, run.A).real
                moment += (w @ run.B).real.ravel()
        if not np.linalg.cond(normal) < 1e12:
            return None
        inverse = np.asarray(np.linalg.inv(normal), dtype=float)
        theta = (inverse @ moment).reshape(2, q)
        noise = [[run.residual(theta) for run in line] for line in sums]
        weights = _weights(sums, noise)
    return _Solution(theta, inverse, weights, noise)


def _weights(sums: list[list[RunSums]], noise: list[list[ComplexArray]]) -> list[list[ComplexArray]]:
    """Inverse noise of every line and run, averaged over its neighbours."""
    spreads = np.array(noise)
    dof = np.array([[run.dof for run in line] for line in sums])
    floor = 1e-20 * float(np.mean([np.abs(run.B).mean() for line in sums for run in line])) ** 2 + 1e-300
    out = []
    for k in range(len(sums)):
        near = slice(max(k - _NEIGHBOURS, 0), k + _NEIGHBOURS + 1)
        share = dof[near] / dof[near].sum(axis=0)
        pooled = np.einsum("lr,lrik->rik", share, spreads[near])
        out.append([np.linalg.inv(each + floor * np.eye(2)) for each in pooled])
    size = np.mean([np.abs(w) for line in out for w in line])
    return [[w / size for w in line] for line in out]


def _covariance(sums: list[list[RunSums]], solution: _Solution) -> tuple[FloatArray, FloatArray]:
    """Covariance of Theta row by row, and the degrees of freedom of its variances."""
    parts, dof = [], []
    for line, weight, spreads in zip(sums, solution.weights, solution.noise):
        for run, w, spread in zip(line, weight, spreads):
            score = 0.5 * outer_matrix(w @ spread @ w.conj().T, run.Z).real
            parts.append(solution.inverse @ score @ solution.inverse.T)
            dof.append(2 * run.dof)
    each = np.einsum("kpp->kp", np.array(parts))
    return np.sum(parts, axis=0), satterthwaite(each, np.array(dof)[:, None])


def _moved(sums: list[list[RunSums]], solution: _Solution, shared: SharedErrors) -> FloatArray:
    """Change of Theta, row by row, in every draw of what lines share, (n, 2 q)."""
    q = len(sums[0][0].A)
    moment = np.zeros((len(shared.runs), 2 * q))
    for k, (line, weight) in enumerate(zip(sums, solution.weights)):
        change = (shared.lines[k, :, :4] + 1j * shared.lines[k, :, 4:]).reshape(-1, 2, 2)
        for r, (run, w) in enumerate(zip(line, weight)):
            total = np.einsum("nij,aj->nia", change, run.A0)
            if shared.runs[:, r].any():
                total = total + shared.runs[:, r, None, None] * (solution.theta @ run.A.T)
            moment += np.einsum("ik,nka->nia", w, total).real.reshape(len(moment), -1)
    return np.asarray(moment @ solution.inverse.T)


def _parts(
    rows: Sequence[LineRows], model: tuple[_Solution, float, Basis], instrument: str, shared: SharedErrors
) -> tuple[BandPart, ...]:
    """H in parts of the band; none where one of them cannot be solved."""
    solution, middle, basis = model
    order = _by_kind(2)
    parts = []
    for part in np.array_split(np.arange(len(rows)), min(_PARTS, len(rows) // 2)):
        sums = [line_sums(_left(rows[k], solution.theta, middle, basis), middle, complex_h, instrument) for k in part]
        alone = _solve(sums)
        if alone is None:
            return ()
        covariance, dof = _covariance(sums, alone)
        omega = float(np.mean([rows[k].omega for k in part]))
        by_model = np.einsum("s,isj->ij", basis(np.array([omega / middle]))[0], solution.theta.reshape(2, -1, 2))
        off = alone.theta.ravel()[order]
        h = by_model + (off[:4] + 1j * off[4:]).reshape(2, 2)
        section = replace(shared, lines=shared.lines[part])
        moved = _moved(sums, replace(alone, theta=np.concatenate([h.real, h.imag], axis=1)), section)[:, order]
        covariance = covariance[np.ix_(order, order)]
        span = (rows[part[0]].omega, rows[part[-1]].omega)
        parts.append(BandPart(omega, h, covariance, dof[order], moved, span, np.zeros(8), off))
    return tuple(parts)


def _held_against(parts: Sequence[BandPart], unknowns: int) -> tuple[float, int, float, float]:
    """Chi-square, degrees of freedom, probability and misfit of the model in parts of the band."""
    if not parts:
        return float("nan"), 0, 1.0, float("nan")
    spare = 8 * len(parts) - unknowns
    total, squares, noise_dof = 0.0, [], 0.0
    for part in parts:
        x, nu = part.off, float(np.median(part.dof))
        # a measured covariance of nu degrees of freedom, inverted, is too large by nu / (nu - p - 1) on average
        total += float(x @ np.linalg.solve(part.covariance, x)) * max(1 - (len(x) + 1) / nu, 0.1)
        size = float(np.sum(np.abs(part.h) ** 2))
        squares.append((float(x @ x) - float(np.trace(part.covariance))) / size)
        noise_dof += nu
    misfit = float(np.sqrt(max(*squares, 0.0)))
    probability = float(fdtrc(spare, noise_dof, total / spare)) if spare > 0 else 1.0
    return total, max(spare, 0), probability, misfit


def _left(line: LineRows, theta: FloatArray, middle: float, basis: Basis) -> LineRows:
    """The line's rows with the force that the model leaves."""
    powers = basis((line.omega + line.step * line.place) / middle)
    phi = (powers[:, :, None] * line.D[:, None, :]).reshape(len(line.D), -1)
    return line.with_force(line.F - phi @ theta.T)


def between(low: BandModel, high: BandModel) -> BandModel:
    """The middle of two estimates between which the truth lies, with an interval over both."""
    half = 0.5 * (high.parameters - low.parameters)
    unjudged = float("nan")  # the bias of either looks like a misfit
    # a rectangle's standard deviation is half its width by the root of three
    return replace(
        low,
        parameters=low.parameters + half,
        systematic=low.systematic + np.diag(half**2) / 3,
        covariance=np.diag(np.maximum(np.diag(low.covariance), np.diag(high.covariance))),
        chi_square=unjudged,
        probability=unjudged,
        misfit=unjudged,
        parts=tuple(_middle(a, b) for a, b in zip(low.parts, high.parts)),
    )


def _middle(low: BandPart, high: BandPart) -> BandPart:
    half = 0.5 * (high.h - low.h)
    return replace(
        low,
        h=low.h + half,
        covariance=np.diag(np.maximum(np.diag(low.covariance), np.diag(high.covariance))),
        bracket=np.concatenate([half.real.ravel(), half.imag.ravel()]),
    )


def supported(models: dict[str, BandModel]) -> str:
    """The simplest model that the lines do not refuse; ``"raw H"`` when they refuse all."""
    return next((name for name, model in models.items() if not model.refused), "raw H")
