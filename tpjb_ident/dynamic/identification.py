"""Everything that was identified from a campaign, and how it becomes tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.dynamic.arrays import FloatArray
from tpjb_ident.dynamic.conditions import Condition
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
        x_m=p.position[0],
        y_m=p.position[1],
        x_m_se=p.position_se[0],
        y_m_se=p.position_se[1],
    )
    row.update({f"temperature_{pad}_K": value for pad, value in p.temperatures.items()})
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
