"""The registry of a prediction's conditions: every name that it may say of itself, how grave it is, what it means.

A new condition is one line here, and its row in docs/model.md says what to do.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rigdata.problem import Condition, Severity

_LISTED: dict[Severity, dict[str, str]] = {
    "error": {
        "not converged": "no equilibrium was found, and there are no coefficients",
        "film lost": "a film closed on the way: too much load, or too much heat",
        "heat without bounds": "the film's heat is beyond any number that means something",
        "heat runs away": "journal and films find rest with up to {number:.0f} % of the heat they make, not with more",
        "singular": "a Newton step has no solution",
        "no pads against the load": "no set of pivots can balance the load, wherever the journal goes",
        "no set of pads finds rest": "no two pads or more carry the load and keep it: it falls on one pad, or jumps",
        "pads {pads} can neither carry nor idle": "idle they take up load at once, carrying they push the journal off",
        "pads {pads} neither stick nor slide at rest": "friction holds them where their film loses its load, and "
        "without load there is no friction",
    },
    "warning": {
        "nothing holds the journal across its load": "all pads that carry push along one line: kxx or kyy is zero",
        "flow back at a leading edge": "a pressure peak pushes oil back; the heat balance there is limited",
        "overloaded pads {pads}": "thinnest film, pressure or heat beyond {number}",
        "film not laminar: Re {number:.0f}": "turbulence, which is off unless asked for, carries and heats",
        "oil beyond its data: {number:.0f} degC": "mu(T) of Eq. (4) holds from 20 to 120 degC",
        "interference: no clearance at pads {pads}": "a concentric journal would touch them",
        "pads {pads} are short of oil": "they ask for more than the grooves give, {number}",
        "pads {pads} overlap": "no room for oil to enter",
        "pads {pads} touch": "no room for oil to enter",
    },
    "note": {
        "idle pads {pads}": "they carry nothing and take no part in the dynamics",
        "pads {pads} cannot keep their load": "carrying, they would push the journal off; or friction, or want of oil",
        "pads {pads} stand concentric": "without load, their films take part in the dynamics",
        "pads {pads} on the edge of carrying": "a finer mesh may let them carry or idle",
        "another equilibrium exists": "in it pads {pads} idle; this one leaves the last pads idle",
        "pivot friction holds pads {pads}": "they tilt against the contact's stiffness",
        "vibration of {number:g} um breaks the pivots of pads {pads} loose": "they tilt against sliding friction",
    },
}
#: Every condition by its name, with places for pads and a number.
KINDS = {name: (severity, detail) for severity, kinds in _LISTED.items() for name, detail in kinds.items()}


def named(kind: str, pads: Sequence[int] = (), number: float | str = 0.0) -> Condition:
    """Name a condition: pads count from 1."""
    severity, detail = KINDS[kind]
    joint = " and " if kind in ("pads {pads} overlap", "pads {pads} touch") else ", "
    listed = joint.join(map(str, pads))
    words = (text.format(pads=listed, number=number) for text in (kind, detail))
    return Condition(next(words), severity, next(words), tuple(pads))


def pads_of(kind: str, conditions: Iterable[Condition]) -> tuple[int, ...]:
    """Pads (from 1) that conditions of a kind name."""
    start, _, end = kind.partition("{pads}")
    return tuple(pad for c in conditions if c.startswith(start) and c.endswith(end) for pad in c.pads)


def has_answer(conditions: Iterable[Condition]) -> bool:
    """Whether a result with these conditions has numbers: none of them is an error."""
    return all(condition.severity != "error" for condition in conditions)
