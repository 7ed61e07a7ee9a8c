"""Named conditions: what a result has to say about itself besides its numbers."""

from __future__ import annotations

from collections.abc import Iterable

from rigdata.problem import Severity
from tpjb_ident.condition_kinds import condition_kind


class Condition(str):
    """A name of the registry that compares like a string, with a sentence on what was found."""

    __slots__ = ("detail",)
    detail: str

    def __new__(cls, name: str, detail: str = "") -> Condition:
        """Make a condition from its name and its sentence."""
        condition = super().__new__(cls, condition_kind(name).name)
        condition.detail = detail
        return condition

    def __reduce__(self) -> tuple[type[Condition], tuple[str, str]]:
        return Condition, (str(self), self.detail)

    @property
    def severity(self) -> Severity:
        """How grave it is: "error" forbids trust, "warning" needs a look, "note" is for information."""
        return condition_kind(self).severity

    @property
    def meaning(self) -> str:
        """What it means to the reader, and what to do."""
        return condition_kind(self).meaning

    def sentence(self) -> str:
        """Name and detail in one line."""
        return f"{self!s}: {self.detail}" if self.detail else str(self)


def merged(*groups: tuple[Condition, ...]) -> tuple[Condition, ...]:
    """Conditions of several steps in order, each name once (the first detail counts)."""
    seen: dict[str, Condition] = {}
    for group in groups:
        for condition in group:
            seen.setdefault(str(condition), condition)
    return tuple(seen.values())


def untrusted(conditions: Iterable[Condition]) -> tuple[Condition, ...]:
    """Those that forbid trust in the number that they belong to: a command that has one ends with exit code 3."""
    return tuple(condition for condition in conditions if condition.severity == "error")


def sentences(conditions: Iterable[Condition]) -> tuple[str, ...]:
    """Every condition as one line, name and detail."""
    return tuple(condition.sentence() for condition in conditions)
