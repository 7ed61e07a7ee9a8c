"""What to say to a name that is not known: the nearest one, or all there are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from model.errors import OptionError


def hint(name: object, known: Iterable[str], all_of: str = "Known:") -> str:
    """Say which known name may have been meant."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1) if isinstance(name, str) else []
    return f"Did you mean {near[0]!r}?" if near else f"{all_of} {', '.join(names)}."


def check_known(what: str, name: object, known: Iterable[str]) -> None:
    """Refuse an option's value that there is not."""
    names = list(known)
    if name not in names:
        raise OptionError(f"{what} must be one of {', '.join(names)}, got {name!r}. {hint(name, names, 'Use one of')}")
