"""Everything that was identified from a campaign, and how it becomes tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.estimate import REJECTED_WEIGHT
from tpjb_ident.estimators.stiffness import ENTRIES, DynamicStiffness
from tpjb_ident.presentation import Presented
from tpjb_ident.results.frequency_model import MODEL_COLUMNS, StaticFits, fits_over_frequency
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.schema import DAMPING, POINT_KEY, STATIC_KEY, STIFFNESS

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.results.band_result import BandResult

_WINDOW_COLUMNS = ("run", "time_s", "excitation_direction_deg", "weight", "reason", *POINT_KEY)
#: Sources that scatter from run to run; all others are common to the runs.
_RANDOM = ("random", "load miss", "load direction", "mains")
_BUDGET_COLUMNS = ("coefficient", "unit", "source", "kind", "standard_uncertainty", "share", "dof")


@dataclass(frozen=True, repr=False)
class Identification(Presented):
    """Result of `identify`.

    Attributes
    ----------
    campaign : str
    method : str
        Default method.
    points : tuple of PointResult
        Sorted by load, direction, speed, excitation.
    calibration_changes : (n, 8 P) ndarray
        What n sources that the points share do to the entries of all P points, in their order [N/m].
    conditions : tuple of Condition
        About the campaign as a whole.
    bands : tuple of BandResult
        Of runs that were excited over a band.
    calibration_names : tuple of str
        Source of each row of `calibration_changes`, term and parameter; empty where rows have no name.
    cell_stiffness : (float, float) or None
        Of what the housing stands on along X and Y, as its accelerometers show it [N/m]; None where they do not.

    Examples
    --------
    >>> result = ti.identify(demo)
    >>> result.to_dataframe()[["static_load_N", "kyy_N_per_m", "kyy_N_per_m_lo", "kyy_N_per_m_hi"]].shape
    (7, 4)
    """

    campaign: str
    method: str
    points: tuple[PointResult, ...]
    calibration_changes: FloatArray = field(repr=False)
    conditions: tuple[Condition, ...] = ()
    bands: tuple[BandResult, ...] = ()
    calibration_names: tuple[str, ...] = field(default=(), repr=False)
    cell_stiffness: tuple[float, float] | None = field(default=None, repr=False)

    @property
    def systematic(self) -> FloatArray:
        """Systematic covariance over all P points, (8 P, 8 P) [N^2/m^2]; made when asked for: it grows with P^2."""
        joint = np.asarray(self.calibration_changes.T @ self.calibration_changes / len(self.calibration_changes))
        for p, point in enumerate(self.points):
            if point.stiffness.systematic is not None:  # what no point shares stands with its own alone
                joint[8 * p : 8 * p + 8, 8 * p : 8 * p + 8] = point.stiffness.systematic
        return joint

    def summary(self) -> str:
        """Direct coefficients of every point with half their 95 % intervals, and its flags."""
        lines = [f"{self.campaign}: {len(self.points)} operating points by {self.method}"]
        return "\n".join([*lines, *(str(p) for p in self.points)])

    def plot(self, **options: Any) -> Any:
        """Draw the direct stiffness over load; see `tpjb_ident.report.plots.direct_coefficients`.

        Parameters
        ----------
        **options
            ``part``, ``over``, ``entries``, ``title``.
        """
        from tpjb_ident.report import plots

        return plots.direct_coefficients({self.campaign: self}, **options)

    def to_frame(self) -> pd.DataFrame:
        """One row per operating point, by the default method: ``coefficients.csv``."""
        import pandas as pd

        groups = self._groups()
        return pd.DataFrame([_estimate_row(p, p.stiffness, groups.get(i)) for i, p in enumerate(self.points)])

    def estimators_frame(self) -> pd.DataFrame:
        """The same table for every method: ``estimators.csv``."""
        import pandas as pd

        groups = self._groups()
        return pd.DataFrame(
            [_estimate_row(p, est, groups.get(i)) for i, p in enumerate(self.points) for est in p.by_method.values()]
        )

    def windows_frame(self) -> pd.DataFrame:
        """Rejected windows with run, time and reason: ``windows.csv``."""
        import pandas as pd

        rows = [
            {
                "run": w.run,
                "time_s": w.time,
                "excitation_direction_deg": float(np.degrees(w.direction)),
                "weight": w.weight,
                "reason": w.reason,
                **point_columns(p),
            }
            for p in self.points
            for w in p.rejected
        ]
        return pd.DataFrame(rows, columns=list(_WINDOW_COLUMNS))

    def budget_frame(self) -> pd.DataFrame:
        """What every source adds to every coefficient's uncertainty: ``budget.csv``."""
        import pandas as pd

        rows = [row for p in self.points for row in _budget_rows(point_columns(p), p.stiffness, p.budget)]
        return pd.DataFrame(rows, columns=[*POINT_KEY, *_BUDGET_COLUMNS])

    def frequency_fits(self) -> list[StaticFits]:
        """K-C and K-C-M over the excitation frequencies, for every load that was run at several."""
        return fits_over_frequency(self.points, self.calibration_changes)

    def frequency_frame(self) -> pd.DataFrame:
        """One row per load and model: ``frequency_fits.csv``."""
        import pandas as pd

        rows = []
        for group in self.frequency_fits():
            key = dict(zip(STATIC_KEY, group.points[0].point.static_key))
            for name, fit in group.fits.items():
                rows.append({**key, "model": name, "supported": group.supported, **fit.columns()})
        return pd.DataFrame(rows, columns=[*STATIC_KEY, "model", "supported", *MODEL_COLUMNS])

    def remarks(self) -> tuple[str, ...]:
        """What somebody should read beside the numbers: each condition once, with the places where it was found."""
        remarks = [condition.sentence() for condition in self.conditions]
        places: dict[str, list[str]] = {}
        for p in self.points:
            for condition in p.quality:
                place = f"{p.point.static_load / 1e3:g} kN, {p.point.excitation_hz:g} Hz"
                places.setdefault(str(condition), []).append(f"{place}: {condition.detail or 'found'}")
        for band in self.bands:
            for condition in () if band.points else band.quality:
                place = f"{band.point.static_load / 1e3:g} kN, {band.kind}"
                places.setdefault(str(condition), []).append(f"{place}: {condition.detail or 'found'}")
        for name, sentences in places.items():
            count = len(sentences) - 1
            more = f" (and at {count} more point{'s' if count > 1 else ''})" if count else ""
            remarks.append(f"{name} at {sentences[0]}{more}")
        return tuple(remarks)

    def _groups(self) -> dict[int, StaticFits]:
        """Models over frequency by the index of the points that they belong to."""
        index = {id(p): i for i, p in enumerate(self.points)}
        return {index[id(p)]: group for group in self.frequency_fits() for p in group.points}


def point_columns(p: PointResult) -> dict[str, object]:
    """Key of a point."""
    return dict(zip(POINT_KEY, p.point.key))


def _estimate_row(p: PointResult, est: DynamicStiffness, group: StaticFits | None) -> dict[str, Any]:
    """One method's answer at one point, with everything needed to believe it or not."""
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
        outlier_fraction=float((weights < REJECTED_WEIGHT).sum()) / max(len(weights), 1),
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
        frequency_model="single line" if group is None else group.supported,
        x_m=p.position[0],
        y_m=p.position[1],
        x_m_se=p.position_se[0],
        y_m_se=p.position_se[1],
    )
    row.update({f"temperature_{pad}_K": value for pad, value in p.temperatures.items()})
    return row


def coefficient_columns(est: DynamicStiffness) -> dict[str, float]:
    """K and C with their intervals under the names of ``coefficients.csv``."""
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


def _budget_rows(
    point: Mapping[str, Any], est: DynamicStiffness, parts: Mapping[str, FloatArray]
) -> list[dict[str, Any]]:
    """Rows of ``budget.csv`` of one point.

    The intervals are its sum: the random sources together with Student's t of their degrees of freedom, the systematic
    ones normal, the two added as root sum of squares.
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
                    "kind": "random" if name in _RANDOM else "systematic",
                    "standard_uncertainty": float(np.sqrt(variance[i])) * factor,
                    "share": float(variance[i] / total[i]) if total[i] > 0 else 0.0,
                    "dof": float(est.dof[i]) if name in _RANDOM else np.inf,
                }
            )
    return rows


__all__ = ["Identification", "coefficient_columns"]
