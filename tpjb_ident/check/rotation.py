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


def shaft_force(phasors: RunPhasors | None) -> float:
    """Logarithm of the 1X force's counter-clockwise part over its clockwise one; NaN where neither is clear."""
    if phasors is None:
        return math.nan
    place = phasors.lines.place("1X")
    if place is None:
        return math.nan
    force = phasors.cell_force.phasors[:, place]
    force = force[np.isfinite(force).all(axis=1)]
    if len(force) < 2:
        return math.nan
    parts, errors = [], []
    for sign in (1j, -1j):
        part = np.abs(force[:, 0] + sign * force[:, 1])
        parts.append(float(part.mean()))
        errors.append(float(part.std()) / math.sqrt(len(part)))
    if not max(parts) > _CLEAR * max(errors):
        return math.nan
    return math.log(parts[0] / max(parts[1], 1e-3 * parts[0]))


def check_rotation(runs: Sequence[Observation]) -> None:
    """Warn where the 1X force clearly goes round against the stated sense."""
    for rotation in ROTATIONS:
        alike = [r for r in runs if r.run.point.rotation == rotation and "force" not in r.report.doubts]
        sense = -1.0 if rotation == ROTATIONS[1] else 1.0
        clear = [r for r in alike if abs(r.shaft_force) > math.log(_ONE_WAY)]
        against = [r for r in clear if sense * r.shaft_force < 0.0]
        if len(against) < _LEAST_RUNS or len(against) < _AGREED * len(clear):
            continue
        other = ROTATIONS[rotation == ROTATIONS[0]]
        text = f"shows a force at running speed that goes round {other}, but the shaft is said to turn {rotation}"
        cure = (
            "Check rotation in [shaft] or the runs; if it is right, left and right are exchanged: the sign of a cell "
            "or probe along X, or two exchanged cells or probes"
        )
        for observation in against:
            observation.report.say("rotation", "warning", "force at running speed", text, cure)
