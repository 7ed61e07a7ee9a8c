"""Verdict: what a diagnosis says, and nothing that it cannot say."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, Literal

from model.effects import Effect, kind_of

VerdictName = Literal["consistent", "named", "ambiguous", "unexplained"]


@dataclass(frozen=True)
class FoundParameter:
    """A fitted parameter with its 95 % interval, SI."""

    value: float
    lo: float
    hi: float
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added.

    Attributes
    ----------
    name : str
    probability : float
        Among the explanations that were fitted.
    parameters : dict of str to FoundParameter
    """

    name: str
    probability: float
    parameters: dict[str, FoundParameter]

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in the contract."""
        parameters = {k: vars(p) for k, p in self.parameters.items()}
        return {"name": self.name, "probability": self.probability, "parameters": parameters}

    @property
    def label(self) -> str:
        """Name with the parameters that are no amplitude: ``soft_pivot pad 5``."""
        return " ".join([self.name, *(f"{k} {p.value:g}" for k, p in self.parameters.items() if p.lo == p.hi)])

    @property
    def effect(self) -> Effect:
        """The effect itself."""
        return Effect(self.name, **{k: p.value for k, p in self.parameters.items()})


@dataclass(frozen=True)
class RankedCandidate:
    """An explanation that was fitted: effects, chi-square per element, held-out gap."""

    name: str
    score: float
    heldout_gap: float


@dataclass(frozen=True)
class Disagreement:
    """Where measurement and baseline part.

    Attributes
    ----------
    observable, where : str
    size_sigma : float
        Root mean square there.
    share : float
        Of the whole squared gap.
    """

    observable: str
    where: str
    size_sigma: float
    share: float


@dataclass(frozen=True)
class Verdict:
    """Result of `diagnose`; `to_json` is ``diagnosis.json`` of `outputs.md`.

    `indistinguishable` holds names of effects; where another pad or direction of the same effect would do, that is
    spelt out there. `alternatives` holds the same groups with every pad and direction spelt out, likeliest first.
    """

    verdict: VerdictName
    effects: tuple[FoundEffect, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    below_floor: tuple[str, ...]
    next_test: str
    candidates: tuple[RankedCandidate, ...]
    disagreement: tuple[Disagreement, ...]
    gap_by_observable: dict[str, dict[str, float]]
    gap: dict[str, float]
    reasons: tuple[str, ...] = ()
    alternatives: tuple[tuple[str, ...], ...] = ()
    notes: dict[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, in the order of the contract."""
        return {
            "schema": "tpjb-diagnosis/1",
            "verdict": self.verdict,
            "effects": [
                {
                    "name": e.name,
                    "probability": e.probability,
                    "parameters": {k: vars(p) for k, p in e.parameters.items()},
                }
                for e in self.effects
            ],
            "indistinguishable": [list(group) for group in self.indistinguishable],
            "below_floor": list(self.below_floor),
            "next_test": self.next_test,
            "candidates": [vars(c) for c in self.candidates],
            "disagreement": [vars(d) for d in self.disagreement],
            "gap_by_observable": self.gap_by_observable,
            "gap": self.gap,
            "reasons": list(self.reasons),
            "alternatives": [list(group) for group in self.alternatives],
            **self.notes,
        }

    def to_json(self) -> str:
        """Serialise as JSON text; not-a-number becomes null, as JSON knows no other."""
        return json.dumps(_plain(self.to_dict()), indent=2, allow_nan=False) + "\n"

    def effects_toml(self, before: tuple[Effect, ...] = ()) -> str:
        """Serialise as ``updated.effects.toml``, which ``predict --effects`` reads.

        Parameters
        ----------
        before : tuple of Effect
            Effects that the baseline had already; they stay in the model.
        """
        lines = ['schema = "tpjb-effects/1"', ""]
        for known in before:
            values = [f"{k} = {v!r}" for k, v in known.parameters.items()]
            lines += ["[[effects]]", f'name = "{known.name}"', *values, ""]
        for e in self.effects:
            kind = kind_of(e.name)
            lines += ["[[effects]]", f'name = "{e.name}"']
            lines += [f"{k} = {p.value!r}  # 95 %: {p.lo:.6g} to {p.hi:.6g} {p.unit}" for k, p in e.parameters.items()]
            lines += [f"# prior: {p.name} {p.low:g} to {p.high:g} {p.unit}" for p in kind.parameters]
            lines += [f"# {kind.source}", ""]
        return "\n".join(lines)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float) or hasattr(value, "dtype"):
        number = value.item() if hasattr(value, "item") else value
        return number if not isinstance(number, float) or math.isfinite(number) else None
    return value
