"""`loadcell_gain`: the load cells are mis-scaled."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """Force readings of the cells are factor times the truth."""
    return setup.change(instruments=setup.instruments.read_cells(factor * np.eye(2)))


KIND = EffectKind(
    name="loadcell_gain",
    side="measurement",
    parameters=(Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.02),),
    apply=apply,
    source="A parallel load path (hoses, leaf springs) takes 0.5 to 5 %",
)
