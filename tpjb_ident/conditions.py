"""Named conditions: what a result has to say about itself besides its numbers."""

from __future__ import annotations


class Condition(str):
    """A short name that compares like a string, with a sentence that explains it.

    Parameters
    ----------
    name : str
        The name by which scripts test for it, e.g. ``"iteration-limit" in est.status``.
    detail : str
        What was found, with its figure and the limit.
    """

    __slots__ = ("detail",)
    detail: str

    def __new__(cls, name: str, detail: str = "") -> Condition:
        """Make a condition from its name and its sentence."""
        condition = super().__new__(cls, name)
        condition.detail = detail
        return condition

    def __reduce__(self) -> tuple[type[Condition], tuple[str, str]]:
        return Condition, (str(self), self.detail)

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
