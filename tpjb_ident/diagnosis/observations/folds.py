"""Folds: blocks of operating points that are left out in turn, so that unseen points choose.

Whole operating points, not random elements: neighbours are near copies of each other. Some folds ask a model to
extrapolate: the top load, the outer frequencies of a sweep, every speed beside the most frequent one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import BoolArray, IntArray
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import Element, Observations


@dataclass(frozen=True)
class Fold:
    """Points that are left out together."""

    name: str
    members: IntArray = field(repr=False)  #: (m,): elements
    beyond: bool = False


def folds(observations: Observations) -> tuple[Fold, ...]:
    """Split all elements into blocks; every element is in one of them."""
    elements = observations.elements
    names, unassigned = _dynamic_names(elements)
    sectors = _sectors(elements)
    rows: dict[str, list[int]] = {}
    for i, e in enumerate(elements):
        if e.family in {"h", "temperature"}:
            name = names[i]
        elif e.family in {"locus", "load"}:
            name = f"locus, sector {sectors[i]}"
        else:
            name = f"{'dry test' if e.family == 'dry' else 'clearance'} of pad {e.place('pad'):.0f}"
        rows.setdefault(name, []).append(i)
    far = unassigned | {f"locus, sector {Deciding.sector}"}
    return tuple(Fold(name, np.array(members), name in far) for name, members in rows.items())


def held_out(observations: Observations) -> BoolArray:
    """Elements of the folds that ask a model to extrapolate; all of them where there are no such folds."""
    out = np.zeros(len(observations), dtype=bool)
    for fold in folds(observations):
        if fold.beyond:
            out[fold.members] = True
    return out if out.any() else ~out


def _dynamic_names(elements: tuple[Element, ...]) -> tuple[dict[int, str], set[str]]:
    """Block of every dynamic element, and the blocks to which a model must extrapolate."""
    members = [(i, e) for i, e in enumerate(elements) if e.family in {"h", "temperature"}]
    speeds = Counter(e.place("speed") for _, e in members)
    usual = speeds.most_common(1)[0][0] if speeds else 0.0
    lines: dict[tuple[float, float], set[float]] = {}
    for _, e in members:
        if e.family == "h" and e.place("speed") == usual:
            lines.setdefault((e.place("load"), e.place("direction")), set()).add(e.place("excitation"))
    names: dict[int, str] = {}
    unassigned: set[str] = set()
    top = max((load for load, _ in lines), default=0.0)
    for i, e in members:
        key = (e.place("load"), e.place("direction"))
        if e.place("speed") != usual:
            names[i] = f"speed {e.place('speed'):.1f} rad/s"
            unassigned.add(names[i])
            continue
        swept = lines.get(key, set())
        name = f"load {key[0]:.0f} N at {np.degrees(key[1]):.0f} deg"
        if len(swept) >= Deciding.sweep:
            line = e.place("excitation")
            outer = line in (min(swept), max(swept))
            name += ", temperatures" if e.family == "temperature" else f", {line / (2 * np.pi):g} Hz"
            unassigned |= {name} if outer else set()
        elif key[0] == top and len(lines) > 2:
            unassigned.add(name)
        names[i] = name
    return names, unassigned


def _sectors(elements: tuple[Element, ...]) -> dict[int, int]:
    """Sector of neighbouring directions that every element of a locus lies in."""
    around = sorted({e.place("direction") % (2 * np.pi) for e in elements if e.family in {"locus", "load"}})
    place = {angle: Deciding.sectors * k // len(around) + 1 for k, angle in enumerate(around)}
    return {
        i: place[e.place("direction") % (2 * np.pi)] for i, e in enumerate(elements) if e.family in {"locus", "load"}
    }
