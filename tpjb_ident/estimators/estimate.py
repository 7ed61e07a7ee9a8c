"""One interface to all estimators: displacement and force phasors in, dynamic stiffness out."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.near_names import unknown_name
from rigdata.units import to_si
from tpjb_ident.conditions import Condition, holding, merged
from tpjb_ident.errors import ArgumentError
from tpjb_ident.estimators.mm import mm_fit, within_directions
from tpjb_ident.estimators.r_matrix import (
    PhasorTable,
    TableFit,
    complex_to_real_covariance,
    displacement_condition,
    ols_fit,
    phasor_table,
)
from tpjb_ident.estimators.rlm import NORMS, RlmSettings, rlm_fit
from tpjb_ident.estimators.solved_windows import solved_windows
from tpjb_ident.estimators.stiffness import DynamicStiffness

#: Condition number of the displacement directions beyond which entries cannot be told apart.
_MAX_CONDITION = 30.0
_HUBER = RlmSettings()
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
        Norm of ``"rlm"``; see `tpjb_ident.estimators.rlm.NORMS`.
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


def _obstacles(table: PhasorTable, method: str) -> tuple[Condition, ...]:
    """Why a table gives no H, the first reason first."""
    few = len(table) < 2 or table.n_directions < 2
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
    spare = max(float(weights.sum()) - 2.0, 1e-12)
    noise = (weights * residual).T @ residual.conj() / spare
    inverse = np.linalg.inv((weights * table.D.conj()).T @ table.D)
    covariance = complex_to_real_covariance(np.asarray(np.kron(noise, inverse), dtype=complex))
    factor = 1.0 if "no-robust-start" in fit.conditions else variance
    return replace(fit, covariance=factor * covariance, dof=np.full(8, max(2.0 * spare, 1.0)))


def _in_units(table: PhasorTable, omega: float, name: str, fit: TableFit) -> DynamicStiffness:
    """Back to SI, weights back on all given windows, status from what the numbers say."""
    per_axis = np.repeat(fit.weights[:, None], 2, axis=1) if fit.weights.ndim == 1 else fit.weights
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


def fit_conditions(condition: float, weights: FloatArray, directions: int) -> tuple[Condition, ...]:
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

__all__ = ["METHODS", "NORMS", "estimate_dynamic_stiffness", "estimate_table"]
