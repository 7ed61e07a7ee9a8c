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
from tpjb_ident.diagnosis.forward.candidates import TERMS, Candidate, candidates
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import at_baseline
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Element, Layout, Observations, named, places
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
            return Deciding.visible * np.array([c.steps[0] for c in self.candidates]) / self.detectable

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
            distances = zip(self.candidates, self.separation[i], strict=True)
            like = [candidate.label for candidate, distance in distances if distance < Deciding.visible]
            end, (low,), (high,) = c.neutral + self.floor[i], *c.limits
            rows.append(
                {
                    "effect": c.label,
                    "parameter": c.parameter.name,
                    "unit": c.parameter.unit,
                    "typical_size_sigma": self.detectable[i],
                    "seen_from": c.parameter.from_linear(end) if low <= end <= min(high, 1e300) else np.nan,
                    "mistaken_for": ", ".join(like),
                }
            )
        return pd.DataFrame(rows)


def plan(setup: Setup, layout: Layout) -> CampaignPlan:
    """Work out what a layout of tests could tell."""
    return _shown(setup, layout).by()


@dataclass(frozen=True)
class _Signatures:
    """What every candidate does to the observation vector of a layout, beside what hides it."""

    observations: Observations
    candidates: tuple[Candidate, ...]
    nuisances: FloatArray = field(repr=False)  #: (n, m): columns per standard deviation
    columns: FloatArray = field(repr=False)  #: (n, k): change by a typical size of every candidate

    def by(self, rows: BoolArray | slice = slice(None), free: bool = True) -> CampaignPlan:
        """Sizes and separations by some elements, all by default, with or without nuisances."""
        factor = usual_factor(self.observations, self.nuisances if free else self.nuisances[:, :0])
        # rows of a Cholesky factor have the covariance of those elements
        lower = np.asarray(np.linalg.qr(factor[rows].T, mode="r")).T
        white = np.asarray(np.linalg.solve(lower, self.columns[rows]))
        distance = separations(white)
        np.fill_diagonal(distance, np.nan)
        return CampaignPlan(self.candidates, np.linalg.norm(white, axis=0), distance)


def _shown(setup: Setup, layout: Layout) -> _Signatures:
    """Work out the signature of every candidate on a layout."""
    chosen = tuple(c for c in candidates(setup) if len(c.steps) == 1 and c.name not in TERMS)
    observations = planned_observations(setup, layout)
    forward = Forward(setup, layout, observations.elements)
    base = forward()
    free = at_baseline(forward, (), setup, Tolerances(), base)
    columns = [_signature(forward, base, c) for c in chosen]
    return _Signatures(observations, chosen, free, np.column_stack(columns))


def _signature(forward: Forward, base: FloatArray, candidate: Candidate) -> FloatArray:
    """Change by a typical size, from half of it; zero where the model has no equilibrium on either side."""
    (low,), (high,) = candidate.limits
    (step,), neutral = candidate.steps, candidate.neutral
    for share in (0.5, -0.5, 0.05, -0.05):
        value = min(max(neutral + share * step, low), high)
        if value == neutral:
            continue
        try:
            moved = forward.fresh()((candidate.effect(value),)) - base
        except NoEquilibriumError:
            continue
        return np.asarray(moved / (value - neutral) * step)
    return np.zeros_like(base)


_DIRECT = ["kxx", "kyy", "cxx", "cyy"]
#: Second speed of data set E over the planned one.
_FASTER = 1.5


def data_sets(setup: Setup, layout: Layout) -> tuple[pd.DataFrame, dict[str, CampaignPlan]]:
    """Work out what every data set sees at typical sizes and mixes up at d' = 6; plans have free nuisances."""
    import pandas as pd

    faster = tuple(replace(t, speed=_FASTER * t.speed) for t in layout.dynamic)
    shown = _shown(setup, replace(layout, dynamic=(*layout.dynamic, *faster)))
    masks = _masks(shown.observations.elements, [t.speed for t in layout.dynamic])
    rows, plans = [], {}
    count = len(shown.candidates)
    for name, mask in masks.items():
        row = {"data_set": name, "numbers": int(mask.sum())}
        for words, free in (("known", False), ("free", True)):
            part = plans[name] = shown.by(mask, free)
            row[f"detectable_nuisances_{words}"] = count - len(part.below_floor)
            row[f"confusable_pairs_nuisances_{words}"] = len(part.confusable)
            row["pairs"] = count * (count - 1) // 2
        rows.append({**row, "mixed_up": "; ".join(" / ".join(pair) for pair in part.confusable)})
    return pd.DataFrame(rows), plans


def _masks(elements: Sequence[Element], planned: Sequence[float]) -> dict[str, BoolArray]:
    """Elements of every data set."""
    family, line, speed = named(elements, "family"), places(elements, "excitation"), places(elements, "speed")
    first = ~np.isfinite(speed) | np.isin(speed, planned)
    # the frequency that is there at the most loads, the middle one among equals
    frequencies, counts = np.unique(line[np.isfinite(line)], return_counts=True)
    usual = frequencies[counts == counts.max()]
    return {
        "A": first & np.isin(named(elements, "observable"), _DIRECT) & (line == usual[len(usual) // 2]),
        "B": first & (family == "h"),
        "C": first & ~np.isin(family, ["dry", "temperature"]),
        "D": first,
        "E": np.ones(len(elements), dtype=bool),
    }
