"""One interface to all estimators: displacement and force phasors in, dynamic stiffness out.

The paper's choice is statsmodels' robust linear model on the stacked real rows of Eq. (15).
Every identification solves Huber's and Tukey's norms with the MAD scale, and the import of statsmodels would make it
1.2 times as long: there, where its covariance is not asked for, these two are reweighted here, equal to statsmodels to
the last bit. Else statsmodels itself is run.

Kept as a reference with its traps guarded: complex input is refused (statsmodels takes it and returns false standard
errors), the system is scaled before (``conv="coefs"`` has an absolute tolerance and never ends in SI units), and
reaching the iteration limit is reported (statsmodels says nothing). What cannot be guarded: Re and Im of a row get
weights of their own, and the M-estimator has no breakdown against bad displacements. `mm` exists for that.

The default method on windows alone is the campaign's own solve, for a single operating point. The windows of a
direction become one block with the covariance of its noise. Noise of the displacements cannot pull H towards zero
there, directions that differ by more than their repeats show as scatter, and one that stands apart from the others
loses its weight: `tpjb_ident.estimate.solve`, without terms.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.near_names import unknown_name
from rigdata.operating_point import OperatingPoint
from rigdata.units import to_si
from tpjb_ident.conditions import Condition, Conditions, holding, merged
from tpjb_ident.errors import ArgumentError, TpjbError
from tpjb_ident.estimate.arrowhead import Shape
from tpjb_ident.estimate.equation import Rig, Sensor, stacked
from tpjb_ident.estimate.noise import unbiased_noise
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.solve import Solver
from tpjb_ident.estimate.statistics import bisquare_weight, huber_weight, reweighted
from tpjb_ident.estimate.window_means import Readings, attenuation, window_means
from tpjb_ident.estimators.least_trimmed import mm_fit, within_directions
from tpjb_ident.estimators.r_matrix import (
    PhasorTable,
    TableFit,
    complex_to_real_covariance,
    displacement_condition,
    ols_fit,
    phasor_table,
    real_rows,
)
from tpjb_ident.estimators.stiffness import DynamicStiffness

#: Fewer spare repeats than this cannot give a 4x4 complex covariance worth using.
_MIN_SPARE_REPEATS = 8.0
#: Rows of a table: displacement and force along X and Y, straight, without uncertainty.
_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
_QUANTITIES = ("displacement", "displacement", "force", "force")
_RIG = Rig(tuple(Sensor(quantity, quantity) for quantity in _QUANTITIES), mass=0.0, mount="unknown")


def solved_windows(table: PhasorTable, start: ComplexArray, weights: FloatArray) -> TableFit | None:
    """Solve from a start of H (2, 2) with window weights (n,); None where repeats are too few for a noise."""
    z = np.concatenate([table.D, table.F], axis=1)
    present = np.ones((table.n_directions, 4), dtype=bool)
    # a table has no times: its windows tell of no drift, nor what of their scatter is motion
    means = window_means(z, table.direction, np.zeros(len(z)), Readings([""] * 4, np.zeros((4, 4))), weights, present)
    if means is None or means.spare < _MIN_SPARE_REPEATS:
        return None
    noise = unbiased_noise(means.noise, means.spare)
    rows = []  # a block a direction that has windows
    for g in np.flatnonzero(means.count > 0):
        row = {"run": g, "omega": 1.0, "z": means.mean[g], "noise": noise / means.count[g], "dof": means.spare}
        rows.append(row | {"present": np.ones(4, dtype=bool), "along": _AXES})
    names = [str(g) for g in range(len(means.count))]
    blocks = stacked([OperatingPoint(0.0, excitation=1.0)], names, 4, rows)
    # what scatter a good rig has is not asked: a table may be computed
    shape = Shape(np.zeros(1, dtype=np.intp), scatter=replace(Scatter.none(1, len(blocks)), usual=0.0))
    solution = Solver(_RIG, blocks, (), start[None], shape).run()
    if not np.isfinite(solution.h).all():
        return None
    run_weights = np.zeros(table.n_directions)
    run_weights[blocks.run] = solution.scatter.weights
    return TableFit(
        solution.h[0],
        means.weights * run_weights[table.direction],
        solution.records[0],
        solution.freedom(0),
        not_locked(means.wandering, table.n_directions),
        float(solution.chi_square[0]),
        attenuation(means.mean[:, :2], means.count, means.noise[:2, :2]),
    )


def not_locked(wandering: int, directions: int) -> Conditions:
    """Say in how many directions the drive's phase wanders."""
    text = f"drive phase wanders in {wandering} of {directions} directions; their windows were turned to one phase"
    return holding((wandering, "drive-not-locked", text))


#: Names of the norms and the statsmodels class behind each.
NORMS = {
    "huber": "HuberT",
    "tukey": "TukeyBiweight",
    "bisquare": "TukeyBiweight",
    "hampel": "Hampel",
    "andrew": "AndrewWave",
    "ramsay": "RamsayE",
    "trimmed": "TrimmedMean",
    "quartic": "TukeyQuartic",
    "student": "StudentT",
    "mquantile": "MQuantileNorm",
    "least-squares": "LeastSquares",
}
#: Weight and threshold in scales, statsmodels' own, of the norms that are solved without it.
_QUICK = {"huber": (huber_weight, 1.345), "tukey": (bisquare_weight, 4.685), "bisquare": (bisquare_weight, 4.685)}


@dataclass(frozen=True)
class RlmSolution:
    """One real robust regression: what statsmodels' ``RLM(...).fit(conv="coefs")`` tells of it."""

    params: FloatArray  #: (p,)
    weights: FloatArray  #: (m,)
    scale: float
    iterations: int
    covariance: FloatArray | float = np.nan  #: (p, p): H1, scaled; NaN where it is not asked for
    conditions: Conditions = ()


class ComplexInputError(TpjbError, TypeError):
    """Complex numbers given to a solver of real systems."""


@dataclass(frozen=True)
class RlmSettings:
    """How statsmodels is to be run."""

    norm: str = "huber"
    scale: Any = "mad"  #: as `RLM.fit` takes it
    max_iterations: int = 200
    tolerance: float = 1e-10
    quick: bool = False  #: whether its covariance is not asked for


_HUBER = RlmSettings()


def solve_rlm(design: FloatArray, response: FloatArray, settings: RlmSettings = _HUBER) -> RlmSolution:
    """Run statsmodels' RLM on a real system, guarded; `design` (m, p), `response` (m,)."""
    if np.iscomplexobj(design) or np.iscomplexobj(response):
        raise ComplexInputError(
            "RLM solves real systems; complex data would come back with false standard errors. "
            "Stack real and imaginary parts first (tpjb_ident.estimators.r_matrix.real_rows)"
        )
    if settings.quick and settings.norm in _QUICK:
        weight, threshold = _QUICK[settings.norm]
        tolerance, most = settings.tolerance, settings.max_iterations
        fit = RlmSolution(*reweighted(design, response, lambda u: weight(u, threshold), None, tolerance, most))
    else:
        fit = _statsmodels(design, response, settings)
    stopped, exact = fit.iterations >= settings.max_iterations, "more than half of the rows fit exactly"
    is_exact = not fit.scale > 1e-14 * np.abs(response).max(initial=0.0)
    conditions = holding(
        (stopped, "iteration-limit", f"RLM stopped after {fit.iterations} iterations"),
        (is_exact, "zero-scale", f"{exact}; no standard errors exist"),
    )
    return replace(fit, conditions=conditions)


def _statsmodels(design: FloatArray, response: FloatArray, settings: RlmSettings) -> RlmSolution:
    from statsmodels.robust import norms
    from statsmodels.robust.robust_linear_model import RLM

    if settings.norm not in NORMS:
        raise ArgumentError(unknown_name("norm", settings.norm, NORMS))
    extra: dict[str, Callable[[], Any]] = {
        "student": lambda: norms.StudentT(c=1.0, df=4.0),
        "mquantile": lambda: norms.MQuantileNorm(0.5, norms.HuberT()),  # the symmetric one, which estimates H
    }
    norm = extra.get(settings.norm, getattr(norms, NORMS[settings.norm]))()
    fit = RLM(response, design, M=norm).fit(
        maxiter=settings.max_iterations, tol=settings.tolerance, conv="coefs", scale_est=settings.scale
    )
    params, weights, covariance = (np.asarray(values) for values in (fit.params, fit.weights, fit.bcov_scaled))
    return RlmSolution(params, weights, float(fit.scale), int(fit.fit_history["iteration"]), covariance)


def rlm_fit(D: ComplexArray, F: ComplexArray, settings: RlmSettings = _HUBER) -> TableFit:
    """Solve Eq. (15) axis by axis with statsmodels; `D`, `F` (n, 2)."""
    n = len(D)
    h = np.zeros((2, 2), dtype=complex)
    covariance = np.zeros((8, 8))
    weights = np.ones((n, 2))
    conditions: Conditions = ()
    for axis in range(2):
        design, response = real_rows(D, F[:, axis])
        solution = solve_rlm(design, response, settings)
        h[axis] = solution.params[:2] + 1j * solution.params[2:]
        rows = 2 * axis + np.array([0, 1, 4, 5])
        covariance[np.ix_(rows, rows)] = solution.covariance
        weights[:, axis] = np.minimum(solution.weights[:n], solution.weights[n:])
        conditions += solution.conditions
    return TableFit(h, weights, covariance, np.full(8, max(2.0 * n - 4.0, 1.0)), conditions)


#: Condition number of the displacement directions beyond which entries cannot be told apart.
_MAX_CONDITION = 30.0
#: Share of windows without weight beyond which the answer needs a look.
_MAX_REJECTED = 0.4
#: A window counts as rejected below this weight.
REJECTED_WEIGHT = 0.3
MIN_COHERENCE = 0.9
#: Variance of a robust regression over that of the solve: 0.95 is the efficiency of its weights; with every run's mean
#: for an instrument h goes 0.7 standard deviations away from the solve's (624 entries of samples; others 0.2 to 0.3).
_VARIANCE = {"mm": 1 / 0.95, "mm-eiv": 1 / 0.95, "iv": 1.5}


def estimate_dynamic_stiffness(
    D: Any,
    F: Any,
    omega: Any,
    direction: Any = None,
    method: str = "mm-eiv",
    norm: str | None = None,
    reference: Any = None,
) -> DynamicStiffness:
    """Solve Eq. (15) for the 2x2 complex dynamic stiffness of a bearing.

    Parameters
    ----------
    D : (n, 2) complex array
        Displacement phasors X, Y [m], one row per record window; exp(+i omega t).
    F : (n, 2) complex array
        Oil-force phasors [N].
    omega : float
        Excitation frequency [rad/s].
    direction : (n,) array of labels, optional
        Windows with one label are repeats of one excitation.
    method : {"mm-eiv", "mm", "rlm", "ols", "iv"}
        Without enough repeats ``"mm-eiv"`` falls back to ``"mm"`` and says so in `status`.
    norm : str, optional
        Norm of ``"rlm"``; see `tpjb_ident.estimators.estimate.NORMS`.
    reference : (n, 2) complex array, optional
        Instruments for ``"iv"`` (for instance the actuators' command), any unit.

    Returns
    -------
    DynamicStiffness
        With NaN in `h` and the reason in `status` where the data give no answer.

    Raises
    ------
    ArgumentError
        Shapes that do not fit, an unknown method or norm, omega not positive.
    UnitError
        A pint quantity of another dimension.

    Examples
    --------
    >>> stiffness, damping, omega = np.diag([3e8, 4.5e8]), np.diag([5e5, 7e5]), 2 * np.pi * 25
    >>> D = 1e-6 * np.array([[1, 0], [0, 1], [1, 1], [1, -1]], dtype=complex)  # four directions
    >>> est = ti.estimate_dynamic_stiffness(D, D @ (stiffness + 1j * omega * damping).T, omega, method="ols")
    >>> print(np.round(est.k / 1e6, 3).diagonal(), np.round(est.c / 1e3, 3).diagonal())
    [300. 450.] [500. 700.]
    """
    method, settings = method_of(f"{method}:{norm}" if norm else method)
    frequency = float(to_si(omega, "speed", "omega"))
    if not 0 < frequency < np.inf:
        raise ArgumentError(f"omega must be a positive number of rad/s, got {omega}")
    instruments = None if reference is None else getattr(reference, "magnitude", reference)
    if method == "iv" and reference is None:
        raise ArgumentError('method "iv" needs reference phasors (n, 2), for instance the actuators\' command')
    table = phasor_table(to_si(D, "length", "D"), to_si(F, "force", "F"), direction, instruments)
    return estimate_table(table, frequency, method, settings)


def method_of(name: str) -> tuple[str, RlmSettings]:
    """Method and norm of a name such as "rlm:tukey"; refused before anything is computed where one is not known."""
    method, _, norm = name.partition(":")
    if method not in METHODS:
        raise ArgumentError(unknown_name("method", method, METHODS))
    if norm and method != "rlm":
        raise ArgumentError(f'norm={norm!r} belongs to method="rlm", not to {method!r}')
    return method, RlmSettings(norm or "huber")


def estimate_table(
    table: PhasorTable,
    omega: float,
    method: str,
    rlm_settings: RlmSettings = _HUBER,
    reference: DynamicStiffness | None = None,
) -> DynamicStiffness:
    """As `estimate_dynamic_stiffness`, of a table; how windows and runs scatter a `reference` estimate knows better."""
    settings = replace(rlm_settings, quick=reference is not None)
    name = f"rlm:{settings.norm}" if method == "rlm" else method
    obstacles = _obstacles(table, method)
    if obstacles:
        nothing, condition = np.full((8, 8), np.nan), displacement_condition(table.D)
        none, weights = np.full((2, 2), np.nan + 0j), np.zeros((len(table.valid), 2))
        return DynamicStiffness(none, omega, nothing, nothing[0], name, weights, obstacles[:1], condition)
    fit, windows = (_exact(table), table) if len(table) == 2 else SOLVERS[method](table, settings)
    if reference is not None:
        covariance = _VARIANCE.get(method, 1.0) * reference.covariance
        fit = replace(fit, dof=reference.dof, chi_square=reference.chi_square)
        estimate = _in_units(table, omega, name, fit)
        return replace(estimate, covariance=covariance, systematic=reference.systematic)
    if np.isnan(fit.dof).any() and len(table) > 2:
        fit = _with_scatter(windows, fit, _VARIANCE.get(method, 1.0))
    return _in_units(table, omega, name, fit)


def _obstacles(table: PhasorTable, method: str) -> Conditions:
    """Why a table gives no H, the first reason first."""
    few = table.n_directions < 2
    count = f"{len(table)} usable windows in {table.n_directions} directions; H needs two directions at least"
    is_line = not np.isfinite(displacement_condition(table.D))
    line = "all displacements are collinear: H needs two directions in them"
    missing = "instruments are missing: the runs do not state two excitation directions"
    return holding(
        (few, "fewer-than-two-directions", count),
        (is_line and not few, "fewer-than-two-directions", line),
        (method == "iv" and table.reference is None, "no-reference", missing),
    )


def _exact(table: PhasorTable) -> TableFit:
    """Two windows: H solves them exactly, whatever the method, and no residual is left to tell an error from."""
    none = Condition("no-residual", "as many windows as unknowns: there is no interval. Record more windows")
    return TableFit(ols_fit(table.D, table.F), np.ones(2), conditions=(none,))


def _mm(table: PhasorTable) -> TableFit:
    fit = mm_fit(table.D, table.F, table.direction)
    return TableFit(fit.coefficients, fit.weights, conditions=fit.conditions)


def _mm_eiv(table: PhasorTable, settings: RlmSettings) -> tuple[TableFit, PhasorTable]:
    start = mm_fit(table.D, table.F, table.direction, tolerance=1e-7)  # tells which windows are good, no more
    solved = solved_windows(table, start.coefficients, within_directions(start.weights, table.direction))
    if solved is not None:
        return replace(solved, conditions=start.conditions + solved.conditions), table
    plain = _mm(table)
    text = "too few repeats per direction for a noise covariance: plain MM, not corrected for displacement noise"
    return replace(plain, conditions=merged(plain.conditions, (Condition("no-repeats", text),))), table


def instrumental_fit(table: PhasorTable) -> tuple[TableFit, PhasorTable]:
    """Robust instrumental variables: reference channels against noise on the displacements.

    All four measured phasors are regressed, robustly and jointly, on the two references: H = B_F B_D^-1. The table is
    that of what the references explain of D, with F - h D as it was.
    """
    if table.reference is None:
        raise ArgumentError('method "iv" needs reference phasors (n, 2), for instance the actuators\' command')
    # The fit follows any change of components; what plain least squares leaves of F has little in common with D, and
    # where it is nothing at all the scatter is badly scaled instead of singular.
    plain = ols_fit(table.D, table.F)
    z = np.concatenate([table.D, table.F - table.D @ plain.T], axis=1)
    fit = mm_fit(table.reference, z, table.direction)
    B_D, B_left = fit.coefficients[:2], fit.coefficients[2:]
    h = plain + np.linalg.solve(B_D.T, B_left.T).T
    D = table.reference @ B_D.T
    explained = replace(table, D=D, F=table.F - (table.D - D) @ h.T)
    return TableFit(h, fit.weights, conditions=fit.conditions), explained


def _with_scatter(table: PhasorTable, fit: TableFit, variance: float) -> TableFit:
    """A weighted regression with its scatter as the default method has it: that of the repeats and of the runs."""
    solved = solved_windows(table, fit.h, fit.weights)
    if solved is not None:
        covariance = variance * solved.covariance
        return replace(fit, covariance=covariance, dof=solved.dof, chi_square=solved.chi_square)
    # all residuals alike: two real ones per spare complex one; both parts of a row share their scale
    residual, weights = table.F - table.D @ fit.h.T, fit.weights[:, None]
    spare = max(weights.sum() - 2.0, 1e-12)
    noise = (weights * residual).T @ residual.conj() / spare
    inverse = np.linalg.inv((weights * table.D.conj()).T @ table.D)
    covariance = complex_to_real_covariance(np.kron(noise, inverse))
    factor = 1.0 if "no-robust-start" in fit.conditions else variance
    return replace(fit, covariance=factor * covariance, dof=np.full(8, max(2.0 * spare, 1.0)))


def _in_units(table: PhasorTable, omega: float, name: str, fit: TableFit) -> DynamicStiffness:
    """Back to SI, weights back on all given windows, status from what the numbers say."""
    per_axis = fit.weights.reshape(len(table), -1)
    joint = per_axis.min(axis=1)
    condition = displacement_condition(table.D, joint)
    all_weights = np.zeros((len(table.valid), 2))
    all_weights[table.valid] = per_axis
    used = len(np.unique(table.direction[joint > 0]))
    return DynamicStiffness(
        fit.h * table.h_scale,
        omega,
        fit.covariance * table.h_scale**2,
        fit.dof,
        name,
        all_weights,
        merged(fit.conditions, fit_conditions(condition, joint, used)),
        condition,
        fit.chi_square,
        4 * (used - 2),
        fit.attenuation,
    )


def fit_conditions(condition: float, weights: FloatArray, directions: int) -> Conditions:
    """What the windows of a fit say of it: condition number of their displacements, weights, directions."""
    rejected = float((weights < REJECTED_WEIGHT).mean()) if len(weights) else 0.0
    number = f"condition number {condition:.3g} of the displacement directions > 30"
    lost = f"{100 * rejected:.0f} % of the windows got no weight (limit 40 %)"
    two = "two directions only: the interval cannot see what runs differ by, only their repeats"
    return holding(
        (condition > _MAX_CONDITION, "ill-conditioned", number),
        (rejected > _MAX_REJECTED, "many-windows-rejected", lost),
        (directions == 2, "no-spare-direction", two),
    )


#: What solves Eq. (15) by each method, with the windows whose scatter tells how well: a new estimator is a line here.
SOLVERS: dict[str, Callable[[PhasorTable, RlmSettings], tuple[TableFit, PhasorTable]]] = {
    "ols": lambda table, _: (TableFit(ols_fit(table.D, table.F), np.ones(len(table))), table),
    "rlm": lambda table, settings: (rlm_fit(table.D, table.F, settings), table),
    "mm": lambda table, _: (_mm(table), table),
    "mm-eiv": _mm_eiv,
    "iv": lambda table, _: instrumental_fit(table),
}
METHODS = tuple(SOLVERS)
