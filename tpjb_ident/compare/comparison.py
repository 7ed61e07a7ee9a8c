"""Prediction beside measurement, with rigid, Kirk and measured pivots: the paper's Sec. 6 on any campaign."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from model.bearing import Bearing
from model.effects import Effect
from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from tpjb_ident.clearance.locus import Locus
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.compare.predictions import ModelSettings, Progress, counted_twice, measured_laws, predict_points
from tpjb_ident.compare.static_tests import StaticTests, measure_static
from tpjb_ident.errors import TpjbError
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.presentation import Presented, changed
from tpjb_ident.results.identification import Identification
from tpjb_ident.rounding import counted
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_KEY

#: Rows of `predict_points` of every pivot model; operating points are their index.
Predictions = dict[str, pd.DataFrame]
#: Pivot models that are compared, in the order of the tables.
VARIANTS = ("rigid", "kirk", "kirk-secant", "measured")


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

    variants: tuple[str, ...] = ("rigid", "kirk", "measured")
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()
    identify: IdentifySettings | None = None
    from_measured: bool = False

    def __repr__(self) -> str:
        return changed(self)

    def effects_with(self, pivots: str) -> tuple[Effect, ...]:
        """Effects switched on with the pivot model of a name."""
        twice = counted_twice(self.effects) if pivots == "measured" and not self.from_measured else ()
        return tuple(effect for effect in self.effects if effect.name not in twice)


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
    predictions : mapping of str to DataFrame
        By pivot model or other program: a row as in ``prediction.csv`` for every measured point.
    loci : DataFrame or None
        ``locus_comparison.csv``: shaft centres, measured and predicted with every pivot model.
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
    predictions: Mapping[str, pd.DataFrame]
    loci: pd.DataFrame | None
    remarks: tuple[str, ...] = ()

    @property
    def has_records(self) -> bool:
        """Whether the measured side was identified from records."""
        return not isinstance(self.campaign, TableSource)

    @functools.cached_property
    def table(self) -> pd.DataFrame:
        """``comparison.csv``."""
        return joined(self.identification.to_frame(), self.predictions)

    def to_dataframe(self) -> pd.DataFrame:
        """``comparison.csv``."""
        return self.table

    @property
    def doubt(self) -> str:
        """Why a point is not to be trusted, on either side; "" where all are."""
        if self.has_records and self.identification.doubt:
            return self.identification.doubt
        failed = (~self.table["converged"]).sum()
        return f"the model did not converge at {counted(failed, 'predicted point')}." if failed else ""

    def plot(self, **options: Any) -> Any:
        """Draw kxx over load, measured and predicted; `tpjb_ident.report.plots.coefficient` takes the same options."""
        from tpjb_ident.report import plots

        return plots.coefficient(self, **{"name": "kxx", **options})

    def summary(self) -> str:
        """What to conclude, and what it rests on."""
        from tpjb_ident.compare.summary import summary_sentences

        return "\n".join(summary_sentences(self))


def joined(measured: pd.DataFrame, predictions: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Rows of ``comparison.csv``: every prediction beside what was measured, both with a row for every point."""
    sizes = [len(frame) for frame in predictions.values()]
    predicted = pd.concat(list(predictions.values()), ignore_index=True)
    measured = pd.concat([measured] * len(sizes), ignore_index=True)
    columns: dict[str, Any] = {"pivots": np.repeat(list(predictions), sizes)}
    columns |= {name: measured[name] for name in (*POINT_KEY, "static_load_measured_N")}
    for name in COEFFICIENT_COLUMNS:
        value, low, high = measured[name], measured[f"{name}_lo"], measured[f"{name}_hi"]
        columns |= {name: value, f"{name}_lo": low, f"{name}_hi": high, f"{name}_predicted": predicted[name]}
        columns[f"{name}_difference"] = predicted[name] - value
        columns[f"{name}_ratio"] = (predicted[name] / value).where(low * high > 0)
    columns |= {f"{name}_predicted": predicted[name] for name in ("x_m", "y_m")}
    columns |= {name: predicted[name] for name in ("converged", "pivot_extrapolated")}
    return pd.DataFrame({**columns, "quality": measured["quality"], "status": predicted["status"]})


def compare_campaign(
    campaign: Campaign,
    bearing: Bearing,
    settings: CompareSettings | None = None,
    progress: Progress | None = None,
    model: Callable[[], tuple[StaticTests, Predictions] | None] | None = None,
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
        An unknown pivot model.
    BadInputError
        No dynamic runs.
    rigdata.problem.RigDataError
        Records that are not what they claim to be.

    Examples
    --------
    >>> comparison = ti.compare_campaign(demo, rocker, ti.CompareSettings(variants=("rigid",), thermal="isothermal"))
    >>> len(comparison.identification.points), list(comparison.predictions)
    (7, ['rigid'])
    """
    from tpjb_ident.identification.identify import identify

    settings = settings or CompareSettings()
    unknown = [name for name in settings.variants if name not in VARIANTS]
    if unknown or not settings.variants:
        raise ComparisonError(f"pivot model {unknown[:1]} is not known; use some of {', '.join(VARIANTS)}")
    report = progress or (lambda text, done, total: None)
    chosen = settings.identify or IdentifySettings()
    if chosen.clearance is None:
        chosen = replace(chosen, clearance=min(bearing.clearances))
    identification = identify(campaign, chosen, _labelled(report, "identifying"))
    points = [p.point for p in identification.points]
    report("waiting for the model", 0, 1)
    ahead = None if model is None else model()
    if ahead is None or not all(set(points) <= set(rows.index) for rows in ahead[1].values()):
        ahead = model_side(campaign, bearing, settings, points, report)
    static, predictions = ahead
    frames = {name: rows.loc[points].reset_index(drop=True) for name, rows in predictions.items()}
    left_out = [c.sentence() for c in identification.conditions if c in ("runs-left-out", "point-lost")]
    return Comparison(
        campaign, bearing, settings, identification, static.curves, static.clearance, static.locus, frames,
        _loci(static, predictions), (*left_out, *_remarks(settings, static, bearing)),
    )  # fmt: skip


def model_side(
    campaign: Campaign,
    bearing: Bearing,
    settings: CompareSettings,
    points: Sequence[OperatingPoint] | None = None,
    progress: Progress | None = None,
) -> tuple[StaticTests, Predictions]:
    """What of a comparison needs no identification: static tests, and predictions of points and of their locus.

    Points are by default all that the manifest names.
    """
    report = progress or (lambda text, done, total: None)
    points = sorted({run.point for run in campaign.of_kind("dynamic")}) if points is None else points
    report("fitting pivot curves, clearance and locus", 0, 1)
    static = measure_static(campaign, bearing, "measured" in settings.variants)
    names, _ = possible_variants(settings.variants, static.curves, bearing)
    targets = list(dict.fromkeys([*points, *_stations(static)]))
    predictions = {}
    for name in names:
        pivots = measured_laws(static.curves, len(bearing.pads), campaign.id) if name == "measured" else name
        model = ModelSettings(pivots, settings.thermal, settings.effects_with(name))
        rows = predict_points(bearing, targets, model, _labelled(report, f"predicting with {name} pivots"))
        predictions[name] = pd.DataFrame(rows, index=pd.Index(targets, tupleize_cols=False))
    return static, predictions


def _stations(static: StaticTests) -> list[OperatingPoint]:
    return [] if static.locus is None else [p.point for p in static.locus.points]


def possible_variants(
    variants: tuple[str, ...], curves: tuple[PivotCurve, ...], bearing: Bearing
) -> tuple[list[str], list[str]]:
    """Pivot models that a campaign and a bearing allow, and remarks about the others."""
    refused = {}
    missing = sorted(set(range(1, len(bearing.pads) + 1)) - {c.pad for c in curves})
    if missing:
        pads = ", ".join(f"#{n}" for n in missing)
        refused["measured"] = f"Measured pivots are left out: no dry test of pad {pads}."
    if bearing.pivot.kind == "rigid":
        formula = "The bearing file says rigid pivots: there is no printed formula to compare."
        refused |= {"kirk": formula, "kirk-secant": formula}
    names, remarks = [], []
    for name in variants:
        if name in refused:
            remarks.append(refused[name])
        else:
            names.append(name)
    return names or ["rigid"], list(dict.fromkeys(remarks))


def _remarks(settings: CompareSettings, static: StaticTests, bearing: Bearing) -> tuple[str, ...]:
    """What the campaign lacks, and what was left out for it."""
    names, remarks = possible_variants(settings.variants, static.curves, bearing)
    remarks += [condition.sentence() for condition in static.left_out]
    twice = counted_twice(settings.effects)
    if "measured" in names and twice and not settings.from_measured:
        remarks.append(
            f"Measured pivots are predicted without {' and '.join(twice)}: their dry tests hold that already, and it "
            "would count twice."
        )
    if static.clearance is None:
        remarks.append("No clearance run: positions cannot be given from the bearing centre.")
    if static.locus is None:
        remarks.append("No locus runs: the shaft centre locus is not compared.")
    return tuple(remarks)


def _labelled(progress: Progress, label: str) -> Progress:
    return lambda text, done, total: progress(f"{label}, {text}", done, total)


def _loci(static: StaticTests, predictions: Predictions) -> pd.DataFrame | None:
    """Measured and predicted position per load direction and pivot model; None without locus runs.

    Without a clearance run the probes' zero stands anywhere: then the prediction is shifted by the mean difference,
    and only the shape of the two can be compared.
    """
    if static.locus is None:
        return None
    frames = []
    measured = static.locus.to_frame()
    for rows in predictions.values():
        places = rows.loc[_stations(static)][["x_m", "y_m"]].to_numpy(float)
        if static.clearance is None:
            places = places + (measured[["x_m", "y_m"]] - places).mean().to_numpy()
        frames.append(measured.assign(x_m_predicted=places[:, 0], y_m_predicted=places[:, 1]))
    table = pd.concat(frames, ignore_index=True)
    table.insert(0, "pivots", np.repeat(list(predictions), len(measured)))
    return table
