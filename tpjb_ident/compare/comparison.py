"""Prediction beside measurement, with rigid, Kirk and measured pivots: the paper's Sec. 6 on any campaign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from model.bearing import Bearing
from model.effects import Effect
from rigdata.campaign import Campaign
from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.compare.measured_pivots import counted_twice
from tpjb_ident.compare.model_side import Asked, ModelSide, model_side
from tpjb_ident.compare.predictions import PointPrediction, Progress
from tpjb_ident.errors import TpjbError
from tpjb_ident.presentation import Presented, changed

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.settings import IdentifySettings
    from tpjb_ident.pivot import PivotCurve

    #: Somebody who worked out the model's side while the campaign was identified.
    Ahead = Callable[["CompareSettings", Identification], ModelSide | None]

#: Pivot models that are compared, in the order of the tables.
VARIANTS = ("rigid", "kirk", "kirk-secant", "measured")
DEFAULT_VARIANTS = ("rigid", "kirk", "measured")


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
    """

    variants: tuple[str, ...] = DEFAULT_VARIANTS
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()
    identify: IdentifySettings | None = None
    from_measured: bool = False

    def __repr__(self) -> str:
        return changed(self)

    def asked(self) -> Asked:
        """What the model is asked for."""
        return Asked.of(self.variants, self.thermal, self.effects, self.from_measured)


@dataclass(frozen=True)
class Variant:
    """Predictions with one pivot model."""

    name: str
    points: tuple[PointPrediction, ...] = field(repr=False)
    locus: tuple[PointPrediction, ...] = field(repr=False, default=())


@dataclass(frozen=True, repr=False)
class Comparison(Presented):
    """Everything measured and predicted for one campaign.

    Attributes
    ----------
    campaign : Campaign or TableSource
        What was measured: records, or a table of coefficients.
    bearing : Bearing
    settings : CompareSettings
    identification : Identification
    curves : tuple of PivotCurve
        Empty without dry tests.
    clearance : ClearancePolygon or None
    locus : Locus or None
    variants : tuple of Variant
    remarks : tuple of str
        What the campaign lacks, and what was left out for it.
    """

    campaign: Campaign | TableSource
    bearing: Bearing = field(repr=False)
    settings: CompareSettings
    identification: Identification = field(repr=False)
    curves: tuple[PivotCurve, ...] = field(repr=False)
    clearance: ClearancePolygon | None = field(repr=False)
    locus: Locus | None = field(repr=False)
    variants: tuple[Variant, ...] = field(repr=False)
    remarks: tuple[str, ...] = ()

    def variant(self, name: str) -> Variant:
        """The predictions with one pivot model.

        Parameters
        ----------
        name : str
            Of the pivot model.
        """
        return next(v for v in self.variants if v.name == name)

    def to_dataframe(self) -> pd.DataFrame:
        """``comparison.csv``."""
        from tpjb_ident.compare.tables import comparison_frame

        return comparison_frame(self)

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
    ahead: Ahead | None = None,
) -> Comparison:
    """Identify a campaign, measure its pivots, locus and clearance, and predict the same with every pivot model.

    Parameters
    ----------
    campaign : Campaign
    bearing : Bearing
        As drawn.
    settings : CompareSettings, optional
    progress : callable, optional
        Called as progress(text, done, total).
    ahead : callable, optional
        Is told the settings and what was identified, and gives what was found meanwhile; None: nothing was.

    Raises
    ------
    ComparisonError
        No dynamic runs, or an unknown pivot model.
    rigdata.problem.RigDataError
        Records that are not what they claim to be.
    """
    from tpjb_ident.dynamic.identify import identify  # late: another process may be at work meanwhile
    from tpjb_ident.dynamic.settings import IdentifySettings

    settings = settings or CompareSettings()
    _check(campaign, settings)
    tell = progress or (lambda text, done, total: None)
    least = min(pad.assembled_clearance for pad in bearing.pads)
    chosen = settings.identify or IdentifySettings()
    chosen = replace(chosen, clearance=chosen.clearance or least)
    identification = identify(campaign, chosen, _labelled(tell, "identifying"))
    points = tuple(p.point for p in identification.points)
    tell("waiting for the model", 0, 1)
    side = ahead(settings, identification) if ahead is not None else None
    if side is None or not all(set(points) <= found.keys() for found in side.predicted.values()):
        side = model_side(campaign, bearing, settings.asked(), points, tell)
    return joined(campaign, bearing, settings, identification, side)


def joined(
    campaign: Campaign, bearing: Bearing, settings: CompareSettings, identification: Identification, side: ModelSide
) -> Comparison:
    """Set what was identified beside the model's side."""
    static, names = side.static, list(side.predicted)
    clearance, locus = static.clearance, static.locus
    remarks = [*side.remarks, *(condition.sentence() for condition in static.left_out)]
    remarks += _left_out(settings, names) + _not_run(clearance, locus)
    points = tuple(p.point for p in identification.points)
    stations = () if locus is None else tuple(p.point for p in locus.points)
    variants = tuple(
        Variant(name, tuple(found[p] for p in points), tuple(found[p] for p in stations))
        for name, found in side.predicted.items()
    )
    return Comparison(
        campaign, bearing, settings, identification, static.curves, clearance, locus, variants, tuple(remarks)
    )


def _not_run(clearance: ClearancePolygon | None, locus: Locus | None) -> list[str]:
    """What is said of runs that a campaign lacks."""
    said = ["No clearance run: positions cannot be given from the bearing centre."] if clearance is None else []
    return said + (["No locus runs: the shaft centre locus is not compared."] if locus is None else [])


def _left_out(settings: CompareSettings, names: list[str]) -> list[str]:
    """What is said of effects that measured pivots hold already."""
    twice = counted_twice(settings.effects)
    if "measured" not in names or not twice or settings.from_measured:
        return []
    return [
        f"Measured pivots are predicted without {' and '.join(twice)}: their dry tests hold that already, and it would "
        "count twice."
    ]


def _check(campaign: Campaign, settings: CompareSettings) -> None:
    unknown = [name for name in settings.variants if name not in VARIANTS]
    if unknown or not settings.variants:
        raise ComparisonError(f"pivot model {unknown[:1]} is not known; use some of {', '.join(VARIANTS)}")
    if not campaign.of_kind("dynamic"):
        raise ComparisonError(f"campaign {campaign.id} has no dynamic runs; there is nothing to compare")


def _labelled(progress: Progress, label: str) -> Progress:
    return lambda text, done, total: progress(f"{label}, {text}", done, total)
