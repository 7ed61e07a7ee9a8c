"""Everything that was identified from a campaign, points and bands, and how it becomes tables."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.columns import amount, place_of
from tpjb_ident.conditions import Conditions, sentences
from tpjb_ident.estimators.estimate import REJECTED_WEIGHT
from tpjb_ident.estimators.stiffness import ENTRIES, DynamicStiffness
from tpjb_ident.presentation import Presented
from tpjb_ident.results.frequency_model import MODEL_COLUMNS, FrequencyModel, StaticFits, fits_over_frequency
from tpjb_ident.results.point_result import PointResult, quality_cell
from tpjb_ident.rounding import counted
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_KEY, STATIC_KEY, with_endings

if TYPE_CHECKING:
    import pandas as pd


_WINDOW_COLUMNS = ("run", "time_s", "excitation_direction_deg", "weight", "reason", *POINT_KEY)
#: Of a coefficient in ``coefficients.csv``.
_ENDINGS = ("", "_lo", "_hi", "_se", "_se_systematic", "_random95", "_systematic95")
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
    calibration_changes: FloatArray
    conditions: Conditions = ()
    bands: tuple[BandResult, ...] = ()
    calibration_names: tuple[str, ...] = ()
    cell_stiffness: tuple[float, float] | None = None

    @property
    def systematic(self) -> FloatArray:
        """Systematic covariance over all P points, (8 P, 8 P) [N^2/m^2]; made when asked for: it grows with P^2."""
        joint = self.calibration_changes.T @ self.calibration_changes / len(self.calibration_changes)
        for p, point in enumerate(self.points):
            # what no point shares stands with its own alone
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
        return self._table(lambda point: [point.stiffness])

    def estimators_frame(self) -> pd.DataFrame:
        """The same table for every method: ``estimators.csv``."""
        return self._table(lambda point: point.by_method.values())

    def _table(self, estimates: Callable[[PointResult], Iterable[DynamicStiffness]]) -> pd.DataFrame:
        import pandas as pd

        models = {}
        for group in self.frequency_fits():
            models.update(dict.fromkeys(group.places, group.supported))
        rows = []
        for place, point in enumerate(self.points):
            model = {"frequency_model": models.get(place, "single line")}
            rows += [_estimate_row(point, estimate, model) for estimate in estimates(point)]
        return pd.DataFrame(rows)

    def windows_frame(self) -> pd.DataFrame:
        """Rejected windows with run, time and reason: ``windows.csv``."""
        import pandas as pd

        rows = []
        for p in self.points:
            key = p.point.key
            rows += [[w.run, w.time, np.degrees(w.direction), w.weight, w.reason, *key] for w in p.rejected]
        return pd.DataFrame(rows, columns=list(_WINDOW_COLUMNS))

    def budget_frame(self) -> pd.DataFrame:
        """What every source adds to every coefficient's uncertainty: ``budget.csv``."""
        import pandas as pd

        rows = []
        for point in self.points:
            rows += _budget_rows(point)
        return pd.DataFrame(rows, columns=[*POINT_KEY, *_BUDGET_COLUMNS])

    def frequency_fits(self) -> list[StaticFits]:
        """K-C and K-C-M over the excitation frequencies, for every load that was run at several."""
        return fits_over_frequency(self.points, self.calibration_changes)

    def frequency_frame(self) -> pd.DataFrame:
        """One row per load and model: ``frequency_fits.csv``."""
        import pandas as pd

        rows = []
        for group in self.frequency_fits():
            common = {**dict(zip(STATIC_KEY, group.points[0].point.static_key)), "supported": group.supported}
            rows += [common | fit.columns() for fit in group.fits.values()]
        return pd.DataFrame(rows, columns=[*STATIC_KEY, "model", "supported", *MODEL_COLUMNS])

    def remarks(self) -> tuple[str, ...]:
        """What somebody should read beside the numbers: each condition once, with the places where it was found."""
        remarks = [condition.sentence() for condition in self.conditions]
        places = defaultdict(list)
        flagged = [(place_of(p.point.static_load, p.point.excitation_hz), p.quality) for p in self.points]
        for band in self.bands:
            flagged += [] if band.points else [(f"{amount(band.point.static_load, 'load')}, {band.kind}", band.quality)]
        for place, quality in flagged:
            for condition in quality:
                places[str(condition)].append(f"{place}: {condition.detail or 'found'}")
        for name, listed in places.items():
            addition = f" (and at {counted(len(listed) - 1, 'more point')})" if listed[1:] else ""
            remarks.append(f"{name} at {listed[0]}{addition}")
        return tuple(remarks)


def point_columns(p: PointResult) -> dict[str, object]:
    """Key of a point."""
    return dict(zip(POINT_KEY, p.point.key))


def _estimate_row(p: PointResult, est: DynamicStiffness, model: dict[str, str]) -> dict[str, Any]:
    """One method's answer at one point, with everything needed to believe it or not."""
    weights = est.weights.min(axis=1)
    rejected = int((weights < REJECTED_WEIGHT).sum())
    conditions = p.quality if est is p.stiffness else est.status
    return {
        **point_columns(p),
        "static_load_measured_N": p.static_load_measured,
        **coefficient_columns(est),
        "method": est.method,
        "n_records": p.n_records,
        "n_windows": p.n_windows,
        "condition_number": est.condition,
        "outlier_fraction": rejected / max(len(weights), 1),
        "quality": quality_cell(conditions),
        "quality_detail": "; ".join(sentences(conditions)),
        "n_windows_rejected": rejected,
        "coherence": p.coherence,
        "amplitude_m": p.amplitude,
        "amplitude_over_clearance": p.amplitude / p.clearance if p.clearance else np.nan,
        "amplitude_slope": p.linearity.stiffening,
        "amplitude_slope_se": p.linearity.standard_error,
        "chi_square": est.chi_square,
        "attenuation": float(est.attenuation[0]),
        "inertia_corrected": p.inertia_corrected,
        "baseline_subtracted": "baseline" in p.budget,
        **model,
        **dict(zip(("x_m", "y_m", "x_m_se", "y_m_se"), (*p.position, *p.position_se))),
        **{f"temperature_{pad}_K": value for pad, value in p.temperatures.items()},
    }


def coefficient_columns(est: DynamicStiffness) -> dict[str, float]:
    """K and C with their intervals under the names of ``coefficients.csv``."""
    numbers = est.figures() * np.repeat([1.0, 1 / est.omega], 4)[:, None]
    return dict(zip(with_endings(*_ENDINGS), numbers.ravel().tolist()))


def _budget_rows(p: PointResult) -> list[list[Any]]:
    """Rows of ``budget.csv`` of one point.

    The intervals are its sum: the random sources together with Student's t of their degrees of freedom, the systematic
    ones normal, the two added as root sum of squares.
    """
    est, parts = p.stiffness, p.budget
    factor = np.repeat([1.0, 1 / est.omega], 4)
    variances = np.array([np.maximum(np.diag(part), 0.0) for part in parts.values()]).reshape(-1, 8)
    shares = np.nan_to_num(variances / np.maximum(variances.sum(axis=0), np.finfo(float).tiny))
    errors = np.sqrt(variances) * factor
    rows = []
    for i, column in enumerate(COEFFICIENT_COLUMNS):
        for j, source in enumerate(parts):
            kind, dof = ("random", est.dof[i]) if source in p.scattering else ("systematic", np.inf)
            unit = "N/m" if i < 4 else "Ns/m"
            rows.append([*p.point.key, column[:3], unit, source, kind, errors[j, i], shares[j, i], dof])
    return rows


_KEY_COLUMNS = (*STATIC_KEY, "excitation")
_FIGURES = (
    "coherence_x",
    "coherence_y",
    "method",
    "dof",
    "n_records",
    "n_averages",
    "resolution_Hz",
    "condition_number",
    "quality",
)
_LINE_COLUMNS = [*_KEY_COLUMNS, "excitation_Hz"]
for _part in ("real", "imag"):
    for _entry in ENTRIES:
        _LINE_COLUMNS += [f"h{_entry}_{_part}_N_per_m{_end}" for _end in ("", "_lo", "_hi", "_se", "_se_systematic")]
_LINE_COLUMNS += _FIGURES
_MODEL_COLUMNS = (*_KEY_COLUMNS, "model", "supported", "method", *MODEL_COLUMNS, "quality")


@dataclass(frozen=True)
class BandLine:
    """One line of the band."""

    frequency: float
    by_method: dict[str, DynamicStiffness] = field(repr=False)
    method: str
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int

    @property
    def stiffness(self) -> DynamicStiffness:
        """By the method that counts."""
        return self.by_method[self.method]


@dataclass(frozen=True)
class BandResult:
    """Dynamic stiffness over a band at one operating point."""

    point: OperatingPoint
    kind: str
    lines: tuple[BandLine, ...] = field(repr=False)
    models: dict[str, FrequencyModel] = field(repr=False)
    supported: str
    quality: Conditions
    runs: tuple[str, ...]
    period: float | None
    resolution: float
    points: tuple[PointResult, ...] = field(default=(), repr=False)

    @property
    def frequencies(self) -> FloatArray:
        """Of the lines, (n,) [Hz]."""
        return np.array([line.frequency for line in self.lines])

    @property
    def h(self) -> ComplexArray:
        """Dynamic stiffness over the lines, (n, 2, 2) [N/m]."""
        return np.array([line.stiffness.h for line in self.lines]).reshape(-1, 2, 2)

    @property
    def method(self) -> str:
        """The method that counts."""
        return self.lines[0].method if self.lines else "none"

    def half_width(self, level: float = 0.95) -> FloatArray:
        """Half the interval of Re and Im of the four entries, (n, 8) [N/m]."""
        return np.array([line.stiffness.half_width(level) for line in self.lines]).reshape(-1, 8)

    def key(self) -> dict[str, Any]:
        """Columns that name the result."""
        return dict(zip(_KEY_COLUMNS, (*self.point.static_key, self.kind)))


def frf_frame(results: Sequence[BandResult], every_method: bool = False) -> pd.DataFrame:
    """One row per line, by the method that counts (``frf.csv``) or by every method (``frf_estimators.csv``)."""
    import pandas as pd

    rows = []
    for result in results:
        for line in result.lines:
            chosen = line.by_method if every_method else {line.method: line.stiffness}
            for name, est in chosen.items():
                figures = [*line.coherence, name, float(np.min(est.dof)), len(result.runs), line.n_rows]
                figures += [result.resolution, est.condition, quality_cell(result.quality)]
                rows.append([*result.key().values(), line.frequency, *est.figures()[:, :5].ravel(), *figures])
    return pd.DataFrame(rows, columns=_LINE_COLUMNS)


def models_frame(results: Sequence[BandResult]) -> pd.DataFrame:
    """One row per operating point and model: ``frf_models.csv``."""
    import pandas as pd

    rows = []
    for result in results:
        common = {**result.key(), "supported": result.supported, "method": result.method}
        common["quality"] = quality_cell(result.quality)
        rows += [common | model.columns() for model in result.models.values()]
    return pd.DataFrame(rows, columns=_MODEL_COLUMNS)
