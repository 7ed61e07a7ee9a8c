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
from numpy.typing import NDArray

from model.effects import Effect
from model.setup import Setup
from tpjb_ident.diagnose.checks import CHECKS, Check
from tpjb_ident.diagnose.designs import Design, designs
from tpjb_ident.diagnose.forward import NoEquilibriumError
from tpjb_ident.diagnose.layout import Layout
from tpjb_ident.diagnose.nuisance import Certificates, nuisances, whitener
from tpjb_ident.diagnose.observe import Observations

FloatArray = NDArray[np.float64]

#: Separation [standard deviations] from which a test tells at all, and from which one test is enough: with 5 the wrong
#: explanation's chi-square exceeds the right one's by 9 in 95 of 100 cases.
TELLING, ENOUGH = 3.0, 5.0
#: Difference of chi-square from which one explanation counts as the right one.
MARGIN = 9.0


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
        if not design.fits(one, other):
            continue
        try:
            seen = design.planned(setup)
            forward = design.forward(setup, seen)
            acting = design.acting(one)
            mine = forward(acting)
            difference = mine - forward(design.acting(other))
            columns = nuisances(forward, acting, mine, known).columns
        except NoEquilibriumError:
            continue
        out.append(Separation(design, apart(seen, columns, difference)))
    return tuple(sorted(out, key=lambda s: -s.expected))


def apart(seen: Observations, columns: FloatArray, difference: FloatArray) -> float:
    """Whitened length of a difference of two predictions [standard deviations].

    Parameters
    ----------
    seen : Observations
    columns : (n, m) ndarray
        Nuisances, per standard deviation.
    difference : (n,) ndarray
    """
    return float(np.linalg.norm(np.linalg.solve(whitener(seen, columns), difference)))


def chance(separation: float, margin: float = MARGIN) -> float:
    """Probability that chi-square of the wrong explanation exceeds the right one's by `margin`.

    The difference is normal with mean d^2 and standard deviation 2 d, d being the separation.
    """
    from scipy.stats import norm

    return float(norm.cdf((separation**2 - margin) / (2.0 * separation))) if separation > 0.0 else 0.0


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
