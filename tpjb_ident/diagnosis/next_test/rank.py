"""Next test: the one more test that would separate explanations that these data cannot tell apart.

For an explanation A and every rival B that the data cannot tell from it, every design x on the list is predicted
with both, and the expected separation

    d = | L^-1 (f_A(x) - f_B(x)) |

is compared, L L^T being identification noise, model error and nuisances at x (Buzzi-Ferraris and Forzatti,
Chem. Eng. Sci. 38 (1983) 225). The nearest rival counts. Beside tests on the rig there are checks of single parameters
(`checks`). Where one test is not enough, the two that together separate the nearest rival furthest are suggested.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from model.effects import Effect, kind_of
from model.setup import Setup
from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import at_baseline
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.next_test.designs import Design, designs
from tpjb_ident.diagnosis.observations.layout import Layout
from tpjb_ident.diagnosis.observations.observe import Observations
from tpjb_ident.diagnosis.search.components import usual_factor

#: Separation [standard deviations] from which a test tells at all, and from which one test is enough: with 5 the wrong
#: explanation's chi-square exceeds the right one's by 9 in 95 of 100 cases.
TELLING, ENOUGH = 3.0, 5.0
#: Difference of chi-square from which one explanation counts as the right one.
MARGIN = 9.0


@dataclass(frozen=True)
class Separation:
    """What a design would show."""

    design: Design | Check
    each: tuple[float, ...]

    @property
    def expected(self) -> float:
        """Distance from the nearest rival."""
        return min(self.each)


def options_for(setup: Setup, layout: Layout) -> tuple[Design | Check, ...]:
    """List all that could be done next: tests on the rig and checks beside it."""
    return (*designs(setup, layout), *CHECKS)


def separated(
    setup: Setup, design: Design | Check, one: Sequence[Effect], rivals: Sequence[Sequence[Effect]], known: Tolerances
) -> Separation | None:
    """What one design would show; None where it cannot be or the model has no equilibrium."""
    if isinstance(design, Check):
        return Separation(design, tuple(design.separation(one, other) for other in rivals))
    if not design.fits(one, *rivals):
        return None
    try:
        return Separation(design, _each(setup, design, one, rivals, known))
    except NoEquilibriumError:
        return None


def _each(
    setup: Setup, design: Design, one: Sequence[Effect], rivals: Sequence[Sequence[Effect]], known: Tolerances
) -> tuple[float, ...]:
    seen = design.planned(setup)
    forward = design.forward(setup, seen)
    acting = design.acting(one)
    mine = forward(acting)
    columns = at_baseline(forward, acting, setup, known, mine)
    return tuple(apart(seen, columns, mine - forward(design.acting(other))) for other in rivals)


def ranked(tests: Sequence[Separation]) -> tuple[Separation, ...]:
    """The furthest from the nearest rival first."""
    return tuple(sorted(tests, key=lambda s: -s.expected))


def apart(seen: Observations, columns: FloatArray, difference: FloatArray) -> float:
    """Whitened length of a difference of two predictions [standard deviations]."""
    return float(np.linalg.norm(np.linalg.solve(usual_factor(seen, columns), difference)))


def chance(separation: float) -> float:
    """Probability that chi-square of the wrong explanation exceeds the right one's by `MARGIN`.

    The difference is normal with mean d^2 and standard deviation 2 d, d being the separation.
    """
    return float(ndtr((separation**2 - MARGIN) / (2.0 * separation))) if separation > 0.0 else 0.0


def suggested(tests: Sequence[Separation]) -> tuple[Separation, ...]:
    """Return the best test, or the best two together where the best alone would not settle the matter."""
    if len(tests) < 2 or tests[0].expected >= ENOUGH:
        return tuple(tests[:1])
    return max(itertools.combinations(tests, 2), key=together)


def together(tests: Sequence[Separation], now: Sequence[float] = ()) -> float:
    """Separation from the nearest rival by several tests at once, in standard deviations."""
    rows = [t.each for t in tests] + ([tuple(now)] if now else [])
    return float(np.linalg.norm(rows, axis=0).min())


def say(best: Sequence[Separation], one: str, *rivals: str) -> str:
    """In words: what `suggested` gives, and what it is expected to tell."""
    other = f"{', '.join(rivals[:-1])} and {rivals[-1]}" if len(rivals) > 1 else rivals[0]
    words, expected = " and ".join(t.design.words for t in best), together(best)
    if expected < TELLING:
        return (
            f"nothing on the list separates {one} from {other} (best: {words}, {expected:.1f} standard deviations); "
            "a change of hardware would, such as another oil or another bearing on the same rig"
        )
    least = "at least " if len(rivals) > 1 else ""
    return f"{words}: expected to separate {one} from {other} by {least}{expected:.0f} standard deviations"


@dataclass(frozen=True)
class Check:
    """What a bench, a balance or a second instrument tells about an effect's parameter without running the rig.

    It reads that parameter whoever else is at work; explanations that differ in it are told apart by their difference
    over `sigma`.
    """

    words: str
    effect: str
    parameter: str
    sigma: float

    def separation(self, one: Sequence[Effect], other: Sequence[Effect]) -> float:
        """Distance of two explanations in standard deviations; 0 where neither has the effect."""
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
