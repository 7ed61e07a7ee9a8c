"""Data sets: what a campaign could tell if only a part of it were there.

A  direct coefficients against load at one frequency (what papers show)
B  all entries of h against load and frequency
C  B with locus, load readings and clearance polygon
D  C with dry tests and pad temperatures: everything that was planned
E  D with a second shaft speed
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from model.setup import Setup
from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.forward.candidates import Candidate, one_amplitude
from tpjb_ident.diagnosis.observations.layout import Layout
from tpjb_ident.diagnosis.observations.observe import Element
from tpjb_ident.diagnosis.plan.plan import CampaignPlan, Signatures, separated, signatures

DIRECT = frozenset({"kxx", "kyy", "cxx", "cyy"})
FAMILIES = {
    "B": frozenset({"h"}),
    "C": frozenset({"h", "locus", "load", "clearance"}),
    "D": frozenset({"h", "locus", "load", "clearance", "dry", "temperature"}),
}
#: Second speed of data set E over the planned one.
FASTER = 1.5


@dataclass(frozen=True)
class DataSet:
    """What one part of a campaign could tell."""

    name: str
    numbers: int
    known: CampaignPlan = field(repr=False)
    free: CampaignPlan = field(repr=False)

    def to_row(self) -> dict[str, object]:
        """Counts, flat."""
        row: dict[str, object] = {"data_set": self.name, "numbers": self.numbers}
        k = len(self.known.candidates)
        for words, told in (("known", self.known), ("free", self.free)):
            row |= {
                f"detectable_nuisances_{words}": k - len(told.below_floor),
                f"confusable_pairs_nuisances_{words}": len(told.confusable), "pairs": k * (k - 1) // 2,
            }  # fmt: skip
        return {**row, "mixed_up": "; ".join(" / ".join(pair) for pair in self.free.confusable)}


def data_sets(setup: Setup, layout: Layout) -> tuple[DataSet, ...]:
    """Work out what every data set sees at typical sizes and mixes up at d' = 6, nuisances known and free."""
    faster = tuple(replace(t, speed=FASTER * t.speed) for t in layout.dynamic)
    chosen = one_amplitude(setup.bearing)
    seen = signatures(setup, replace(layout, dynamic=(*layout.dynamic, *faster)), chosen)
    planned = {t.speed for t in layout.dynamic}
    return tuple(
        DataSet(name, int(mine.sum()), *(_told(seen, mine, chosen, free) for free in (False, True)))
        for name, mine in masks(seen.observations.elements, planned).items()
    )


def _told(seen: Signatures, mine: BoolArray, chosen: Sequence[Candidate], free: bool) -> CampaignPlan:
    """Sizes and separations by a part of the elements."""
    factor = seen.factor(free)
    part = (factor @ factor.T)[np.ix_(mine, mine)]
    scale = np.sqrt(np.diag(part))
    whole = np.linalg.cholesky(part / np.outer(scale, scale))
    return separated(chosen, np.asarray(np.linalg.solve(whole, seen.columns[mine] / scale[:, None])))


def masks(elements: Sequence[Element], planned: set[float]) -> dict[str, BoolArray]:
    """Elements of every data set."""
    families = np.array([e.family for e in elements])
    first = np.array([not np.isfinite(e.place("speed")) or e.place("speed") in planned for e in elements])
    line = np.array([e.place("excitation") for e in elements])
    one = line == _usual(line[np.isfinite(line)])
    direct = np.array([e.observable in DIRECT for e in elements])
    masks = {"A": direct & one & first}
    masks |= {name: np.isin(families, sorted(kept)) & first for name, kept in FAMILIES.items()}
    return {**masks, "E": np.ones(len(elements), dtype=bool)}


def _usual(lines: FloatArray) -> float:
    """The frequency that is there at the most loads, the middle one among equals."""
    found, counts = np.unique(lines, return_counts=True)
    most = found[counts == counts.max()]
    return float(most[len(most) // 2])
