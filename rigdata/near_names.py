"""The nearest known name to one that nobody knows: every refusal of a name says what may have been meant."""

import difflib
from collections.abc import Iterable


def nearest_name(name: object, choices: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of the `known` names that looks most like `name`; None where none does."""
    close = difflib.get_close_matches(str(name)[:60], list(choices), n=1, cutoff=cutoff)
    return close[0] if close else None


def hint(name: object, choices: Iterable[str], listed: str = "Known:", cutoff: float = 0.6) -> str:
    """The name that may have been meant as a question, or all that there are."""
    names = list(choices)
    near = nearest_name(name, names, cutoff)
    return f"Did you mean {near!r}?" if near else f"{listed} {', '.join(names)}"


def unknown_name(kind: str, name: object, choices: Iterable[str]) -> str:
    """The refusal of a name that a registry does not hold, with the nearest one, or all there are."""
    return f"unknown {kind} {name!r}. {hint(name, choices)}"
