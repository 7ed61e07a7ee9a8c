"""Rows of the tables that an identification becomes; the names are promised to scripts (docs/results.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.dynamic.estimators.estimate import REJECTED_WEIGHT
from tpjb_ident.dynamic.estimators.stiffness import ENTRIES, DynamicStiffness
from tpjb_ident.dynamic.results.frequency_fit import FrequencyFit, LoadFits
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.schema import DAMPING, KINDS, POINT_COLUMNS, STATIC_COLUMNS, STIFFNESS

_FIT_FIGURES = (
    "model",
    "supported",
    "n_frequencies",
    "excitation_lowest_Hz",
    "excitation_highest_Hz",
    "chi_square",
    "dof",
    "probability",
    "largest_misfit",
)
_FIT_VALUES = tuple(column for kind in KINDS.values() for column in kind.columns)
FIT_COLUMNS = (*STATIC_COLUMNS, *_FIT_FIGURES, *(c for name in _FIT_VALUES for c in (name, f"{name}_se")))
WINDOW_COLUMNS = ("run", "time_s", "excitation_direction_deg", "weight", "reason", *POINT_COLUMNS)
#: Sources that scatter from run to run; all others are common to the runs.
RANDOM = ("random", "load miss", "mains")
BUDGET_COLUMNS = ("coefficient", "unit", "source", "kind", "standard_uncertainty", "share", "dof")


def point_columns(p: PointResult) -> dict[str, float]:
    """Key of a point.

    Parameters
    ----------
    p : PointResult
    """
    point = p.point
    values = (point.static_load, point.static_load_direction_deg, point.shaft_speed_hz, point.excitation_hz)
    return dict(zip(POINT_COLUMNS, values))


def estimate_row(p: PointResult, est: DynamicStiffness, group: LoadFits | None) -> dict[str, Any]:
    """One method's answer at one point, with everything needed to believe it or not.

    Parameters
    ----------
    p : PointResult
    est : DynamicStiffness
        One of the point's.
    group : LoadFits or None
        Models over frequency of the point's load, where it was run at several frequencies.
    """
    row: dict[str, Any] = dict(point_columns(p))
    row["static_load_measured_N"] = p.static_load_measured
    row.update(coefficient_columns(est))
    weights = est.weights.min(axis=1)
    conditions = p.quality if est is p.stiffness else est.status
    row.update(
        method=est.method,
        n_records=p.n_records,
        n_windows=p.n_windows,
        condition_number=est.condition,
        outlier_fraction=float((weights < REJECTED_WEIGHT).mean()),
        quality="; ".join(str(c) for c in conditions) or "ok",
        quality_detail="; ".join(c.sentence() for c in conditions),
        n_windows_rejected=int((weights < REJECTED_WEIGHT).sum()),
        coherence=p.coherence,
        amplitude_m=p.amplitude,
        amplitude_over_clearance=p.amplitude / p.clearance if p.clearance else np.nan,
        amplitude_slope=np.nan if p.linearity is None else p.linearity.stiffening,
        amplitude_slope_se=np.nan if p.linearity is None else p.linearity.standard_error,
        chi_square=est.chi_square,
        attenuation=float(est.attenuation[0]),
        inertia_corrected=p.inertia_corrected,
        baseline_subtracted="baseline" in p.budget,
        **_model_columns(group),
        x_m=p.position[0],
        y_m=p.position[1],
        x_m_se=p.position_se[0],
        y_m_se=p.position_se[1],
    )
    row.update({f"temperature_{pad}_K": value for pad, value in p.temperatures.items()})
    return row


def _model_columns(group: LoadFits | None) -> dict[str, Any]:
    """Which model over frequency the data of the point's load support, and its chi-square."""
    fit = None if group is None else group.fits.get(group.supported)
    return {
        "frequency_model": "single line" if group is None else group.supported,
        "frequency_chi_square": np.nan if fit is None else fit.chi_square,
        "frequency_dof": 0 if fit is None else fit.dof,
    }


def fit_row(group: LoadFits, fit: FrequencyFit) -> dict[str, Any]:
    """One model over frequency of one load.

    Parameters
    ----------
    group : LoadFits
    fit : FrequencyFit
    """
    row: dict[str, Any] = {name: point_columns(group.points[0])[name] for name in STATIC_COLUMNS}
    row.update(
        model=fit.model,
        supported=group.supported,
        n_frequencies=fit.n_frequencies,
        excitation_lowest_Hz=fit.omega_range[0] / (2 * np.pi),
        excitation_highest_Hz=fit.omega_range[1] / (2 * np.pi),
        chi_square=fit.chi_square,
        dof=fit.dof,
        probability=fit.probability,
        largest_misfit=fit.misfit,
    )
    errors = np.concatenate([fit.standard_error, np.zeros(12 - len(fit.standard_error))])
    values = np.concatenate([fit.K.ravel(), fit.C.ravel(), fit.M.ravel()])
    for name, value, error in zip(_FIT_VALUES, values, errors):
        row[name], row[f"{name}_se"] = value, error
    return row


def coefficient_columns(est: DynamicStiffness) -> dict[str, float]:
    """K and C with their intervals under the names of ``coefficients.csv``.

    Parameters
    ----------
    est : DynamicStiffness

    Returns
    -------
    dict
        For every coefficient the value, ``_lo``, ``_hi`` (95 %, random and calibration together), ``_se`` (random
        standard error) and ``_se_systematic`` (calibration), and half the width of the 95 % interval of either part,
        ``_random95`` and ``_systematic95``.
    """
    half, random, se = est.half_width(0.95), est.half_width(0.95, systematic=False), est.standard_error
    systematic = np.zeros(8) if est.systematic is None else np.sqrt(np.diag(est.systematic))
    row: dict[str, float] = {}
    for kind, offset, factor in ((STIFFNESS, 0, 1.0), (DAMPING, 4, 1 / est.omega)):
        for j, entry in enumerate(ENTRIES):
            name, i = kind.column(entry), offset + j
            value = est.vector[i]
            row[name] = value * factor
            row[f"{name}_lo"] = (value - half[i]) * factor
            row[f"{name}_hi"] = (value + half[i]) * factor
            row[f"{name}_se"] = se[i] * factor
            row[f"{name}_se_systematic"] = systematic[i] * factor
            row[f"{name}_random95"] = random[i] * factor
            row[f"{name}_systematic95"] = float(np.sqrt(max(half[i] ** 2 - random[i] ** 2, 0.0))) * factor
    return row


def with_systematic(est: DynamicStiffness, parts: Mapping[str, FloatArray]) -> DynamicStiffness:
    """The estimate with the sum of some systematic covariances (8, 8).

    Parameters
    ----------
    est : DynamicStiffness
    parts : mapping of str to (8, 8) ndarray
        By source [N^2/m^2].
    """
    return replace(est, systematic=np.sum(list(parts.values()), axis=0) if parts else np.zeros((8, 8)))


def budget_rows(
    point: Mapping[str, Any], est: DynamicStiffness, parts: Mapping[str, FloatArray]
) -> list[dict[str, Any]]:
    """Rows of ``budget.csv`` of one point.

    The intervals are its sum: the random sources together with Student's t of their degrees of freedom, the systematic
    ones normal, the two added as root sum of squares.

    Parameters
    ----------
    point : mapping
        Columns that name the point.
    est : DynamicStiffness
    parts : mapping of str to (8, 8) ndarray
        Covariance by source [N^2/m^2].
    """
    variances = {name: np.maximum(np.diag(part), 0.0) for name, part in parts.items()}
    total = np.sum(list(variances.values()), axis=0) if variances else np.zeros(8)
    rows = []
    for i in range(8):
        symbol, unit, factor = ("k", "N/m", 1.0) if i < 4 else ("c", "Ns/m", 1 / est.omega)
        for name, variance in variances.items():
            rows.append(
                {
                    **point,
                    "coefficient": f"{symbol}{ENTRIES[i % 4]}",
                    "unit": unit,
                    "source": name,
                    "kind": "random" if name in RANDOM else "systematic",
                    "standard_uncertainty": float(np.sqrt(variance[i])) * factor,
                    "share": float(variance[i] / total[i]) if total[i] > 0 else 0.0,
                    "dof": float(est.dof[i]) if name in RANDOM else np.inf,
                }
            )
    return rows
