"""Everything that was identified from a campaign, and how it becomes tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.dynamic.arrays import FloatArray
from tpjb_ident.dynamic.conditions import Condition
from tpjb_ident.dynamic.frequency_fit import FrequencyFit, LoadFits, fits_per_load
from tpjb_ident.dynamic.point_result import PointResult
from tpjb_ident.dynamic.stiffness import ENTRIES, DynamicStiffness

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Identification:
    """Result of `identify`.

    Attributes
    ----------
    campaign : str
    method : str
        Default method.
    points : tuple of PointResult
        Sorted by load, direction, speed, excitation.
    systematic : (8 P, 8 P) ndarray
        Calibration covariance over all P points, in their order [N^2/m^2].
    conditions : tuple of Condition
        About the campaign as a whole.
    """

    campaign: str
    method: str
    points: tuple[PointResult, ...]
    systematic: FloatArray = field(repr=False)
    conditions: tuple[Condition, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """One row per operating point, by the default method: ``coefficients.csv``."""
        import pandas as pd

        return pd.DataFrame([_row(p, p.stiffness) for p in self.points])

    def estimators_frame(self) -> pd.DataFrame:
        """The same table for every method: ``estimators.csv``."""
        import pandas as pd

        return pd.DataFrame([_row(p, est) for p in self.points for est in p.by_method.values()])

    def windows_frame(self) -> pd.DataFrame:
        """Rejected windows with run, time and reason: ``windows.csv``."""
        import pandas as pd

        columns = ["run", "time_s", "excitation_direction_deg", "weight", "reason", *_POINT_COLUMNS]
        rows = [
            {
                "run": w.run,
                "time_s": w.time,
                "excitation_direction_deg": float(np.degrees(w.direction)),
                "weight": w.weight,
                "reason": w.reason,
                **_point_columns(p),
            }
            for p in self.points
            for w in p.rejected
        ]
        return pd.DataFrame(rows, columns=columns)

    def frequency_fits(self) -> list[LoadFits]:
        """K-C and K-C-M over the excitation frequencies, for every load that was run at several."""
        return fits_per_load(self.points)

    def frequency_frame(self) -> pd.DataFrame:
        """One row per load and model: ``frequency_fits.csv``."""
        import pandas as pd

        return pd.DataFrame([_fit_row(group, fit) for group in self.frequency_fits() for fit in group.fits.values()])


_POINT_COLUMNS = ("static_load_N", "static_load_direction_deg", "shaft_speed_Hz", "excitation_Hz")


def _point_columns(p: PointResult) -> dict[str, float]:
    point = p.point
    values = (
        point.static_load,
        point.static_load_direction_deg,
        point.shaft_speed_hz,
        point.excitation_hz,
    )
    return dict(zip(_POINT_COLUMNS, values))


def _row(p: PointResult, est: DynamicStiffness) -> dict[str, Any]:
    row: dict[str, Any] = dict(_point_columns(p))
    row["static_load_measured_N"] = p.static_load_measured
    row.update(coefficient_columns(est))
    weights = est.weights.min(axis=1)
    row.update(
        method=est.method,
        n_records=p.n_records,
        n_windows=p.n_windows,
        condition_number=est.condition,
        outlier_fraction=float((weights < 0.3).mean()),
        quality="; ".join(str(c) for c in (p.quality if est is p.stiffness else est.status)) or "ok",
        quality_detail="; ".join(c.sentence() for c in (p.quality if est is p.stiffness else est.status)),
        n_windows_rejected=int((weights < 0.3).sum()),
        coherence=p.coherence,
        amplitude_m=p.amplitude,
        chi_square=est.chi_square,
        attenuation=float(est.attenuation[0]),
        x_m=p.position[0],
        y_m=p.position[1],
        x_m_se=p.position_se[0],
        y_m_se=p.position_se[1],
    )
    row.update({f"temperature_{pad}_K": value for pad, value in p.temperatures.items()})
    return row


def _fit_row(group: LoadFits, fit: FrequencyFit) -> dict[str, Any]:
    row: dict[str, Any] = {
        name: value for name, value in _point_columns(group.points[0]).items() if name != "excitation_Hz"
    }
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
    units = ["N_per_m"] * 4 + ["Ns_per_m"] * 4 + ["kg"] * 4
    for i, (value, error, unit) in enumerate(zip(values, errors, units)):
        name = f"{'kcm'[i // 4]}{ENTRIES[i % 4]}_{unit}"
        row[name], row[f"{name}_se"] = value, error
    return row


def coefficient_columns(est: DynamicStiffness) -> dict[str, float]:
    """K and C with their intervals under the names of ``coefficients.csv``.

    Returns
    -------
    dict
        For every coefficient the value, ``_lo``, ``_hi`` (95 %, random and calibration together),
        ``_se`` (random standard error) and ``_se_systematic`` (calibration).
    """
    half, se = est.half_width(0.95), est.standard_error
    systematic = np.zeros(8) if est.systematic is None else np.sqrt(np.diag(est.systematic))
    row: dict[str, float] = {}
    for symbol, unit, offset, factor in (("k", "N_per_m", 0, 1.0), ("c", "Ns_per_m", 4, 1 / est.omega)):
        for j, entry in enumerate(ENTRIES):
            name, i = f"{symbol}{entry}_{unit}", offset + j
            value = est.vector[i]
            row[name] = value * factor
            row[f"{name}_lo"] = (value - half[i]) * factor
            row[f"{name}_hi"] = (value + half[i]) * factor
            row[f"{name}_se"] = se[i] * factor
            row[f"{name}_se_systematic"] = systematic[i] * factor
    return row
