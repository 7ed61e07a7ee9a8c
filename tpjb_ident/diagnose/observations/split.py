"""Split: which operating points are held out before any fit, and which blocks rotate when candidates are ranked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.diagnose.observations.observe import Observations

BoolArray = NDArray[np.bool_]


def held_out(observations: Observations) -> BoolArray:
    """Elements that no fit may see: one upper load, one upper frequency, every fifth locus direction.

    Whole operating points, not random elements: neighbours are near copies of each other. The highest and the
    lowest load stay in the training part, so that held-out points test the model between and not beyond them;
    the rotation of `training_blocks` tests beyond.
    """
    dynamic = [e for e in observations.elements if e.family == "h"]
    loads = sorted({e.place("load") for e in dynamic})
    blocks: set[str] = {"locus 2"}
    if len(loads) >= 3:
        chosen = loads[-2]
        blocks |= {
            e.block for e in observations.elements if e.place("load") == chosen and e.family in {"h", "temperature"}
        }
    swept: dict[float, set[float]] = {}
    for e in dynamic:
        swept.setdefault(e.place("load"), set()).add(e.place("excitation"))
    for load, lines in swept.items():
        if len(lines) >= 4:
            line = sorted(lines)[-2]
            blocks |= {e.block for e in dynamic if e.place("load") == load and e.place("excitation") == line}
    return np.isin(observations.blocks, sorted(blocks))


def training_blocks(observations: Observations, train: BoolArray) -> list[BoolArray]:
    """Blocks of the training part that are left out in turn."""
    names = observations.blocks
    return [train & (names == name) for name in sorted(set(names[train]))]
