"""Plausibility: how far the source of an effect carries; beyond it a name stands in for something else."""

from __future__ import annotations

import math
from dataclasses import dataclass

from model.effects import kind_of


@dataclass(frozen=True)
class Plausible:
    """Range of a parameter that its source allows."""

    low: float
    high: float
    source: str

    def words(self, name: str, value: float, lo: float, hi: float) -> str:
        """What to say of an amplitude with its interval; empty where it is plausible."""
        if lo <= self.high and hi >= self.low:
            return ""
        limit = self.high if value > self.high else self.low
        return (
            f"{name} {value:.3g} is beyond {limit:.3g}, as far as its source goes ({self.source}): "
            "another cause, or a second one, may stand behind this name"
        )


#: Effect and parameter: what its source allows. What is not here is bounded by three typical sizes of the library,
#: whose sources stand with the effects.
_RANGES = {
    ("oil_viscosity", "factor"): (0.9, 1.1, "ISO 3448 holds a grade within 10 %"),
    ("pivot_flexibility", "stiffness_factor"): (0.2, 2.0, "pivots are measured 2 to 3 times softer than the formula"),
    ("soft_pivot", "stiffness_factor"): (0.2, 2.0, "pivots are measured 2 to 3 times softer than the formula"),
    ("hot_oil_carryover", "fraction"): (0.0, 0.95, "groove mixing of 0.4 to 0.95 in flooded bearings"),
    ("starvation", "arc_fraction"): (0.0, 0.4, "leading-edge starvation of 10 to 40 % at low flow"),
    ("heat_loss", "share"): (0.0, 0.4, "pads, shaft and drained oil take 5 to 25 % of a film's heat"),
    ("pad_bending", "compliance_factor"): (0.0, 2.5, "1 is as computed"),
    ("housing_flexibility", "stiffness"): (1e8, math.inf, "rig housings have 1e9 to 5e9 N/m"),
    ("structure_compliance", "stiffness"): (1e8, math.inf, "rig structures have 1e9 to 5e9 N/m"),
    ("channel_delay", "delay"): (-5e-4, 5e-4, "demodulators and anti-alias filters take 20 to 500 us"),
    ("fluid_inertia", "added_mass"): (0.0, 60.0, "K-C-M fits of tilting-pad bearings: 0 to 60 kg at 100 mm"),
}


def plausible(name: str, parameter: str, pads: int) -> Plausible | None:
    """Range of an effect's parameter; None where nothing bounds it (a direction, a generic term)."""
    kind = kind_of(name)
    described = next((p for p in kind.parameters_of(pads) if p.name == parameter), None)
    if (name, parameter) in _RANGES:
        return Plausible(*_RANGES[(name, parameter)])
    if described is None or described.neutral != described.neutral or math.isnan(described.typical):
        return None
    origin, reach = described.to_linear(described.neutral), 3.0 * described.typical_step
    ends = sorted(described.from_linear(origin + s * reach) for s in (-1.0, 1.0))
    return Plausible(
        max(ends[0], described.low), min(ends[1], described.high), f"three times a typical size; {kind.source}"
    )
