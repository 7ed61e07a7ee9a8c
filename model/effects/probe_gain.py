"""`probe_gain`: the displacement probes are mis-scaled."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """Displacement readings are factor times the truth."""
    return setup.change(instruments=setup.instruments.read_displacement(lambda omega: factor * np.eye(2)))


KIND = EffectKind(
    name="probe_gain",
    side="measurement",
    parameters=(Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.03),),
    apply=apply,
    source="Eddy-current probes: 5 % for another target steel",
)
