"""Pad numbers of dry runs against the directions of their loads: one number, one direction.

Two runs that contradict each other do not tell which of them is wrong. The others do: pads stand evenly around the
shaft, so that the run is wrong which the arrangement that most runs agree on leaves over.
"""

from __future__ import annotations

from collections.abc import Sequence

from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import angle_between

#: Loads within this angle [deg] go toward one pad.
_SAME_PAD = 25.0
#: A load goes toward a pad of the arrangement within this angle [deg].
_AT_PAD = 12.0
#: Numbers of pads that bearings have.
_PADS = range(3, 13)

Shown = tuple[Observation, float]


def check_labels(directions: Sequence[Shown]) -> None:
    """Name runs whose pad number contradicts another run's.

    Parameters
    ----------
    directions : sequence of (Observation, float)
        Dry runs and the direction toward which their load rises [deg].
    """
    pairs = [
        (first, second) for i, second in enumerate(directions) for first in directions[:i] if _contradict(first, second)
    ]
    if not pairs:
        return
    odd = _odd_ones(directions)
    for first, second in pairs:
        struck = [one for one in (first, second) if id(one[0]) in odd]
        one, other = (struck[0], first if struck[0] is second else second) if len(struck) == 1 else (second, first)
        _tell(one, other, odd.get(id(one[0])) if len(struck) == 1 else None)


def _contradict(first: Shown, second: Shown) -> bool:
    near = angle_between(first[1], second[1]) < _SAME_PAD
    return near != (first[0].run.pad == second[0].run.pad)


def _tell(one: Shown, other: Shown, belongs: int | None) -> None:
    """Name a contradiction, at the run that is wrong where that is known."""
    seen, shows = one
    what = f"pad {seen.run.pad} is loaded toward {shows:.0f} deg"
    if seen.run.pad == other[0].run.pad:
        what += f" here, toward {other[1]:.0f} deg in run {other[0].run.id}"
    else:
        what += f", as is pad {other[0].run.pad} in run {other[0].run.id}"
    cure = "One of the two runs names the wrong pad: correct it"
    if belongs is not None:
        what += f"; by the directions of the other runs it is pad {belongs}"
        cure = "Correct the pad number of this run"
    if not any(f.key == "pad" for f in seen.report.found):
        seen.report.say("pad", "error", "pad", what, cure)


def _odd_ones(directions: Sequence[Shown]) -> dict[int, int]:
    """Runs (by identity) that the evenly spaced arrangement of all others leaves over, with the pad that they load.

    Empty where fewer than three runs agree on one arrangement, or where two arrangements serve as many.
    """
    largest = max((seen.run.pad or 0) for seen, _ in directions)
    found: dict[frozenset[int], dict[int, int]] = {}
    for count in _PADS:
        for sense in (1, -1):
            if count < largest:
                continue
            step = 360.0 * sense / count
            for seen, shows in directions:
                first = shows - step * ((seen.run.pad or 1) - 1)
                places = {id(s): _pad_at(d, first, step, count) for s, d in directions}
                fit = frozenset(id(s) for s, _ in directions if places[id(s)] == s.run.pad)
                rest = {id(s): places[id(s)] for s, _ in directions if id(s) not in fit}
                if len(fit) >= 3 and None not in rest.values():
                    found.setdefault(fit, {k: v for k, v in rest.items() if v is not None})
    most = max((len(fit) for fit in found), default=0)
    best = [rest for fit, rest in found.items() if len(fit) == most]
    return best[0] if len(best) == 1 and 2 * most > len(directions) else {}


def _pad_at(direction: float, first: float, step: float, count: int) -> int | None:
    """Number of the pad toward which a load goes; None between pads."""
    number = round((direction - first) / step)
    return number % count + 1 if angle_between(direction, first + number * step) < _AT_PAD else None
