"""`probe_gain`: the displacement probes are mis-scaled."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
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
    words=EffectWords(
        finding="the probes read {factor:size} {factor:more|less} than true",
        physics=(
            "Sensitivity of eddy-current probes depends on the target's steel. Stiffness, damping, positions and "
            "clearance are off by the same factor."
        ),
        on_the_rig="The clearance polygon and all coefficients are off alike.",
        check="the probes' calibration on this shaft",
    ),
)
