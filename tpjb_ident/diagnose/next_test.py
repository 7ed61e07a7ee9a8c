"""Next test: the one more test that would separate explanations that these data cannot tell apart.

For two fitted explanations A and B every design x on the list is predicted with both, and the expected separation

    d = | L^-1 (f_A(x) - f_B(x)) |

is compared, L L^T being identification noise, fine tolerance and nuisances at x (Buzzi-Ferraris and Forzatti,
Chem. Eng. Sci. 38 (1983) 225). Beside tests on the rig there are checks of single parameters (`checks`). Where one test
is not enough, two are suggested together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from model.effects import Effect
from model.setup import Setup
from tpjb_ident.diagnose.checks import CHECKS, Check
from tpjb_ident.diagnose.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.layout import Layout
from tpjb_ident.diagnose.nuisance import Certificates, nuisances, whitener
from tpjb_ident.diagnose.planned import around, dry, dynamic, planned_observations

#: Separation [standard deviations] from which a test tells at all, and from which one test is enough: with 5 the wrong
#: explanation's chi-square exceeds the right one's by 9 in 95 of 100 cases.
TELLING, ENOUGH = 3.0, 5.0


@dataclass(frozen=True)
class Design:
    """A test on the rig that could be run.

    Attributes
    ----------
    words : str
    layout : Layout
    blind : frozenset of str
        Effects that do not act in this test, such as a spring outside what the probes then see.
    """

    words: str
    layout: Layout
    blind: frozenset[str] = frozenset()

    def acting(self, effects: Sequence[Effect]) -> tuple[Effect, ...]:
        """Effects that act in this test."""
        return tuple(e for e in effects if e.name not in self.blind)


@dataclass(frozen=True)
class Separation:
    """What a design would show.

    Attributes
    ----------
    design : Design or Check
    expected : float
        Distance of the two predictions in standard deviations.
    """

    design: Design | Check
    expected: float


def options_for(setup: Setup, layout: Layout) -> tuple[Design | Check, ...]:
    """List all that could be done next: tests on the rig and checks beside it."""
    return (*designs(setup, layout), *CHECKS)


def designs(setup: Setup, layout: Layout) -> tuple[Design, ...]:
    """List tests on this rig that go beyond a campaign's own.

    Parameters
    ----------
    setup : Setup
    layout : Layout
        What has been measured.
    """
    pads = len(setup.bearing.pads)
    points = [(t.load, t.direction, t.speed) for t in layout.dynamic] or [(5000.0, -np.pi / 2, 2 * np.pi * 22)]
    load, direction, speed = sorted(points)[len(points) // 2]
    top, low = max(p[0] for p in points), min(p[0] for p in points)
    lines = sorted({w for t in layout.dynamic for w in t.excitation}) or [speed]
    hertz = speed / (2 * np.pi)
    sweep = [2 * np.pi * f for f in (10.0, 20.0, 30.0, 40.0, 50.0)]
    done = {d.pad for d in layout.dry}
    out = [
        Design(
            f"a frequency sweep 10-50 Hz at {top:.0f} N, {hertz:.0f} Hz shaft speed",
            Layout(dynamic([top], sweep, speed, direction, 0)),
        ),
        Design(
            f"a frequency sweep 10-50 Hz at {low:.0f} N, {hertz:.0f} Hz shaft speed",
            Layout(dynamic([low], sweep, speed, direction, 0)),
        ),
        Design(
            f"a frequency sweep 60-150 Hz at {load:.0f} N, {hertz:.0f} Hz shaft speed, if the actuators reach that far",
            Layout(dynamic([load], [2 * np.pi * f for f in (60.0, 90.0, 120.0, 150.0)], speed, direction, 0)),
        ),
        Design(
            f"dynamic tests at half the load, {0.5 * low:.0f} N, {hertz:.0f} Hz",
            Layout(dynamic([0.5 * low], lines, speed, direction, 0)),
        ),
        Design(
            f"the load sweep repeated at {1.5 * hertz:.0f} Hz shaft speed, with pad temperatures",
            Layout(dynamic([low, load, top], lines[:1], 1.5 * speed, direction, pads)),
        ),
        Design(
            f"dynamic tests with the load between pads ({load:.0f} N turned by half a pad pitch)",
            Layout(dynamic([load], lines, speed, direction + np.pi / pads, pads)),
        ),
        Design(
            f"dynamic tests at {low:.0f} N and {top:.0f} N with the probes carried by the housing itself",
            Layout(dynamic([low, top], lines, speed, direction, 0)),
            frozenset({"housing_flexibility"}),
        ),
        Design(
            f"dynamic tests at a quarter more than the highest load, {1.25 * top:.0f} N, {hertz:.0f} Hz",
            Layout(dynamic([1.25 * top], lines, speed, direction, pads)),
        ),
        Design(
            f"the load sweep repeated at {0.5 * hertz:.0f} Hz shaft speed, with pad temperatures",
            Layout(dynamic([low, load, top], lines[:1], 0.5 * speed, direction, pads)),
        ),
        Design(f"a shaft locus over 20 load directions at {top:.0f} N", Layout((), around(top, 20, speed))),
        Design(f"a shaft locus over 20 load directions at {low:.0f} N", Layout((), around(low, 20, speed))),
        Design("the clearance polygon at a push load of 200 N, cold", Layout((), push_load=200.0)),
        Design("the clearance polygon at a push load of 1000 N, cold", Layout((), push_load=1000.0)),
        Design(
            f"pad temperatures at {low:.0f} N and {top:.0f} N, {hertz:.0f} Hz",
            Layout(dynamic([low, top], lines[:1], speed, direction, pads)),
        ),
    ]
    missing = [k for k in range(1, pads + 1) if k not in done]
    out += [Design(f"a dry load-deflection test on pad #{k}, 0.5-5 kN", Layout((), dry=dry([k]))) for k in missing]
    if not missing:
        out.append(
            Design(
                "the dry tests repeated up to 8 kN on all pads",
                Layout((), dry=dry(range(1, pads + 1), (2000.0, 5000.0, 7600.0))),
            )
        )
    return tuple(out)


def rank_designs(
    setup: Setup, one: Sequence[Effect], other: Sequence[Effect], options: Sequence[Design | Check], known: Certificates
) -> tuple[Separation, ...]:
    """Expected separation of two explanations by every design, best first.

    Parameters
    ----------
    setup : Setup
        Baseline.
    one, other : sequence of Effect
    options : sequence of Design or Check
    known : Certificates
    """
    out = []
    for design in options:
        if isinstance(design, Check):
            out.append(Separation(design, design.separation(one, other)))
            continue
        try:
            base = planned_observations(setup, design.layout)
            forward = Forward(setup, design.layout, base.elements)
            acting = design.acting(one)
            mine = forward(acting)
            difference = mine - forward(design.acting(other))
            columns = nuisances(forward, acting, mine, known).columns
        except NoEquilibriumError:
            continue
        distance = np.linalg.solve(whitener(base, columns), difference)
        out.append(Separation(design, float(np.sqrt(distance @ distance))))
    return tuple(sorted(out, key=lambda s: -s.expected))


def suggested(ranked: Sequence[Separation]) -> tuple[Separation, ...]:
    """Return the best test, and the second beside it where the best alone would not settle the matter."""
    return tuple(ranked[: 1 if ranked and ranked[0].expected >= ENOUGH else 2])


def together(tests: Sequence[Separation]) -> float:
    """Separation by several tests at once, in standard deviations; errors that they share count in each."""
    return float(np.linalg.norm([t.expected for t in tests]))


def say(best: Sequence[Separation], one: str, other: str) -> str:
    """In words: what `suggested` gives, and what it is expected to tell."""
    words, expected = " and ".join(t.design.words for t in best), together(best)
    if expected < TELLING:
        return (
            f"nothing on the list separates {one} from {other} (best: {words}, {expected:.1f} standard deviations); "
            "a change of hardware would, such as another oil or another bearing on the same rig"
        )
    return f"{words}: expected to separate {one} from {other} by {expected:.0f} standard deviations"
