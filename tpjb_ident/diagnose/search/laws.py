"""Laws: is a disagreement a constant map of the sensors or physics, and how does it go with frequency.

Both are asked of the baseline's residual, in numbers: the share of its squared whitened size that a law explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnose.observations.observe import ENTRY_NAMES, Observations
from tpjb_ident.diagnose.search.directions import coordinate
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.sensor_map import MAP_NAMES, sensor_map_columns

#: Root mean square gap [sigma] below which gains within their certificates are all there is to see.
NOTABLE = 3.0
#: Share from which a constant map counts as the story.
MOSTLY = 0.9
#: Root mean square [sigma] that a constant map may leave if it is the story.
LEFT = 2.0
#: Excitation frequencies that a law in omega needs.
LINES = 4


@dataclass(frozen=True)
class SensorMapTest:
    """Whether one constant pair of maps, h' = G h S^-1, explains the gap of h, locus and load readings.

    Attributes
    ----------
    share : float
        Of the squared whitened gap that it explains.
    drifting_share : float
        The same with maps that change linearly with the load: much more than `share` means physics.
    size : float
        Root mean square whitened gap of those observables.
    entries : dict of str to (float, float)
        Fitted entries of G - I and S - I with standard errors.
    """

    share: float
    drifting_share: float
    size: float
    entries: dict[str, tuple[float, float]]

    @property
    def words(self) -> str:
        """In a sentence."""
        if self.size < NOTABLE:
            return "no gap in h, locus and load readings for which a sensor map would be needed"
        percent = f"{100 * self.share:.0f} %"
        left = self.size * math.sqrt(1.0 - min(self.share, 1.0))
        if self.share < MOSTLY or left > LEFT:
            return (
                f"physics, or sensors that change: one constant map of the sensors explains {percent} of the squared "
                f"gap of h, locus and load readings and leaves {left:.1f} sigma (one that drifts with the load: "
                f"{100 * self.drifting_share:.0f} %)"
            )
        large = [f"{n} {v:+.3f}" for n, (v, se) in self.entries.items() if abs(v) > 4.0 * se]
        return (
            f"a constant map of the sensors explains {percent} of the squared gap of h, locus and load readings "
            f"({', '.join(large) or 'no single entry stands out'})"
        )


@dataclass(frozen=True)
class FrequencyLaw:
    """How the gap of h goes with the excitation frequency at one load.

    Attributes
    ----------
    load : float
        [N]
    shares : dict of str to float
        Of the squared whitened gap there that each law explains, best first.
    """

    load: float
    shares: dict[str, float]

    @property
    def words(self) -> str:
        """In a sentence."""
        name, share = next(iter(self.shares.items()))
        return f"at {self.load:.0f} N the gap of h over frequency goes most like {name} ({100 * share:.0f} % explained)"


def sensor_map_test(problem: Problem) -> SensorMapTest | None:
    """Fit one constant pair of maps to the baseline's residual; None without dynamic stiffness."""
    observations = problem.observations
    mine = np.isin(observations.families, ["h", "locus", "load"])
    if not np.any(observations.families == "h"):
        return None
    columns = sensor_map_columns(observations.elements, problem.base)
    load = coordinate(observations.elements, "load")[:, None]
    residual = observations.value - problem.base
    # sensor gains are what is asked
    weigh = _weigher(problem, mine, _others(problem))
    r, c, drift = weigh(residual), weigh(columns), weigh(columns * load)
    amplitude, share = _explained(r, c)
    _, drifting = _explained(r, np.column_stack([c, drift]))
    se = np.sqrt(np.diag(np.linalg.pinv(c.T @ c)))
    table = {n: (float(a), float(s)) for n, a, s in zip(MAP_NAMES, amplitude, se, strict=True)}
    return SensorMapTest(share, drifting, float(np.sqrt(np.mean(r**2))), table)


def frequency_laws(problem: Problem) -> tuple[FrequencyLaw, ...]:
    """Laws in omega at every load with enough frequencies and a gap to explain."""
    observations = problem.observations
    out = []
    for load, mine in _sweeps(observations):
        weigh = _weigher(problem, mine, problem.nuisances.columns)
        residual = weigh(observations.value - problem.base)
        if np.mean(residual**2) < 2.0:
            continue
        shares = {name: _explained(residual, weigh(c))[1] for name, c in _law_columns(observations, problem.base, mine)}
        out.append(FrequencyLaw(load, dict(sorted(shares.items(), key=lambda item: -item[1]))))
    return tuple(out)


def _sweeps(observations: Observations) -> list[tuple[float, BoolArray]]:
    load = np.array([e.place("load") if e.family == "h" else np.nan for e in observations.elements])
    line = np.array([e.place("excitation") for e in observations.elements])
    levels = sorted(set(load[np.isfinite(load)]))
    return [(float(w), load == w) for w in levels if len(set(line[load == w])) >= LINES]


def _law_columns(observations: Observations, base: FloatArray, mine: BoolArray) -> list[tuple[str, FloatArray]]:
    """One amplitude per entry; one alone for a delay, which multiplies h."""
    elements = observations.elements
    omega = np.where(mine, np.array([e.place("excitation") for e in elements]), 0.0)
    names = np.array([e.observable for e in elements])
    k = [np.where(mine & (names == f"k{e}"), 1.0, 0.0) for e in ENTRY_NAMES]
    c = [np.where(mine & (names == f"c{e}"), 1.0, 0.0) for e in ENTRY_NAMES]
    partner = {(e.observable, e.where): i for i, e in enumerate(elements) if e.family == "h"}
    delay = np.zeros(len(base))
    for i in np.flatnonzero(mine):
        e = elements[i]
        other = partner.get((("c" if e.observable[0] == "k" else "k") + e.observable[1:], e.where))
        if other is not None:
            delay[i] = (-omega[i] if e.observable[0] == "k" else omega[i]) * base[other]
    return [
        ("1 (a stiffness)", np.column_stack(k)),
        ("i w (a damping)", np.column_stack([one * omega for one in c])),
        ("-w^2 (a mass)", np.column_stack([-one * omega**2 for one in k])),
        ("i (a loss that does not depend on frequency)", np.column_stack(c)),
        ("i w h (a delay)", delay[:, None]),
    ]


def _others(problem: Problem) -> FloatArray:
    """Nuisances that are no sensor gains, (n, m)."""
    known = problem.nuisances
    return known.columns[:, [not name.startswith("gain of") for name in known.names]]


def _weigher(problem: Problem, mine: BoolArray, others: FloatArray):  # type: ignore[no-untyped-def]
    """Whitening of a part of the elements with noise, tolerance and some nuisances."""
    observations = problem.observations
    total = observations.covariance + np.diag(observations.fine**2) + others @ others.T
    part = total[np.ix_(mine, mine)]
    scale = np.sqrt(np.diag(part))
    factor = scale[:, None] * np.linalg.cholesky(part / np.outer(scale, scale))
    return lambda vector: np.linalg.solve(factor, vector[mine])


def _explained(residual: FloatArray, columns: FloatArray) -> tuple[FloatArray, float]:
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    amplitude = np.linalg.lstsq(columns / size, residual, rcond=1e-10)[0] / size
    left = residual - columns @ amplitude
    return amplitude, float(1.0 - (left @ left) / max(float(residual @ residual), 1e-300))
