"""Named conditions: what a prediction has to say about itself besides its numbers."""

from __future__ import annotations

from collections.abc import Iterable

from rigdata.problem import Condition


def has_answer(conditions: Iterable[Condition]) -> bool:
    """Whether a result with these conditions has numbers: none of them is an error."""
    return all(condition.severity != "error" for condition in conditions)
