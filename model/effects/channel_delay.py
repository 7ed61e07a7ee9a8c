"""`channel_delay`: displacement is recorded later than force."""

from __future__ import annotations

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup
from rigdata.arrays import ComplexArray


def apply(setup: Setup, delay: float) -> Setup:
    """Displacement channels are recorded this much later than force and acceleration channels."""

    def late(omega: float) -> ComplexArray:
        return np.exp(-1j * omega * delay) * np.eye(2)

    return setup.change(instruments=setup.instruments.read_displacement(late))


KIND = EffectKind(
    name="channel_delay",
    side="measurement",
    parameters=(Parameter("delay", "s", "time", 0.0, -0.005, 0.005, 0.0001),),
    apply=apply,
    source="Demodulator and anti-alias filters: 20 to 500 us",
    words=EffectWords(
        finding="force comes {delay} late against displacement",
        physics=(
            "A delay between the channels turns every phasor in proportion to the frequency. Stiffness passes into "
            "damping."
        ),
        on_the_rig="Damping is off by K times the delay at all loads.",
        check="filters and amplifiers of both sorts of channel",
    ),
)
