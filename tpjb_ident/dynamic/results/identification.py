"""Everything that was identified from a campaign, and how it becomes tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.results.frequency_fit import LoadFits, fits_per_load
from tpjb_ident.dynamic.results.identification_tables import (
    BUDGET_COLUMNS,
    FIT_COLUMNS,
    POINT_COLUMNS,
    WINDOW_COLUMNS,
    budget_rows,
    coefficient_columns,
    estimate_row,
    fit_row,
    point_columns,
)
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.presentation import Presented, shown_by

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.broadband.band_result import BandResult


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
        What n draws of the calibration do to the entries of all P points, in their order [N/m].
    conditions : tuple of Condition
        About the campaign as a whole.
    bands : tuple of BandResult
        Of runs that were excited over a band.
    """

    campaign: str
    method: str
    points: tuple[PointResult, ...]
    calibration_changes: FloatArray = field(repr=False)
    conditions: tuple[Condition, ...] = ()
    bands: tuple[BandResult, ...] = ()

    @property
    def systematic(self) -> FloatArray:
        """Calibration covariance over all P points, (8 P, 8 P) [N^2/m^2]; made when asked for: it grows with P^2."""
        return np.asarray(self.calibration_changes.T @ self.calibration_changes / len(self.calibration_changes))

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
        return shown_by("report.plots", "direct_coefficients")({self.campaign: self}, **options)

    def to_frame(self) -> pd.DataFrame:
        """One row per operating point, by the default method: ``coefficients.csv``."""
        import pandas as pd

        groups = self._groups()
        return pd.DataFrame([estimate_row(p, p.stiffness, groups.get(i)) for i, p in enumerate(self.points)])

    def estimators_frame(self) -> pd.DataFrame:
        """The same table for every method: ``estimators.csv``."""
        import pandas as pd

        groups = self._groups()
        return pd.DataFrame(
            [estimate_row(p, est, groups.get(i)) for i, p in enumerate(self.points) for est in p.by_method.values()]
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
        return pd.DataFrame(rows, columns=list(WINDOW_COLUMNS))

    def budget_frame(self) -> pd.DataFrame:
        """What every source adds to every coefficient's uncertainty: ``budget.csv``."""
        import pandas as pd

        rows = [row for p in self.points for row in budget_rows(point_columns(p), p.stiffness, p.budget)]
        return pd.DataFrame(rows, columns=[*POINT_COLUMNS, *BUDGET_COLUMNS])

    def frequency_fits(self) -> list[LoadFits]:
        """K-C and K-C-M over the excitation frequencies, for every load that was run at several."""
        return fits_per_load(self.points)

    def frequency_frame(self) -> pd.DataFrame:
        """One row per load and model: ``frequency_fits.csv``."""
        import pandas as pd

        rows = [fit_row(group, fit) for group in self.frequency_fits() for fit in group.fits.values()]
        return pd.DataFrame(rows, columns=list(FIT_COLUMNS))

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
        for name, found in places.items():
            others = len(found) - 1
            more = f" (and at {others} more point{'s' if others > 1 else ''})" if others else ""
            remarks.append(f"{name} at {found[0]}{more}")
        return tuple(remarks)

    def _groups(self) -> dict[int, LoadFits]:
        """Models over frequency by the index of the points that they belong to."""
        index = {id(p): i for i, p in enumerate(self.points)}
        return {index[id(p)]: group for group in self.frequency_fits() for p in group.points}


__all__ = ["Identification", "coefficient_columns"]
