"""Plan: what a campaign could and could not tell, before it is run.

Detection floor per effect (the size at which it stands three standard deviations out of noise, tolerance and
nuisances) and the isolability matrix: how far effect A, at a size seen with d' = 6, stays from everything that B
can imitate, d_AB = 6 |(I - P_B) s_A| / |s_A|. Below 3 the two are confusable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from model.setup import Setup
from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.comparison.scores import separations
from tpjb_ident.diagnosis.forward.candidates import Candidate, one_amplitude
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import at_baseline
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Element, Layout, Observations
from tpjb_ident.diagnosis.planned import planned_observations
from tpjb_ident.presentation import json_data

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class CampaignPlan:
    """What a layout can tell."""

    candidates: tuple[Candidate, ...]
    detectable: FloatArray = field(repr=False)  #: (k,): whitened size of every candidate's typical step
    separation: FloatArray = field(repr=False)  #: (k, k)

    @property
    def floor(self) -> FloatArray:
        """Smallest change of every parameter that would be seen (3 standard deviations), in its nearly linear form."""
        with np.errstate(divide="ignore"):  # what cannot be detected has an infinite floor
            return Deciding.visible * np.array([c.step for c in self.candidates]) / self.detectable

    @property
    def confusable(self) -> tuple[tuple[str, str], ...]:
        """Pairs that the campaign could not tell apart."""
        alike = np.minimum(self.separation, self.separation.T) < Deciding.visible
        labels = [c.label for c in self.candidates]
        return tuple((labels[i], labels[j]) for i, j in np.argwhere(np.triu(alike)))

    @property
    def pairs(self) -> int:
        """Pairs of candidates that have an effect at all."""
        n = int(np.sum(self.detectable > 0.0))
        return n * (n - 1) // 2

    @property
    def below_floor(self) -> tuple[str, ...]:
        """Effects that this campaign would not see at their typical size."""
        return tuple(c.label for c, d in zip(self.candidates, self.detectable, strict=True) if d < Deciding.visible)

    def matrix(self) -> pd.DataFrame:
        """Isolability matrix: row A at d' = 6 against everything that column B can imitate, in standard deviations."""
        import pandas as pd

        labels = [c.label for c in self.candidates]
        frame = pd.DataFrame(self.separation, columns=labels)
        frame.insert(0, "effect", labels)
        return frame

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``plan.json``."""
        return {
            "schema": "tpjb-plan/1",
            "effects": json_data(self.to_frame().to_dict("records")),
            "below_floor": list(self.below_floor),
            "confusable": [list(pair) for pair in self.confusable],
            "pairs": self.pairs,
        }

    def to_frame(self) -> pd.DataFrame:
        """One row per effect: detection floor and what it could be mistaken for."""
        import pandas as pd

        rows = []
        for i, c in enumerate(self.candidates):
            apart = zip(self.candidates, self.separation[i], strict=True)
            like = [other.label for other, distance in apart if distance < Deciding.visible]
            at = c.parameter.from_linear(c.neutral + self.floor[i]) if np.isfinite(self.floor[i]) else np.nan
            rows.append(
                {
                    "effect": c.label,
                    "parameter": c.parameter.name,
                    "unit": c.parameter.unit,
                    "typical_size_sigma": self.detectable[i],
                    "seen_from": at if c.bounds[0] <= c.neutral + self.floor[i] <= c.bounds[1] else np.nan,
                    "mistaken_for": ", ".join(like),
                }
            )
        return pd.DataFrame(rows)


def plan(setup: Setup, layout: Layout, pool: Sequence[Candidate] | None = None) -> CampaignPlan:
    """Work out what a layout of tests could tell."""
    return _shown(setup, layout, pool).by()


@dataclass(frozen=True)
class _Signatures:
    """What every candidate does to the observation vector of a layout, beside what hides it."""

    observations: Observations
    candidates: tuple[Candidate, ...]
    nuisances: FloatArray = field(repr=False)  #: (n, m): columns per standard deviation
    columns: FloatArray = field(repr=False)  #: (n, k): change by a typical size of every candidate

    def by(self, rows: BoolArray | None = None, free: bool = True) -> CampaignPlan:
        """Sizes and separations by some elements, all by default, with or without nuisances."""
        mine = slice(None) if rows is None else rows
        factor = usual_factor(self.observations, self.nuisances if free else self.nuisances[:, :0])
        # rows of a Cholesky factor have the covariance of those elements
        lower = np.asarray(np.linalg.qr(factor[mine].T, mode="r")).T
        return separated(self.candidates, np.asarray(np.linalg.solve(lower, self.columns[mine])))


def _shown(setup: Setup, layout: Layout, pool: Sequence[Candidate] | None = None) -> _Signatures:
    """Work out the signature of every candidate on a layout."""
    chosen = tuple(pool if pool is not None else one_amplitude(setup.bearing))
    observations = planned_observations(setup, layout)
    forward = Forward(setup, layout, observations.elements)
    base = forward()
    free = at_baseline(forward, (), setup, Tolerances(), base)
    columns = [_signature(forward, base, c) for c in chosen]
    return _Signatures(observations, chosen, free, np.column_stack(columns))


def _signature(forward: Forward, base: FloatArray, candidate: Candidate) -> FloatArray:
    """Change by a typical size, from half of it; zero where the model has no equilibrium on either side."""
    low, high = candidate.bounds
    for share in (0.5, -0.5, 0.05, -0.05):
        value = min(max(candidate.neutral + share * candidate.step, low), high)
        if value == candidate.neutral:
            continue
        try:
            moved = forward.fresh()((candidate.effect(value),)) - base
        except NoEquilibriumError:
            continue
        return np.asarray(moved / (value - candidate.neutral) * candidate.step)
    return np.zeros_like(base)


def separated(chosen: Sequence[Candidate], white: FloatArray) -> CampaignPlan:
    """Sizes and separations of whitened signatures (n, k)."""
    apart = separations(white)
    np.fill_diagonal(apart, np.nan)
    return CampaignPlan(tuple(chosen), np.linalg.norm(white, axis=0), apart)


_DIRECT = frozenset({"kxx", "kyy", "cxx", "cyy"})
_FAMILIES = {
    "B": frozenset({"h"}),
    "C": frozenset({"h", "locus", "load", "clearance"}),
    "D": frozenset({"h", "locus", "load", "clearance", "dry", "temperature"}),
}
#: Second speed of data set E over the planned one.
_FASTER = 1.5


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
        for words, labels in (("known", self.known), ("free", self.free)):
            row |= {
                f"detectable_nuisances_{words}": k - len(labels.below_floor),
                f"confusable_pairs_nuisances_{words}": len(labels.confusable), "pairs": k * (k - 1) // 2,
            }  # fmt: skip
        return {**row, "mixed_up": "; ".join(" / ".join(pair) for pair in self.free.confusable)}


def data_sets(setup: Setup, layout: Layout) -> tuple[DataSet, ...]:
    """Work out what every data set sees at typical sizes and mixes up at d' = 6, nuisances known and free."""
    faster = tuple(replace(t, speed=_FASTER * t.speed) for t in layout.dynamic)
    shown = _shown(setup, replace(layout, dynamic=(*layout.dynamic, *faster)))
    planned = {t.speed for t in layout.dynamic}
    return tuple(
        DataSet(name, int(mask.sum()), shown.by(mask, free=False), shown.by(mask))
        for name, mask in _masks(shown.observations.elements, planned).items()
    )


def _masks(elements: Sequence[Element], planned: set[float]) -> dict[str, BoolArray]:
    """Elements of every data set."""
    families = np.array([e.family for e in elements])
    first = np.array([not np.isfinite(e.place("speed")) or e.place("speed") in planned for e in elements])
    line = np.array([e.place("excitation") for e in elements])
    # the frequency that is there at the most loads, the middle one among equals
    frequencies, counts = np.unique(line[np.isfinite(line)], return_counts=True)
    usual = frequencies[counts == counts.max()]
    usual_line = line == usual[len(usual) // 2]
    direct = np.array([e.observable in _DIRECT for e in elements])
    masks = {"A": direct & usual_line & first}
    masks |= {name: np.isin(families, sorted(families_used)) & first for name, families_used in _FAMILIES.items()}
    return {**masks, "E": np.ones(len(elements), dtype=bool)}
