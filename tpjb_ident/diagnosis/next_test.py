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
from dataclasses import dataclass, replace

import numpy as np

from model.effects import Effect, kind_of
from model.setup import Setup
from tpjb_ident.diagnosis.forward.forward import Change, Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import at_baseline
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Layout, Observations
from tpjb_ident.diagnosis.planned import around, dry, dynamic, planned_observations

HZ = 2 * math.pi
#: Step of the supply temperature that a cooler can make [K].
_HOTTER = 10.0
#: How far from the middle of its pad a pivot may sit for the shaft to turn either way [share of the arc].
_CENTRAL = 0.05


@dataclass(frozen=True)
class Design:
    """A test on the rig that could be run."""

    words: str
    layout: Layout
    blind: frozenset[str] = frozenset()
    unsure: frozenset[str] = frozenset()
    change: Change | None = None

    def acting(self, effects: Sequence[Effect]) -> tuple[Effect, ...]:
        """Effects that act in this test."""
        return tuple(e for e in effects if e.name not in self.blind)

    def fits(self, *explanations: Sequence[Effect]) -> bool:
        """Whether the model knows what these explanations would do in this test."""
        return not any(e.name in self.unsure for e in itertools.chain(*explanations))

    def planned(self, setup: Setup) -> Observations:
        """Observation vector that the baseline predicts, with the noise to be expected."""
        return planned_observations(setup if self.change is None else self.change(setup), self.layout)

    def forward(self, setup: Setup, seen: Observations) -> Forward:
        """The model of this test, for what `planned` lists."""
        return Forward(setup, self.layout, seen.elements, last=self.change)


def designs(setup: Setup, layout: Layout) -> tuple[Design, ...]:
    """List tests on this rig that go beyond a campaign's own."""
    at = _OperatingRange.of(layout, len(setup.bearing.pads))
    return (
        *_other_points(at), *_other_rigs(setup, at), *_static(at), *_dry(layout, at.pads)
    )  # fmt: skip


@dataclass(frozen=True)
class _OperatingRange:
    """Where a campaign has been: middle, top and lowest load [N], direction, speed, lines [rad/s], pads."""

    load: float
    top: float
    low: float
    direction: float
    speed: float
    lines: tuple[float, ...]
    pads: int

    @classmethod
    def of(cls, layout: Layout, pads: int) -> _OperatingRange:
        points = [t.point for t in layout.dynamic] or [(5000.0, -math.pi / 2, 22.0 * HZ)]
        load, direction, speed = sorted(points)[len(points) // 2]
        lines = tuple(sorted(set[float]().union(*(t.excitation for t in layout.dynamic)))) or (speed,)
        return cls(load, max(p[0] for p in points), min(p[0] for p in points), direction, speed, lines, pads)

    @property
    def shaft(self) -> str:
        return f"{abs(self.speed) / HZ:.0f} Hz"

    def run(
        self, words: str, loads: Sequence[float], lines: Sequence[float], sensors: bool = False, faster: float = 1.0
    ) -> Design:
        """Dynamic tests."""
        pads = self.pads if sensors else 0
        return Design(words, Layout(dynamic(loads, lines, faster * self.speed, self.direction, pads)))

    def sweep(self, words: str, faster: float = 1.0) -> Design:
        """The load sweep with pad temperatures."""
        loads = [self.low, self.load, self.top]
        return self.run(f"the load sweep repeated {words}, with pad temperatures", loads, self.lines[:1], True, faster)


def _other_points(at: _OperatingRange) -> list[Design]:
    sweep, far = [HZ * f for f in (10.0, 20.0, 30.0, 40.0, 50.0)], [HZ * f for f in (60.0, 90.0, 120.0, 150.0)]
    between = replace(at, direction=at.direction + math.pi / at.pads)
    half, more = 0.5 * at.low, 1.25 * at.top
    return [
        *(
            at.run(f"a frequency sweep 10-50 Hz at {w:.0f} N, {at.shaft} shaft speed", [w], sweep)
            for w in (at.top, at.low)
        ),
        at.run(
            f"a frequency sweep 60-150 Hz at {at.load:.0f} N, {at.shaft} shaft speed, if the actuators reach that far",
            [at.load], far,
        ),
        at.run(f"dynamic tests at half the load, {half:.0f} N, {at.shaft}", [half], at.lines),
        at.run(
            f"dynamic tests at a quarter more than the highest load, {more:.0f} N, {at.shaft}", [more], at.lines, True
        ),
        between.run(
            f"dynamic tests with the load between pads ({at.load:.0f} N turned by half a pad pitch)",
            [at.load], at.lines, True,
        ),
        at.run(
            f"pad temperatures at {at.low:.0f} N and {at.top:.0f} N, {at.shaft}",
            [at.low, at.top], at.lines[:1], True,
        ),
        *(at.sweep(f"at {by * abs(at.speed) / HZ:.0f} Hz shaft speed", by) for by in (1.5, 0.5)),
    ]  # fmt: skip


def _other_rigs(setup: Setup, at: _OperatingRange) -> list[Design]:
    """Tests for which the rig is changed."""
    outside = f"dynamic tests at {at.low:.0f} N and {at.top:.0f} N with the probes carried by the housing itself"
    hotter = at.sweep(f"with the oil {_HOTTER:.0f} K hotter at the inlet")
    drowned = at.sweep("with so much oil that more changes nothing")
    out = [
        replace(at.run(outside, [at.low, at.top], at.lines), blind=frozenset({"housing_flexibility"})),
        replace(hotter, change=_hotter),
        replace(drowned, blind=frozenset({"starvation"}), unsure=frozenset({"hot_oil_carryover"})),
    ]
    return [*out, *([at.sweep("with the shaft turning the other way", -1.0)] if reversible(setup) else [])]


def _hotter(setup: Setup) -> Setup:
    return setup.change(supply_change=setup.supply_change + _HOTTER)


def _static(at: _OperatingRange) -> list[Design]:
    return [
        *(
            Design(f"a shaft locus over 20 load directions at {w:.0f} N", Layout((), around(w, 20, at.speed)))
            for w in (at.top, at.low)
        ),
        *(
            Design(f"the clearance polygon at a push load of {w:.0f} N, cold", Layout((), push_load=w))
            for w in (200.0, 1000.0)
        ),
        Design("the clearance polygon right after a run, at a push load of 200 N, bearing and shaft still hot",
               Layout((), push_load=200.0), change=grown),
    ]  # fmt: skip


def grown(setup: Setup) -> Setup:
    """A bearing at standstill that keeps the clearance of the running one."""
    by = setup.clearance_change
    hot = setup.change_pads(lambda k, pad: replace(pad, assembled_clearance=pad.assembled_clearance + by))
    return hot.change(clearance_change=0.0)


def _dry(layout: Layout, pads: int) -> list[Design]:
    numbers = range(1, pads + 1)
    tested = {d.pad for d in layout.dry}
    missing = [k for k in numbers if k not in tested]
    if missing:
        return [
            Design(f"a dry load-deflection test on pad #{k}, 0.5-5 kN", Layout((), dry=dry([k]))) for k in missing
        ]  # fmt: skip
    return [Design("the dry tests repeated up to 8 kN on all pads", Layout((), dry=dry(numbers, (2e3, 5e3, 7.6e3))))]


def reversible(setup: Setup) -> bool:
    """Whether every pad would carry with the shaft turning the other way."""
    return all(abs(pad.pivot_offset - 0.5) <= _CENTRAL for pad in setup.bearing.pads)


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
    setup: Setup,
    design: Design | Check,
    first: Sequence[Effect],
    rivals: Sequence[Sequence[Effect]],
    known: Tolerances | None = None,
) -> Separation | None:
    """What one design would show, no less without tolerances; None where it cannot be, or the model refuses."""
    if isinstance(design, Check):
        return Separation(design, tuple(design.separation(first, rival) for rival in rivals))
    if not design.fits(first, *rivals):
        return None
    acting = design.acting(first)
    try:
        planned = design.planned(setup)
        forward = design.forward(setup, planned)
        prediction = forward(acting)
        columns = at_baseline(forward, acting, setup, known, prediction) if known else np.zeros((len(prediction), 0))
        others = [forward(design.acting(rival)) for rival in rivals]
    except (ValueError, NoEquilibriumError):
        return None
    white = np.linalg.solve(usual_factor(planned, columns), prediction[:, None] - np.column_stack(others))
    return Separation(design, tuple(np.linalg.norm(white, axis=0).tolist()))


def ranked(tests: Sequence[Separation]) -> list[Separation]:
    """The furthest from the nearest rival first."""
    return sorted(tests, key=lambda s: -s.expected)


def suggested(tests: Sequence[Separation]) -> tuple[Separation, ...]:
    """Return the best test, or the best two together where the best alone would not settle the matter."""
    if len(tests) < 2 or tests[0].expected >= Deciding.enough:
        return tuple(tests[:1])
    return max(itertools.combinations(tests, 2), key=together)


def together(tests: Sequence[Separation]) -> float:
    """Separation from the nearest rival by several tests at once, in standard deviations."""
    return float(np.linalg.norm([t.each for t in tests], axis=0).min())


def say(best: Sequence[Separation], first: str, *rivals: str) -> str:
    """In words: what `suggested` gives, and what it is expected to tell."""
    names = f"{', '.join(rivals[:-1])} and {rivals[-1]}" if len(rivals) > 1 else rivals[0]
    words, expected = " and ".join(t.design.words for t in best), together(best)
    if expected < Deciding.visible:
        return (
            f"nothing on the list separates {first} from {names} (best: {words}, {expected:.1f} standard deviations); "
            "a change of hardware would, such as another oil or another bearing on the same rig"
        )
    least = "at least " if len(rivals) > 1 else ""
    return f"{words}: expected to separate {first} from {names} by {least}{expected:.0f} standard deviations"


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
        sizes, theirs = self._sizes(one), self._sizes(other)
        neutral = next(p.neutral for p in kind_of(self.effect).parameters if p.name == self.parameter)
        places = sizes.keys() | theirs.keys()
        return math.hypot(*((sizes.get(k, neutral) - theirs.get(k, neutral)) / self.sigma for k in places))

    def _sizes(self, effects: Sequence[Effect]) -> dict[tuple[tuple[str, float], ...], float]:
        """Size by place (pad, direction)."""
        table = {}
        for e in effects:
            if e.name == self.effect:
                place = tuple(sorted((k, v) for k, v in e.parameters.items() if k != self.parameter))
                table[place] = e.parameters[self.parameter]
        return table


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
