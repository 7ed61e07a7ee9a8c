"""Everything in a record that is not the bearing: how much of it, by kind.

The amounts of `Noise.like_samples` were measured on the sample campaigns; all are in SI units of the quantity, so
that they do not change with a sensor's sensitivity.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import radians
from zlib import crc32

import numpy as np

from rigdata.virtual_rig.truth import VirtualRigError


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one quantity, in its SI unit (K for temperatures)."""

    white: float = 0.0
    flicker: float = 0.0
    mains: float = 0.0
    drift: float = 0.0

    def __post_init__(self) -> None:
        if not all(0 <= getattr(self, f.name) < float("inf") for f in fields(self)):
            raise VirtualRigError(f"noise must be finite and not negative: {self}")

    def scaled(self, factor: float) -> ChannelNoise:
        """Return the same noise, `factor` times as strong."""
        return ChannelNoise(*(getattr(self, f.name) * factor for f in fields(self)))


@dataclass(frozen=True)
class Glitches:
    """Bursts in which a displacement or force channel is off by a constant."""

    share: float = 0.0
    shortest: int = 3
    longest: int = 50
    displacement: float = 65e-6
    force: float = 4000.0

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 1 or not 1 <= self.shortest <= self.longest:
            raise VirtualRigError("glitches need a share between 0 and 1, and 1 <= shortest <= longest")


@dataclass(frozen=True)
class DryImperfections:
    """What goes wrong in dry tests."""

    direction: tuple[float, float] = (0.0, 0.0)
    side: tuple[float, float] = (0.0, 0.0)
    side_start: float = 0.0
    friction: float = 0.0
    contact_gap: tuple[float, float] = (0.0, 0.0)
    contact_load: float = 500.0
    push_scatter: float = 0.0


@dataclass(frozen=True)
class Noise:
    """All disturbances of a campaign."""

    displacement: ChannelNoise = ChannelNoise()
    force: ChannelNoise = ChannelNoise()
    acceleration: ChannelNoise = ChannelNoise()
    temperature: ChannelNoise = ChannelNoise()
    speed: ChannelNoise = ChannelNoise()
    mains_frequency: float = 50.0
    mains_scatter: float = 0.0
    mains_harmonics: tuple[float, ...] = ()
    runout: tuple[float, ...] = ()  #: of the shaft, 1X, 2X, ... [m]
    unbalance: float = 0.0  #: kg m
    actuator_harmonics: tuple[float, ...] = ()  #: shares of the excitation
    actuator_scatter: float = 0.0
    cross_talk: float = 0.0  #: of the actuators
    load_miss: float = 0.0  #: by how much a run misses its set point, standard deviations: share, rad, share
    direction_miss: float = 0.0
    speed_miss: float = 0.0
    glitches: Glitches = Glitches()
    dry: DryImperfections = DryImperfections()
    bits: int | None = None

    def __post_init__(self) -> None:
        if self.bits is not None and not 4 <= self.bits <= 32:
            raise VirtualRigError(f"a converter has between 4 and 32 bits, not {self.bits}")

    @classmethod
    def none(cls) -> Noise:
        """No disturbance at all: the records are the physics."""
        return cls()

    @classmethod
    def like_samples(cls) -> Noise:
        """As strong as in the sample campaigns, of every kind that they have."""
        return cls(
            displacement=ChannelNoise(35e-9, 10e-9, 39e-9, 0.15e-6),
            force=ChannelNoise(2.05, 0.8, 0.44, 0.2),
            acceleration=ChannelNoise(3.9e-3, 7e-4, 8e-4, 2e-4),
            temperature=ChannelNoise(0.057, 0.036, 0.018, 0.02),
            speed=ChannelNoise(0.122, 0.023, 0.06, 0.002),
            mains_scatter=0.01,
            mains_harmonics=(0.02, 0.05),
            runout=(1.1e-6, 0.25e-6),
            unbalance=1.31e-3,
            actuator_harmonics=(0.02,),
            actuator_scatter=0.03,
            cross_talk=0.05,
            load_miss=0.003,
            direction_miss=radians(0.2),
            speed_miss=0.0009,
            glitches=Glitches(1 / 6),
            dry=DryImperfections(
                direction=(radians(1.0), radians(2.0)),
                side=(0.08, 0.22),
                side_start=2e-6,
                friction=0.004,
                contact_gap=(2e-6, 4e-6),
                push_scatter=0.003,
            ),
            bits=16,
        )

    def scaled(self, factor: float) -> Noise:
        """Return it with the channels' noise `factor` times as strong; shaft, actuators, dry tests as they are."""
        names = ("displacement", "force", "acceleration", "temperature", "speed")
        return replace(self, **{name: getattr(self, name).scaled(factor) for name in names})


#: What random streams are for; a change in one leaves all others as they were.
_PURPOSES = ("physics", "noise", "mains", "glitches", "dry", "faults", "campaign")


def stream(seed: int, run: str, purpose: str) -> np.random.Generator:
    """Generator for one run (by its id) and purpose; the same for the same arguments, on every machine."""
    return np.random.default_rng([seed, crc32(run.encode()), _PURPOSES.index(purpose)])
