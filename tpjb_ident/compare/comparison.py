"""Prediction beside measurement, with rigid, Kirk and measured pivots: the paper's Sec. 6 on any campaign."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from model.bearing import Bearing
from model.effects import Effect
from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.coefficient_table import TableRow, TableSource
from tpjb_ident.compare.predictions import (
    ModelSettings,
    PointPrediction,
    Progress,
    beside_measured,
    counted_twice,
    measured_laws,
    point_columns,
    predict_points,
)
from tpjb_ident.errors import TpjbError
from tpjb_ident.presentation import Presented, changed
from tpjb_ident.results.identification import Identification, coefficient_columns
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.schema import COEFFICIENT_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.static_tests import StaticTests
    from tpjb_ident.identification.settings import IdentifySettings
    from tpjb_ident.pivot import PivotCurve


#: Pivot models that are compared, in the order of the tables.
VARIANTS = ("rigid", "kirk", "kirk-secant", "measured")
_DEFAULT_VARIANTS = ("rigid", "kirk", "measured")


class ComparisonError(TpjbError):
    """The campaign does not hold what a comparison needs; says what and what to do."""


@dataclass(frozen=True)
class CompareSettings:
    """What is compared.

    Attributes
    ----------
    variants : tuple of str
        Pivot models out of `VARIANTS`.
    thermal : {"isothermal", "adiabatic", "tehd", "thd"}
    effects : tuple of Effect
        Switched on with every pivot model; with measured pivots, those that these hold already are left out.
    from_measured : bool
        The effects are sizes beside measured pivots: none of them is left out.
    identify : IdentifySettings, optional
        Default: what `identify` takes.

    Examples
    --------
    >>> ti.CompareSettings(variants=("kirk", "measured"), thermal="isothermal").thermal
    'isothermal'
    """

    variants: tuple[str, ...] = _DEFAULT_VARIANTS
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()
    identify: IdentifySettings | None = None
    from_measured: bool = False

    def __repr__(self) -> str:
        return changed(self)

    def effects_with(self, pivots: str) -> tuple[Effect, ...]:
        """Effects switched on with a pivot model.

        Parameters
        ----------
        pivots : str
            Name of the pivot model.
        """
        counts_twice = pivots == "measured" and not self.from_measured
        return beside_measured(self.effects) if counts_twice else self.effects


@dataclass(frozen=True)
class Variant:
    """Predictions with one pivot model, or another program's, under the name of its table."""

    name: str
    points: tuple[PointPrediction | TableRow, ...] = field(repr=False)
    locus: tuple[PointPrediction, ...] = field(repr=False, default=())


@dataclass(frozen=True, repr=False)
class Comparison(Presented):
    """Everything measured and predicted for one campaign.

    Attributes
    ----------
    campaign : Campaign or TableSource
        What was measured: records, or a table of coefficients.
    bearing : Bearing or None
        None where tables of other programs alone stand beside a table.
    settings : CompareSettings
    identification : Identification
    curves : tuple of PivotCurve
        Empty without dry tests.
    clearance : ClearancePolygon or None
    locus : Locus or None
    variants : tuple of Variant
    remarks : tuple of str
        What the campaign lacks, and what was left out for it.

    Examples
    --------
    >>> comparison = ti.compare_campaign(demo, rocker, ti.CompareSettings(variants=("kirk",), thermal="isothermal"))
    >>> comparison.to_dataframe()[["kyy_N_per_m", "kyy_N_per_m_predicted"]].shape
    (7, 2)
    """

    campaign: Campaign | TableSource
    bearing: Bearing | None
    settings: CompareSettings
    identification: Identification
    curves: tuple[PivotCurve, ...]
    clearance: ClearancePolygon | None
    locus: Locus | None
    variants: tuple[Variant, ...]
    remarks: tuple[str, ...] = ()

    @property
    def has_records(self) -> bool:
        """Whether the measured side was identified from records."""
        return not isinstance(self.campaign, TableSource)

    def variant(self, name: str) -> Variant:
        """The predictions with one pivot model.

        Parameters
        ----------
        name : str
            Of the pivot model.
        """
        return next(v for v in self.variants if v.name == name)

    @functools.cached_property
    def table(self) -> pd.DataFrame:
        """``comparison.csv``."""
        import pandas as pd

        rows = []
        for variant in self.variants:
            pairs = zip(self.identification.points, variant.points, strict=True)
            rows += [_row(variant, measured, predicted) for measured, predicted in pairs]
        return pd.DataFrame(rows)

    def to_dataframe(self) -> pd.DataFrame:
        """``comparison.csv``."""
        return self.table

    def summary(self) -> str:
        """What to conclude, and what it rests on."""
        from tpjb_ident.compare.summary import summary_sentences

        return "\n".join(summary_sentences(self))

    def plot(self, **options: Any) -> Any:
        """Draw kxx over load, measured and predicted; see `tpjb_ident.report.plots.coefficient`.

        Parameters
        ----------
        **options
            ``name``, ``over``, ``title``.
        """
        from tpjb_ident.report import plots

        return plots.coefficient(self, **{"name": "kxx", **options})

    def __str__(self) -> str:
        names = ", ".join(v.name for v in self.variants)
        return f"Comparison of {self.campaign.id}: {len(self.identification.points)} points with {names} pivots"


def compare_campaign(
    campaign: Campaign,
    bearing: Bearing,
    settings: CompareSettings | None = None,
    progress: Progress | None = None,
    model: Callable[[], ModelSide | None] | None = None,
) -> Comparison:
    """Identify a campaign, measure its pivots, locus and clearance, and predict the same with every pivot model.

    Parameters
    ----------
    campaign : Campaign
    bearing : Bearing, as drawn
    settings : CompareSettings, optional
    progress : callable, optional
        Called as progress(text, done, total).
    model : callable, optional
        Gives what `model_side` found for the campaign's points while it was identified here; None: nothing was.

    Raises
    ------
    ComparisonError
        No dynamic runs, or an unknown pivot model.
    rigdata.problem.RigDataError
        Records that are not what they claim to be.

    Examples
    --------
    >>> comparison = ti.compare_campaign(demo, rocker, ti.CompareSettings(variants=("rigid",), thermal="isothermal"))
    >>> len(comparison.identification.points), [variant.name for variant in comparison.variants]
    (7, ['rigid'])
    """
    from tpjb_ident.identification.identify import identify
    from tpjb_ident.identification.settings import IdentifySettings

    settings = settings or CompareSettings()
    _check(campaign, settings)
    report = progress or (lambda text, done, total: None)
    least = min(pad.assembled_clearance for pad in bearing.pads)
    chosen = settings.identify or IdentifySettings()
    chosen = replace(chosen, clearance=chosen.clearance or least)
    identification = identify(campaign, chosen, _labelled(report, "identifying"))
    points = tuple(p.point for p in identification.points)
    report("waiting for the model", 0, 1)
    side = None if model is None else model()
    if side is None or not all(set(points) <= predicted.keys() for predicted in side.predicted.values()):
        side = model_side(campaign, bearing, settings, points, report)
    return _joined(campaign, bearing, settings, identification, side)


@dataclass(frozen=True)
class ModelSide:
    """Static tests, and predictions with every pivot model: what of a comparison needs no identification."""

    static: StaticTests
    remarks: tuple[str, ...]
    predicted: dict[str, dict[OperatingPoint, PointPrediction]]


def model_side(
    campaign: Campaign,
    bearing: Bearing,
    settings: CompareSettings,
    points: tuple[OperatingPoint, ...] | None = None,
    progress: Progress | None = None,
) -> ModelSide:
    """Measure the static tests and predict points (default: all that the manifest names) and locus."""
    from tpjb_ident.compare.static_tests import measure_static

    report = progress or (lambda text, done, total: None)
    points = tuple(sorted({run.point for run in campaign.of_kind("dynamic")})) if points is None else points
    report("fitting pivot curves, clearance and locus", 0, 1)
    static = measure_static(campaign, bearing, "measured" in settings.variants)
    names, remarks = possible_variants(settings.variants, static.curves, bearing)
    stations = () if static.locus is None else tuple(p.point for p in static.locus.points)
    wanted = tuple(dict.fromkeys(points + stations))
    predicted = {}
    for name in names:
        pivots = measured_laws(static.curves, len(bearing.pads), campaign.id) if name == "measured" else name
        model = ModelSettings(pivots, settings.thermal, settings.effects_with(name))
        predictions = predict_points(bearing, wanted, model, _labelled(report, f"predicting with {name} pivots"))
        predicted[name] = {p.point: p for p in predictions}
    return ModelSide(static, tuple(remarks), predicted)


def possible_variants(
    variants: tuple[str, ...], curves: tuple[PivotCurve, ...], bearing: Bearing
) -> tuple[list[str], list[str]]:
    """Pivot models that a campaign and a bearing allow, and remarks about the others."""
    names, remarks = list(variants), []
    missing = sorted(set(range(1, len(bearing.pads) + 1)) - {c.pad for c in curves})
    if "measured" in names and missing:
        names.remove("measured")
        pads = ", ".join(f"#{n}" for n in missing)
        remarks.append(f"Measured pivots are left out: no dry test of pad {pads}.")
    if bearing.pivot.kind == "rigid":
        printed = [name for name in names if name.startswith("kirk")]
        names = [name for name in names if name not in printed]
        if printed:
            remarks.append("The bearing file says rigid pivots: there is no printed formula to compare.")
    return names or ["rigid"], remarks


def _joined(
    campaign: Campaign, bearing: Bearing, settings: CompareSettings, identification: Identification, side: ModelSide
) -> Comparison:
    """Set what was identified beside the model's side."""
    static = side.static
    points = tuple(p.point for p in identification.points)
    stations = () if static.locus is None else tuple(p.point for p in static.locus.points)
    variants = tuple(
        Variant(name, tuple(predicted[p] for p in points), tuple(predicted[p] for p in stations))
        for name, predicted in side.predicted.items()
    )
    remarks = [*side.remarks, *(condition.sentence() for condition in static.left_out)]
    twice = counted_twice(settings.effects)
    if "measured" in side.predicted and twice and not settings.from_measured:
        remarks.append(
            f"Measured pivots are predicted without {' and '.join(twice)}: their dry tests hold that already, and it "
            "would count twice."
        )
    if static.clearance is None:
        remarks.append("No clearance run: positions cannot be given from the bearing centre.")
    if static.locus is None:
        remarks.append("No locus runs: the shaft centre locus is not compared.")
    return Comparison(
        campaign, bearing, settings, identification, static.curves, static.clearance, static.locus, variants,
        tuple(remarks),
    )  # fmt: skip


def _check(campaign: Campaign, settings: CompareSettings) -> None:
    unknown = [name for name in settings.variants if name not in VARIANTS]
    if unknown or not settings.variants:
        raise ComparisonError(f"pivot model {unknown[:1]} is not known; use some of {', '.join(VARIANTS)}")
    if not campaign.of_kind("dynamic"):
        raise ComparisonError(f"campaign {campaign.id} has no dynamic runs; there is nothing to compare")


def _labelled(progress: Progress, label: str) -> Progress:
    return lambda text, done, total: progress(f"{label}, {text}", done, total)


def measured_locus(comparison: Comparison) -> FloatArray:
    """Measured positions (n, 2) [m], from the bearing centre if the campaign has a clearance run."""
    if comparison.locus is None:
        return np.zeros((0, 2))
    return np.array([p.position for p in comparison.locus.points]).reshape(-1, 2)


def predicted_locus(comparison: Comparison, variant: Variant) -> FloatArray:
    """Predicted positions (n, 2) [m] in the order and about the origin of the measured ones.

    Without a clearance run the probes' zero stands anywhere: then the prediction is shifted by the mean difference,
    and only the shape of the two can be compared. NaN for a table of another program: it has no locus.
    """
    if not variant.locus:
        return np.full_like(measured_locus(comparison), np.nan)
    places = np.array([p.prediction.position for p in variant.locus]).reshape(-1, 2)
    if comparison.clearance is None and len(places):
        places = places + np.nanmean(measured_locus(comparison) - places, axis=0)
    return places


def locus_distance(comparison: Comparison, variant: Variant) -> float:
    """Root mean square distance between the two loci [m]; NaN without locus runs."""
    off = predicted_locus(comparison, variant) - measured_locus(comparison)
    distance = np.hypot(off[:, 0], off[:, 1])
    distance = distance[np.isfinite(distance)]
    return float(np.sqrt(np.mean(distance**2))) if len(distance) else math.nan


def locus_frame(comparison: Comparison) -> pd.DataFrame:
    """Build locus_comparison.csv: measured and predicted position per load direction and pivot model."""
    import pandas as pd

    if comparison.locus is None:
        return pd.DataFrame(columns=["pivots", "static_load_direction_deg", "x_m", "y_m"])
    frames = []
    for variant in comparison.variants:
        if not variant.locus:
            continue
        frame = comparison.locus.to_frame()
        places = predicted_locus(comparison, variant)
        frame.insert(0, "pivots", variant.name)
        frame["x_m_predicted"], frame["y_m_predicted"] = places[:, 0], places[:, 1]
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


DIRECT = tuple(name for name in COEFFICIENT_COLUMNS if name[1:3] in ("xx", "yy"))


def _row(variant: Variant, measured: PointResult, predicted: PointPrediction | TableRow) -> dict[str, Any]:
    row: dict[str, Any] = {"pivots": variant.name, **point_columns(measured.point)}
    row["static_load_measured_N"] = measured.static_load_measured
    values = coefficient_columns(measured.stiffness)
    for name, model in zip(COEFFICIENT_COLUMNS, predicted.values, strict=True):
        low, high = values[f"{name}_lo"], values[f"{name}_hi"]
        row[name], row[f"{name}_lo"], row[f"{name}_hi"] = values[name], low, high
        row[f"{name}_predicted"] = model
        row[f"{name}_difference"] = model - values[name]
        row[f"{name}_ratio"] = model / values[name] if low * high > 0 else np.nan
    row.update(
        x_m_predicted=predicted.position[0],
        y_m_predicted=predicted.position[1],
        converged=predicted.converged,
        pivot_extrapolated=predicted.extrapolated,
        quality="; ".join(str(c) for c in measured.quality) or "ok",
        status="; ".join(predicted.status),
    )
    return row
