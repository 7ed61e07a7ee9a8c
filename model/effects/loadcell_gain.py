"""`loadcell_gain`: the load cells are mis-scaled."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
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
    words=EffectWords(
        finding="the load cells read {factor:size} {factor:more|less} than true",
        physics=(
            "A wrong sensitivity, or a load path beside the cells, scales all forces. Stiffness and damping follow, "
            "positions do not."
        ),
        on_the_rig="All coefficients are off alike; positions and clearance agree.",
        check="the cells' calibration, and hoses or springs beside them",
    ),
)
