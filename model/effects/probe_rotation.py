"""`probe_rotation`: the probes stand at other angles than stated."""

from __future__ import annotations

import math

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, angle: float) -> Setup:
    """Both probes really stand at their stated angle + this."""
    # a probe at theta + angle reads d . e(theta + angle) = (R(-angle) d) . e(theta)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return setup.change(instruments=setup.instruments.read_displacement(lambda omega: turn))


KIND = EffectKind(
    name="probe_rotation",
    side="measurement",
    parameters=(Parameter("angle", "rad", "angle", 0.0, -1.6, 1.6, 0.035),),
    apply=apply,
    source="Drilled bores: 1 to 3 deg",
    words=EffectWords(
        finding="the probes stand {angle} off their stated angle",
        physics="Displacements are then resolved along wrong axes. Direct terms leak into the cross-coupled ones.",
        on_the_rig="The clearance polygon is turned against the pads.",
        check="the angles of the probe holders",
    ),
)
