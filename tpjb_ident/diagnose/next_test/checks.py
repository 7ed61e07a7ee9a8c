"""Checks: what a bench, a balance or a second instrument tells about an effect without running the rig.

A check reads the parameter of one effect, whoever else is at work, with a known standard deviation. Explanations that
differ in this parameter are told apart by their difference over that deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from model.effects import Effect, kind_of


@dataclass(frozen=True)
class Check:
    """A measurement of one effect's parameter.

    Attributes
    ----------
    words : str
    effect, parameter : str
    sigma : float
        Standard deviation of the reading, in the parameter's unit.
    """

    words: str
    effect: str
    parameter: str
    sigma: float

    def separation(self, one: Sequence[Effect], other: Sequence[Effect]) -> float:
        """Distance of two explanations in standard deviations; 0 where neither has the effect.

        Parameters
        ----------
        one : sequence of Effect
            An explanation.
        other : sequence of Effect
            Its rival.
        """
        mine, theirs = self._sizes(one), self._sizes(other)
        neutral = next(p.neutral for p in kind_of(self.effect).parameters if p.name == self.parameter)
        places = mine.keys() | theirs.keys()
        return math.hypot(*((mine.get(k, neutral) - theirs.get(k, neutral)) / self.sigma for k in places))

    def _sizes(self, effects: Sequence[Effect]) -> dict[tuple[tuple[str, float], ...], float]:
        """Size by place (pad, direction)."""
        found = {}
        for e in effects:
            if e.name == self.effect:
                place = tuple(sorted((k, v) for k, v in e.parameters.items() if k != self.parameter))
                found[place] = e.parameters[self.parameter]
        return found


#: Deviations are what ordinary workshop means reach, not what the best laboratory would.
CHECKS = (
    Check("the viscosity of an oil sample from the supply line, in a viscometer", "oil_viscosity", "factor", 0.01),
    Check("a second thermometer in the supply line", "supply_temperature", "change", 0.2),
    Check("the housing and all that moves with it on a balance", "housing_mass", "mass_error", 0.1),
    Check("one signal fed into all channels at once", "channel_delay", "delay", 1e-6),
    Check("the probes moved by a micrometer in front of this shaft", "probe_gain", "factor", 0.002),
    Check("the angle of the probes from a push against each in turn", "probe_rotation", "angle", 0.002),
    Check("the cells against a reference cell", "loadcell_gain", "factor", 0.001),
    Check("each cell loaded along one axis only", "loadcell_crosstalk", "fraction", 0.001),
    Check("the height of every pivot in the housing, measured", "pad_offset", "radial_offset", 1e-6),
    Check("the radius of the pads on a measuring machine", "preload_error", "pad_clearance_change", 2e-6),
    Check("two probes at the other end of the bearing", "misalignment", "angle", 1e-5),
)
