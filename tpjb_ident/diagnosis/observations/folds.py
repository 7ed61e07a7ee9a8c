"""Folds: whole operating points to which a model must extrapolate, and which no fit has seen.

Not random elements: neighbours are near copies of each other. Held out are the top load, the outer frequencies of a
sweep, every speed beside the most frequent one, and a sector of the locus.
"""

from collections import Counter

import numpy as np

from rigdata.arrays import BoolArray
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import Element, Observations


def held_out(observations: Observations) -> BoolArray:
    """Elements at which a model must extrapolate; all of them where there are none, (n,)."""
    dynamic = [e for e in observations.elements if e.family in {"h", "temperature"}]
    speeds = Counter(e.place("speed") for e in dynamic)
    usual = speeds.most_common(1)[0][0] if speeds else 0.0
    lines: dict[tuple[float, float], set[float]] = {}
    for e in dynamic:
        if e.family == "h" and e.place("speed") == usual:
            lines.setdefault((e.place("load"), e.place("direction")), set()).add(e.place("excitation"))
    top = max((load for load, _ in lines), default=0.0)
    sector = _sector(observations.elements)

    def beyond(e: Element) -> bool:
        if e.family in {"locus", "load"}:
            return e.place("direction") % (2 * np.pi) in sector
        if e.family not in {"h", "temperature"}:
            return False
        if e.place("speed") != usual:
            return True
        swept = lines.get((e.place("load"), e.place("direction")), set())
        if len(swept) >= Deciding.sweep:
            return e.place("excitation") in (min(swept), max(swept))
        return e.place("load") == top and len(lines) > 2

    out = np.array([beyond(e) for e in observations.elements], dtype=bool)
    return out if out.any() else ~out


def _sector(elements: tuple[Element, ...]) -> set[float]:
    """Neighbouring directions of a locus that are held out."""
    around = sorted({e.place("direction") % (2 * np.pi) for e in elements if e.family in {"locus", "load"}})
    return {a for k, a in enumerate(around) if Deciding.sectors * k // len(around) + 1 == Deciding.sector}
