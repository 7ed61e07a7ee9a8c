"""The registry of a prediction's conditions; a new one is one line of `conditions.toml`."""

import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rigdata.problem import Condition

_LISTED = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
#: Severity and meaning of every condition by its name, with places for pads and a number.
KINDS: dict[str, Any] = {}
for _severity, _kinds in _LISTED.items():
    for _kind, _meaning in _kinds.items():
        KINDS[_kind] = _severity, _meaning


def named(kind: str, pads: Sequence[int] = (), number: float | str = 0.0) -> Condition:
    """Name a condition: pads count from 1."""
    severity, detail = KINDS[kind]
    joint = " and " if kind in ("pads {pads} overlap", "pads {pads} touch") else ", "
    places = {"pads": joint.join(map(str, pads)), "number": number}
    return Condition(kind.format(**places), severity, detail.format(**places), tuple(pads))


def conditions_of(table: Iterable[tuple[Any, ...]]) -> tuple[Condition, ...]:
    """Name what holds of a table: of every line whether it does, and what `named` takes."""
    return tuple(named(*words) for holds, *words in table if holds)


def pads_of(kind: str, conditions: Iterable[Condition]) -> tuple[int, ...]:
    """Pads (from 1) that conditions of a kind name."""
    start, _, end = kind.partition("{pads}")
    pads: tuple[int, ...] = ()
    for condition in conditions:
        if condition.startswith(start) and condition.endswith(end):
            pads += condition.pads
    return pads


def has_answer(conditions: Iterable[Condition]) -> bool:
    """Whether a result with these conditions has numbers: none of them is an error."""
    return all(condition.severity != "error" for condition in conditions)
