"""One interface to all estimators: displacement and force phasors in, dynamic stiffness out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.near_names import unknown_name
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.estimators.instrumental import instrumental_fit
from tpjb_ident.dynamic.estimators.mm import mm_fit, within_directions
from tpjb_ident.dynamic.estimators.r_matrix import PhasorTable, displacement_condition, ols_fit, phasor_table
from tpjb_ident.dynamic.estimators.rlm import NORMS, RlmSettings, rlm_fit
from tpjb_ident.dynamic.estimators.solved_windows import solved_windows
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.estimators.uncertainty import homoscedastic, with_repeats
from tpjb_ident.errors import ArgumentError

#: Condition number of the displacement directions beyond which entries cannot be told apart.
_MAX_CONDITION = 30.0
#: Share of windows without weight beyond which the answer needs a look.
_MAX_REJECTED = 0.4
#: A window counts as rejected below this weight.
REJECTED_WEIGHT = 0.3
MIN_COHERENCE = 0.9


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
        Norm of ``"rlm"``; see `tpjb_ident.dynamic.estimators.rlm.NORMS`.
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

    Examples
    --------
    >>> stiffness, damping, omega = np.diag([3e8, 4.5e8]), np.diag([5e5, 7e5]), 2 * np.pi * 25
    >>> D = 1e-6 * np.array([[1, 0], [0, 1], [1, 1], [1, -1]], dtype=complex)  # four directions
    >>> est = ti.estimate_dynamic_stiffness(D, D @ (stiffness + 1j * omega * damping).T, omega, method="ols")
    >>> print(np.round(est.k / 1e6, 3).diagonal(), np.round(est.c / 1e3, 3).diagonal())
    [300. 450.] [500. 700.]
    """
    if method not in METHODS:
        raise ArgumentError(unknown_name("method", method, METHODS))
    if norm is not None and method != "rlm":
        raise ArgumentError(f'norm={norm!r} belongs to method="rlm", not to {method!r}')
    frequency = float(_si(omega, "rad/s", "omega"))
    if not (np.isfinite(frequency) and frequency > 0):
        raise ArgumentError(f"omega must be a positive number of rad/s, got {omega}")
    instruments = None if reference is None else getattr(reference, "magnitude", reference)
    if method == "iv" and reference is None:
        raise ArgumentError('method "iv" needs reference phasors (n, 2), for instance the actuators\' command')
    table = phasor_table(_si(D, "m", "D"), _si(F, "N", "F"), direction, instruments)
    return estimate_table(table, frequency, method, RlmSettings(norm or "huber"))


def estimate_table(
    table: PhasorTable, omega: float, method: str, rlm_settings: RlmSettings | None = None
) -> DynamicStiffness:
    """As `estimate_dynamic_stiffness`, for a table that is already checked and scaled."""
    if method not in METHODS:
        raise ArgumentError(unknown_name("method", method, METHODS))
    name = f"rlm:{(rlm_settings or RlmSettings()).norm}" if method == "rlm" else method
    obstacle = _obstacle(table) or _no_reference(table, method)
    if obstacle is not None:
        return _failed(table, omega, name, obstacle)
    if len(table) == 2:
        return _exact(table, omega, name)
    if method == "rlm" and rlm_settings is not None:  # the only one with settings of its own
        return _rlm(table, omega, name, rlm_settings)
    return SOLVERS[method](table, omega, name)


def _si(value: Any, unit: str, name: str) -> Any:
    """Plain SI numbers as they are, pint quantities converted."""
    if not (hasattr(value, "to") and hasattr(value, "magnitude")):
        return value
    try:
        return value.to(unit).magnitude
    except Exception as error:  # pint's own class depends on the registry the value came from
        raise ArgumentError(f"{name} must be convertible to {unit}, got {value.units}") from error


def _obstacle(table: PhasorTable) -> Condition | None:
    if len(table) < 2 or table.n_directions < 2:
        return Condition(
            "fewer-than-two-directions",
            f"{len(table)} usable windows in {table.n_directions} directions; H needs two directions at least",
        )
    if not np.isfinite(displacement_condition(table.D)):
        return Condition("fewer-than-two-directions", "all displacements are collinear: H needs two directions in them")
    return None


def _no_reference(table: PhasorTable, method: str) -> Condition | None:
    if method != "iv" or table.reference is not None:
        return None
    return Condition("no-reference", "instruments are missing: the runs do not state two excitation directions")


def _failed(table: PhasorTable, omega: float, name: str, why: Condition) -> DynamicStiffness:
    return DynamicStiffness(
        np.full((2, 2), np.nan + 0j),
        omega,
        np.full((8, 8), np.nan),
        np.full(8, np.nan),
        name,
        np.zeros((len(table.valid), 2)),
        (why,),
        displacement_condition(table.D),
    )


def _exact(table: PhasorTable, omega: float, name: str) -> DynamicStiffness:
    """Two windows: H solves them exactly, whatever the method, and no residual is left to tell an error from."""
    numbers = (ols_fit(table.D, table.F), np.full((8, 8), np.nan), np.full(8, np.nan), np.nan)
    none = Condition("no-residual", "as many windows as unknowns: there is no interval. Record more windows")
    return _result(table, omega, name, numbers, np.ones(2), (none,))


def _rlm(table: PhasorTable, omega: float, name: str, settings: RlmSettings | None = None) -> DynamicStiffness:
    fit = rlm_fit(table.D, table.F, settings)
    return _result(table, omega, name, (fit.h, fit.covariance, fit.dof, np.nan), fit.weights, fit.conditions)


def _ols(table: PhasorTable, omega: float, name: str) -> DynamicStiffness:
    h = ols_fit(table.D, table.F)
    weights = np.ones(len(table))
    return _result(table, omega, name, _regression(table, h, weights, 1.0), weights, ())


def _mm(table: PhasorTable, omega: float, name: str) -> DynamicStiffness:
    fit = mm_fit(table.D, table.F, table.direction)
    robust = "no-robust-start" not in fit.conditions
    numbers = _regression(table, fit.coefficients, fit.weights, 1 / 0.95 if robust else 1.0)
    return _result(table, omega, name, numbers, fit.weights, fit.conditions)


def _mm_eiv(table: PhasorTable, omega: float, name: str) -> DynamicStiffness:
    start = mm_fit(table.D, table.F, table.direction, tolerance=1e-7)  # tells which windows are good, no more
    solved = solved_windows(table, start.coefficients, within_directions(start.weights, table.direction))
    if solved is None:
        plain = _mm(table, omega, name)
        missing = Condition(
            "no-repeats",
            "too few repeats per direction for a noise covariance: plain MM, not corrected for displacement noise",
        )
        return replace(plain, status=merged(plain.status, (missing,)))
    numbers = (solved.h, solved.covariance, solved.dof, solved.chi_square)
    conditions = start.conditions + not_locked(solved.wandering, table.n_directions)
    result = _result(table, omega, name, numbers, solved.weights, conditions)
    return replace(result, attenuation=solved.attenuation)


def _iv(table: PhasorTable, omega: float, name: str) -> DynamicStiffness:
    fit = instrumental_fit(table)
    numbers = _regression(fit.explained, fit.h, fit.weights, 1 / 0.95)
    return _result(table, omega, name, numbers, fit.weights, fit.conditions)


_Numbers = tuple[ComplexArray, FloatArray, FloatArray, float]


def _regression(table: PhasorTable, h: ComplexArray, weights: FloatArray, correction: float) -> _Numbers:
    """Covariance of a weighted regression: from the repeats where there are any, else from residuals."""
    repeated = with_repeats(table, h, weights, correction)
    if repeated is not None:
        return h, repeated[0], repeated[1], repeated[2]
    covariance, dof = homoscedastic(table.D, table.F - table.D @ h.T, weights, correction)
    return h, covariance, dof, np.nan


def _result(
    table: PhasorTable,
    omega: float,
    name: str,
    numbers: _Numbers,
    weights: FloatArray,
    conditions: tuple[Condition, ...],
) -> DynamicStiffness:
    """Back to SI, weights back on all given windows, status from what the numbers say."""
    h, covariance, dof, chi_square = numbers
    per_axis = np.repeat(weights[:, None], 2, axis=1) if weights.ndim == 1 else weights
    joint = per_axis.min(axis=1)
    condition = displacement_condition(table.D, joint)
    all_weights = np.zeros((len(table.valid), 2))
    all_weights[table.valid] = per_axis
    used = len(np.unique(table.direction[joint > 0]))
    return DynamicStiffness(
        h * table.h_scale,
        omega,
        covariance * table.h_scale**2,
        dof,
        name,
        all_weights,
        merged(conditions, tuple(fit_conditions(condition, joint, used))),
        condition,
        chi_square,
        4 * (used - 2),
    )


def fit_conditions(condition: float, weights: FloatArray, directions: int) -> list[Condition]:
    """What the windows of a fit say of it: condition number of their displacements, weights, directions."""
    found = []
    if condition > _MAX_CONDITION:
        text = f"condition number {condition:.3g} of the displacement directions > 30"
        found.append(Condition("ill-conditioned", text))
    rejected = float((weights < REJECTED_WEIGHT).mean()) if len(weights) else 0.0
    if rejected > _MAX_REJECTED:
        text = f"{100 * rejected:.0f} % of the windows got no weight (limit 40 %)"
        found.append(Condition("many-windows-rejected", text))
    if directions == 2:
        text = "two directions only: the interval cannot see what runs differ by, only their repeats"
        found.append(Condition("no-spare-direction", text))
    return found


def not_locked(wandering: int, directions: int) -> tuple[Condition, ...]:
    """Say in how many directions the drive's phase wanders."""
    if not wandering:
        return ()
    text = f"drive phase wanders in {wandering} of {directions} directions; their windows were turned to one phase"
    return (Condition("drive-not-locked", text),)


#: What solves Eq. (15) by each method: a new estimator is a function here.
SOLVERS: dict[str, Callable[[PhasorTable, float, str], DynamicStiffness]] = {
    "ols": _ols,
    "rlm": _rlm,
    "mm": _mm,
    "mm-eiv": _mm_eiv,
    "iv": _iv,
}
METHODS = tuple(SOLVERS)

__all__ = ["METHODS", "NORMS", "estimate_dynamic_stiffness", "estimate_table"]
