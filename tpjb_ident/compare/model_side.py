"""What a comparison asks of the static tests and of the model.

Nothing of it depends on what is identified, but for the operating points, which the manifest names: another process may
work it out meanwhile (`tpjb_ident.report.comparison_beside`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.measured_pivots import beside_measured, measured_laws
from tpjb_ident.compare.predictions import ModelSettings, PointPrediction, Progress, predict_points

if TYPE_CHECKING:
    from model.bearing import Bearing
    from model.effects import Effect
    from tpjb_ident.compare.static_tests import StaticTests
    from tpjb_ident.pivot import PivotCurve


@dataclass(frozen=True)
class Asked:
    """Pivot models, each with the effects that are switched on with it, and the heat model."""

    effects: dict[str, tuple[Effect, ...]]
    thermal: str

    @classmethod
    def of(cls, variants: tuple[str, ...], thermal: str, effects: tuple[Effect, ...], from_measured: bool) -> Asked:
        """With measured pivots, effects that these hold already are left out, unless they are sizes beside them."""
        held = effects if from_measured else beside_measured(effects)
        return cls({name: held if name == "measured" else effects for name in variants}, thermal)


@dataclass(frozen=True)
class ModelSide:
    """Static tests, and predictions with every pivot model."""

    static: StaticTests
    remarks: tuple[str, ...]
    predicted: dict[str, dict[OperatingPoint, PointPrediction]]


def model_side(
    campaign: Campaign,
    bearing: Bearing,
    asked: Asked,
    points: tuple[OperatingPoint, ...],
    progress: Progress | None = None,
) -> ModelSide:
    """Measure the static tests and predict points and locus with every pivot model."""
    from tpjb_ident.compare.static_tests import measure_static  # late: a process that asks another one needs none of it

    tell = progress or (lambda text, done, total: None)
    tell("fitting pivot curves, clearance and locus", 0, 1)
    static = measure_static(campaign, bearing, "measured" in asked.effects)
    names, remarks = possible_variants(tuple(asked.effects), static.curves, bearing)
    stations = () if static.locus is None else tuple(p.point for p in static.locus.points)
    wanted = tuple(dict.fromkeys(points + stations))
    predicted = {}
    for name in names:
        pivots = measured_laws(static.curves, len(bearing.pads), campaign.id) if name == "measured" else name
        model = ModelSettings(pivots, asked.thermal, asked.effects[name])

        def show(text: str, done: int, total: int, name: str = name) -> None:
            tell(f"predicting with {name} pivots, {text}", done, total)

        predicted[name] = {p.point: p for p in predict_points(bearing, wanted, model, show)}
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
