"""Named conditions: what a result has to say about itself besides its numbers."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any, Self, get_args

from rigdata import problem
from tpjb_ident.condition_kinds import KINDS, condition_kind

#: How grave a condition or a finding can be, the gravest first.
SEVERITIES = get_args(problem.Severity)


class Condition(problem.Condition):
    """A name of the registry, with its severity there and a sentence on what was found."""

    __slots__ = ()

    def __new__(cls, name: str, detail: str = "") -> Self:
        """Make a condition from its name and its sentence."""
        kind = condition_kind(name)
        return super().__new__(cls, kind.name, kind.severity, detail)

    def __reduce__(self) -> tuple[Any, ...]:
        return Condition, (str(self), self.detail)

    @property
    def meaning(self) -> str:
        """What it means to the reader, and what to do."""
        return condition_kind(self).meaning


def merged(*groups: tuple[Condition, ...]) -> tuple[Condition, ...]:
    """Conditions of several steps in order, each name once (the first detail counts)."""
    return tuple(dict.fromkeys(itertools.chain(*groups)))


def holding(*rows: tuple[object, str, str]) -> tuple[Condition, ...]:
    """Conditions from rows of test, name and sentence: those whose test holds."""
    return tuple(Condition(name, detail) for test, name, detail in rows if test)


def untrusted(conditions: Iterable[Condition]) -> tuple[Condition, ...]:
    """Those that forbid trust in the number that they belong to: a command that has one ends with exit code 3."""
    return tuple(condition for condition in conditions if condition.severity == "error")


def sentences(conditions: Iterable[Condition]) -> tuple[str, ...]:
    """Every condition as one line, name and detail."""
    return tuple(map(Condition.sentence, conditions))


def errors_in(quality: object) -> list[str]:
    """Names in a cell of a column `quality` that forbid trust in its row."""
    return [name for name in str(quality).split("; ") if name in KINDS and KINDS[name].severity == "error"]
