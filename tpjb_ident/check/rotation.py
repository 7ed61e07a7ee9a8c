"""Which way the shaft turns, from the force at running speed.

What is out of balance turns with the shaft, and so does the force that the film passes on: at 1X it goes round as the
shaft does. The cells are asked, not the probes: run-out, which differs from probe to probe, can turn an orbit of a
micrometre round, and no cell sees it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigdata.operating_point import ROTATIONS
from tpjb_ident.phasors.run_data import RunPhasors

if TYPE_CHECKING:
    from tpjb_ident.check.observation import Observation

#: A part of the 1X force counts from this many standard errors of its windows.
_CLEAR = 8.0
#: Ratio of the parts that go round one way and the other from which a run tells the sense: a film far stiffer in one
#: direction passes on both, forward more. Of the runs that tell it this share must agree, and so many there must be.
_ONE_WAY, _AGREED, _LEAST_RUNS = 1.5, 0.9, 3


def shaft_force(phasors: RunPhasors) -> float:
    """Logarithm of the 1X force's counter-clockwise part over its clockwise one; NaN where neither is clear."""
    place = phasors.lines.place("1X")
    if place is None:
        return math.nan
    force = phasors.cell_force.phasors[:, place]
    force = force[np.isfinite(force).all(axis=1)]
    if len(force) < 2:
        return math.nan
    parts = np.abs(force[:, :1] + np.array([1j, -1j]) * force[:, 1:])
    forward, backward = parts.mean(axis=0)
    if not max(forward, backward) > _CLEAR * parts.std(axis=0).max() / math.sqrt(len(force)):
        return math.nan
    return math.log(forward / max(backward, 1e-3 * forward))


def check_rotation(runs: Sequence[Observation]) -> None:
    """Warn where the 1X force clearly goes round against the stated sense."""
    for stated, other, sense in ((*ROTATIONS, 1.0), (*ROTATIONS[::-1], -1.0)):
        alike = [r for r in runs if r.run.point.rotation == stated and "force" not in r.report.doubts]
        clear = [r for r in alike if abs(r.shaft_force) > math.log(_ONE_WAY)]
        against = [r for r in clear if sense * r.shaft_force < 0.0]
        if len(against) >= max(_LEAST_RUNS, _AGREED * len(clear)):
            for observation in against:
                observation.report.ask("rotation", other=other, stated=stated)
