"""Named conditions: what a prediction has to say about itself besides its numbers."""

from __future__ import annotations

from collections.abc import Iterable

from rigdata.problem import Severity


class Condition(str):
    """A short name that compares and prints like a string, and knows how much it matters."""

    __slots__ = ("detail", "pads", "severity")
    severity: Severity
    detail: str
    pads: tuple[int, ...]

    def __new__(cls, name: str, severity: Severity, detail: str = "", pads: tuple[int, ...] = ()) -> Condition:
        """Make a condition from its name, its weight, its sentence and its pads."""
        condition = super().__new__(cls, name)
        condition.severity, condition.detail, condition.pads = severity, detail, pads
        return condition

    def __reduce__(self) -> tuple[type[Condition], tuple[str, Severity, str, tuple[int, ...]]]:
        return Condition, (str(self), self.severity, self.detail, self.pads)

    def sentence(self) -> str:
        """Name and detail in one line."""
        return f"{self!s}: {self.detail}" if self.detail else str(self)


def has_answer(conditions: Iterable[Condition]) -> bool:
    """Whether a result with these conditions has numbers: none of them is an error."""
    return all(condition.severity != "error" for condition in conditions)
