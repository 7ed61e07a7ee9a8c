"""What a check can say once the bearing is known: clearance sweeps held against the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigdata.problem import Problem, RigDataError
from tpjb_ident.clearance.measure import measure_run

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign
    from rigdata.run import Run

#: Measured over drawn clearance beyond which the probes' scale is wrong, or the bearing file is another bearing's.
SCALE = (0.5, 2.0)


def bearing_problems(campaign: Campaign, bearing: Bearing, known: Sequence[Problem] = ()) -> list[Problem]:
    """Problems that show in the clearance sweeps of a campaign whose bearing is known.

    Parameters
    ----------
    campaign : Campaign
    bearing : Bearing
    known : sequence of Problem
        Found already; sweeps with an error are not looked at.
    """
    sound = [
        run
        for run in campaign.of_kind("clearance")
        if not any(p.run == run.id and p.severity == "error" for p in known)
    ]
    return [problem for run in sound for problem in _of_sweep(run, bearing)]


def _of_sweep(run: Run, bearing: Bearing) -> list[Problem]:
    try:
        polygon = measure_run(run, [pad.pivot_angle for pad in bearing.pads])
    except RigDataError as error:
        return [Problem("warning", p.file, p.place, p.what, p.cure, run.id) for p in error.problems]
    names = " and ".join(c.name for c in run.channels.values() if c.quantity == "displacement")
    drawn = float(np.mean([pad.assembled_clearance for pad in bearing.pads]))
    measured = float(np.nanmean(polygon.clearance))
    found = []
    for condition in polygon.status:
        if condition == "probe-gains-differ":
            cure = "Check the sensitivities of both probes"
            found.append(Problem("warning", run.file, f"channels {names}", condition.detail, cure, run.id))
    if not SCALE[0] * drawn < measured < SCALE[1] * drawn:
        what = f"the sweep shows a clearance of {1e6 * measured:.3g} um, the bearing file says {1e6 * drawn:.3g} um"
        cure = "Check the sensitivities of the probes, and whether it is this bearing's file"
        found.append(Problem("error", run.file, f"channels {names}", what, cure, run.id))
    return found
