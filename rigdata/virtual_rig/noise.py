"""Everything in a record that is not the bearing: how much of it, by kind.

The amounts of `Noise.like_samples` were measured on the sample campaigns; all are in SI units of the quantity, so
that they do not change with a sensor's sensitivity.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from zlib import crc32

import numpy as np

from rigdata.virtual_rig.truth import PAPER_RIG


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one quantity, in its SI unit (K for temperatures)."""

    white: float = 0.0
    flicker: float = 0.0
    mains: float = 0.0
    drift: float = 0.0

    def scaled(self, factor: float) -> ChannelNoise:
        """Return the same noise, `factor` times as strong."""
        return ChannelNoise(*(amount * factor for amount in astuple(self)))


@dataclass(frozen=True)
class Glitches:
    """Bursts in which a displacement or force channel is off by a constant."""

    share: float = 0.0
    shortest: int = 3
    longest: int = 50
    displacement: float = 65e-6
    force: float = 4000.0


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

    @classmethod
    def none(cls) -> Noise:
        """No disturbance at all: the records are the physics."""
        return cls()

    @classmethod
    def like_samples(cls) -> Noise:
        """As strong as in the sample campaigns, of every kind that they have."""
        entries = dict(PAPER_RIG["noise"])
        for name, amounts in entries.pop("channels").items():
            entries[name] = ChannelNoise(**amounts)
        entries |= {"glitches": Glitches(**entries["glitches"]), "dry": DryImperfections(**entries["dry"])}
        return cls(**entries)

    def scaled(self, factor: float) -> Noise:
        """Return it with the channels' noise `factor` times as strong; shaft, actuators, dry tests as they are."""
        return replace(self, **{name: getattr(self, name).scaled(factor) for name in PAPER_RIG["noise"]["channels"]})


#: What random streams are for; a change in one leaves all others as they were.
_PURPOSES = ("physics", "noise", "mains", "glitches", "dry", "faults", "campaign")


def stream(seed: int, run: str, purpose: str) -> np.random.Generator:
    """Generator for one run (by its id) and purpose; the same for the same arguments, on every machine."""
    return np.random.default_rng([seed, crc32(run.encode()), _PURPOSES.index(purpose)])
