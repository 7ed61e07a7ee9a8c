"""What a campaign holds of pivot curves, clearance polygon and locus, with its bearing at hand.

Single bad records are left out and named; clearance sweeps are held against the drawing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from model.bearing import Bearing
from rigdata.campaign import Campaign
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.clearance.locus import Locus, measure_locus
from tpjb_ident.clearance.measure import ClearancePolygon, coldest_first, measure_run
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.pivot.refusals import usable_runs
from tpjb_ident.pivot.sweep_witness import WITNESSES
from tpjb_ident.pivot.tables import Formula

#: Measured stiffness over the formula's beyond which a scale is wrong: pivots are softer, a third to a tenth in places.
_STIFFNESS = (0.03, 3.0)
#: Measured over drawn clearance beyond which the probes' scale is wrong, or the bearing file is another bearing's.
_SCALE = (0.5, 2.0)


@dataclass(frozen=True, repr=False)
class StaticTests:
    """Results of the static tests."""

    curves: tuple[PivotCurve, ...]
    clearance: ClearancePolygon | None
    locus: Locus | None
    left_out: Conditions = ()
    other_sweeps: tuple[ClearancePolygon, ...] = ()  #: where all of them are measured


def measure_static(
    campaign: Campaign, bearing: Bearing, with_pivots: bool = True, every_sweep: bool = False
) -> StaticTests:
    """Measure what the campaign holds of pivot curves, clearance polygon (of the coldest sweep) and locus."""
    angles = bearing.pivot_angles
    has_pivots = with_pivots and campaign.of_kind("dry_pivot")
    curves = fit_pivots(campaign, angles, on_refusal="few") if has_pivots else ()
    sweeps, most = coldest_first(campaign.of_kind("clearance")), None if every_sweep else 1
    polygons, problems = usable_runs(sweeps, lambda run: measure_run(run, angles, curves), most)
    excluded = [Condition("runs-refused", f"{problem.run} ({problem})") for problem in problems]
    clearance = polygons[0] if polygons else None
    locus = measure_locus(campaign, clearance) if campaign.of_kind("locus") else None
    for part in (*curves[:1], locus):
        if part is not None:
            excluded += [c for c in part.status if c == "runs-refused"]
    return StaticTests(curves, clearance, locus, tuple(excluded), tuple(polygons[1:]))


def implausible_pivots(curves: Sequence[PivotCurve], formula: Formula | None) -> list[str]:
    """What to say of curves that no pivot of the bearing can have: a unit or a sensitivity is wrong."""
    if formula is None:
        return []
    ratios = {}
    for curve in curves:
        ratio = float(curve.stiffness(curve.valid_to)) / formula(curve.pad, curve.valid_to)[1]
        if not _STIFFNESS[0] < ratio < _STIFFNESS[1]:
            ratios[f"pad #{curve.pad}"] = ratio
    if not ratios:
        return []
    extent = " to ".join(dict.fromkeys(f"{end:.2g}" for end in (min(ratios.values()), max(ratios.values()))))
    fault = f"{extent} times as stiff as Kirk's formula: a unit or a sensitivity of cells or probes is wrong"
    return [f"{', '.join(ratios)}: {fault}, or it is another bearing's file"]


def bearing_problems(campaign: Campaign, bearing: Bearing, former: Sequence[Problem] = ()) -> list[Problem]:
    """Problems of a campaign whose bearing is known: pads that it has not, and what clearance sweeps show."""
    problems = []
    for run in campaign.runs:
        if (run.pad or 0) > len(bearing.pads):
            fault = f"loads pad #{run.pad}, the bearing has {len(bearing.pads)}"
            problems.append(Problem("error", run.file, "pad", fault, "Correct pad in the manifest", run.id))
    refused = {problem.run for problem in former if problem.severity == "error"}
    said = "; ".join(problem.what for problem in former)
    for run in campaign.of_kind("clearance"):
        if run.id in refused:
            continue
        try:
            polygon = measure_run(run, bearing.pivot_angles)
        except RigDataError as error:
            problems += [Problem("warning", p.file, p.place, p.what, p.cure, run.id) for p in error.problems]
            continue
        for condition in polygon.status:
            quantity = "force" if condition == "cells-differ" else "displacement"
            if condition in {"cells-differ", "probe-gains-differ", "probe-turned"} and WITNESSES[quantity] not in said:
                channels = f"channels {' and '.join(channel.name for channel in run.of(quantity))}"
                cure = "Check sensitivities, axes and how they are mounted"
                problems.append(Problem("warning", run.file, channels, condition.detail, cure, run.id))
        negative = polygon.negative_preloads([pad.pad_clearance for pad in bearing.pads])
        if negative:
            cure = "Check pad_clearance, and how these pads are seated: unloaded, they flutter"
            problems.append(Problem("warning", run.file, "preload", negative, cure, run.id))
        problems += wrong_scale(run, polygon, bearing)
    return problems


def wrong_scale(run: Run, polygon: ClearancePolygon, bearing: Bearing) -> list[Problem]:
    """A clearance that is a multiple of the drawing's: the probes' scale is wrong, or it is another bearing's file."""
    measured, drawn = np.nanmean(polygon.clearance), np.mean(bearing.clearances)
    if _SCALE[0] * drawn < measured < _SCALE[1] * drawn:
        return []
    channels = f"channels {' and '.join(channel.name for channel in run.of('displacement'))}"
    fault = f"the sweep shows a clearance of {1e6 * measured:.3g} um, the bearing file says {1e6 * drawn:.3g} um"
    cure = "Check the sensitivities of the probes, and whether it is this bearing's file"
    return [Problem("error", run.file, channels, fault, cure, run.id)]
