"""Verdict: what a diagnosis says, and nothing that it cannot say."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from model.effects import Effect, kind_of
from tpjb_ident.compare.effect_words import Estimate
from tpjb_ident.diagnosis.observations.gap import Disagreement
from tpjb_ident.diagnosis.verdict.behaviour import Behaviour, Drift
from tpjb_ident.presentation import json_data

VerdictName = Literal["consistent", "named", "ambiguous", "partly-explained", "unexplained"]


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added."""

    name: str
    parameters: dict[str, Estimate]
    stands_in: str = ""
    probability: float = 1.0  #: inclusion probability of the name, on whichever pad or direction

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
    """An explanation that was fitted."""

    name: str
    score: float
    heldout_gap: float
    parameters: dict[str, Any] = field(default_factory=dict)
    probability: float = 0.0


@dataclass(frozen=True)
class Remainder:
    """What is left on unseen points."""

    sigma: float
    share: float
    where: str
    p: float


@dataclass(frozen=True)
class Assumption:
    """A tolerance or nuisance that took part."""

    name: str
    stated: float
    fitted: float | list[float]
    unit: str
    source: str
    deviation: float = 0.0  #: standard deviations by which its farthest number is out

    @property
    def values(self) -> list[float]:
        """What was fitted, place by place."""
        return self.fitted if isinstance(self.fitted, list) else [self.fitted]


@dataclass(frozen=True)
class Verdict:
    """Result of `diagnose`; `to_json` is ``diagnosis.json`` of `outputs.md`.

    `indistinguishable` holds names of effects; where another pad or direction of the same effect would do, that is
    spelt out there.

    Examples
    --------
    >>> nothing = Remainder(sigma=1.0, share=0.0, where="", p=0.5)
    >>> verdict = Verdict("consistent", (), (), (), "", (), (), {}, {"before": 1.0, "after": 1.0}, nothing)
    >>> verdict.to_dict()["schema"], verdict.effects
    ('tpjb-diagnosis/2', ())
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
    remainder: Remainder
    behaves_like: tuple[Behaviour, ...] = ()
    drift: tuple[Drift, ...] = ()
    assumptions: tuple[Assumption, ...] = ()
    reasons: tuple[str, ...] = ()
    beforehand: tuple[str, ...] = ()  #: what measurements contradict in the bearing file, before any search

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in the contract."""
        drift = [drift.to_dict() for drift in self.drift]
        return {"schema": "tpjb-diagnosis/2", **asdict(self), "drift": drift}

    def to_json(self) -> str:
        """Serialise as JSON text; not-a-number becomes null, as JSON knows no other."""
        return json.dumps(json_data(self.to_dict()), indent=2, allow_nan=False) + "\n"

    def effects_toml(self, before: tuple[Effect, ...] = (), from_measured: bool = False) -> str:
        """Serialise as ``updated.effects.toml``, which ``predict --effects`` reads.

        Parameters
        ----------
        before : tuple of Effect
            Effects that the baseline had already; they stay in the model.
        from_measured : bool
            The baseline had measured pivots: what is found on pivots is meant beside these, and the file says so.
        """
        counted = ['counted_from = "measured pivots"'] if from_measured else []
        lines = ['schema = "tpjb-effects/1"', *counted, ""]
        for effect in before:
            lines += _table(effect.name, effect.parameters)
        for e in self.effects:
            kind = kind_of(e.name)
            ends = [f"{name}, 95 %: {p.lo:.6g} to {p.hi:.6g} {p.unit}" for name, p in e.parameters.items()]
            prior = [f"prior: {p.name} {p.low:g} to {p.high:g} {p.unit}" for p in kind.parameters]
            lines += _table(e.name, e.effect.parameters, *ends, *prior, kind.source, e.stands_in)
        return "\n".join(lines)

    def terms_toml(self, before: tuple[Effect, ...] = (), from_measured: bool = False) -> str:
        """Serialise the effects with what the rest behaves like, in the same form.

        Parameters
        ----------
        before, from_measured
            As of `effects_toml`.
        """
        lines = [self.effects_toml(before, from_measured)]
        for b in self.behaves_like:
            lines += _table(b.effect, b.parameters, b.words)
        return "\n".join(lines)


def _table(name: str, values: Mapping[str, float], *comments: str) -> list[str]:
    """One effect of an effects file, with what is said of it."""
    said = [f"# {comment}" for comment in comments if comment]
    return ["[[effects]]", f'name = "{name}"', *(f"{key} = {value!r}" for key, value in values.items()), *said, ""]
