"""`loadcell_crosstalk`: each cell also reads the other axis."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, fraction: float) -> Setup:
    """Each cell also reads this fraction of the other axis."""
    return setup.change(instruments=setup.instruments.read_cells(np.array([[1.0, fraction], [fraction, 1.0]])))


KIND = EffectKind(
    name="loadcell_crosstalk",
    side="measurement",
    parameters=(Parameter("fraction", "1", "ratio", 0.0, -0.5, 0.5, 0.02),),
    apply=apply,
    source="Leaf springs decouple to about 1 %",
    words=EffectWords(
        finding="the load cells hand {fraction} of each force to the other axis",
        physics=(
            "Each cell also feels the force across it. The static load then seems to turn, and cross-coupled terms "
            "appear."
        ),
        on_the_rig="The ratio of the measured load components changes with the load's direction.",
        check="decoupling of the cells: load one axis and read the other",
    ),
)
