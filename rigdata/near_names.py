"""The nearest known name to one that nobody knows: every refusal of a name says what may have been meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest_name(name: object, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of the `known` names that looks most like `name`; None where none does.

    Parameters
    ----------
    name : object
        As given by the user; its text counts, of which no more than 60 characters are looked at.
    known : iterable of str
    cutoff : float
        Likeness from 0 to 1 (`difflib.SequenceMatcher.ratio`) below which nothing is near.
    """
    close = difflib.get_close_matches(str(name)[:60], list(known), n=1, cutoff=cutoff)
    return close[0] if close else None


def unknown_name(what: str, name: object, known: Iterable[str]) -> str:
    """The refusal of a name that a registry does not hold, with the nearest one and all there are.

    Parameters
    ----------
    what : str
        Kind of thing that the name is for.
    name : object
        As given.
    known : iterable of str
    """
    names = list(known)
    near = nearest_name(name, names)
    hint = f"; did you mean {near!r}?" if near else ""
    return f"unknown {what} {name!r}{hint} Known: {', '.join(names)}"
