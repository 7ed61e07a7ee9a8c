"""Thinned: a locus of many load directions, every so many of them: neighbours say the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tpjb_ident.diagnose.observations.observe import Observations

#: Load directions per load and speed that are enough: the locus of five pads has five waves, two directions to each.
DIRECTIONS = 10


def thinned(observations: Observations, most: int = DIRECTIONS) -> Observations:
    """Keep every second, third .. load direction of a locus that has more than are needed.

    Parameters
    ----------
    observations : Observations
    most : int
        Directions per load and speed.
    """
    kept = set()
    tests: dict[tuple[float, float], list[float]] = {}
    for one in observations.layout.locus:
        tests.setdefault((one.load, one.speed), []).append(one.direction)
    for (load, speed), directions in tests.items():
        around = sorted(set(directions), key=lambda a: a % (2 * np.pi))
        step = -(-len(around) // most)
        kept |= {(load, speed, a) for a in around[::step]}
    mine = np.array([
        e.family not in {"locus", "load"} or (e.place("load"), e.place("speed"), e.place("direction")) in kept
        for e in observations.elements
    ])  # fmt: skip
    if mine.all():
        return observations
    locus = tuple(t for t in observations.layout.locus if (t.load, t.speed, t.direction) in kept)
    return replace(
        observations, layout=replace(observations.layout, locus=locus), value=observations.value[mine],
        covariance=observations.covariance[np.ix_(mine, mine)], sigma=observations.sigma[mine],
        elements=tuple(e for e, m in zip(observations.elements, mine, strict=True) if m),
    )  # fmt: skip
