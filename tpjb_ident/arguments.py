"""Arguments as a user gives them: a campaign or a bearing, or the path of one."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.errors import ArgumentError
from tpjb_ident.presentation import shown_by

if TYPE_CHECKING:
    from rigdata.campaign import Campaign


def as_campaign(given: Any, name: str) -> Campaign:
    """Return the campaign given, or open it.

    Parameters
    ----------
    given : Campaign, str or Path
        An object with ``runs`` counts as a campaign.
    name : str
        Of the argument, for the message.

    Raises
    ------
    ArgumentError
        Neither.
    RigDataError
        The path leads to no campaign that can be used.
    """
    if isinstance(given, (str, Path)):
        from rigdata import load_campaign

        return load_campaign(given)
    if not hasattr(given, "runs"):
        raise ArgumentError(f"{name}: must be a Campaign or the path of one, got {type(given).__name__}.")
    campaign: Campaign = given
    return campaign


def takes_paths(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let the arguments of a function that are a campaign or a bearing be paths as well.

    Parameters
    ----------
    function : callable
        Its parameters named ``campaign`` and ``bearing`` are meant.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        given = signature.bind(*args, **kwargs)
        found = given.arguments
        if "campaign" in found:
            found["campaign"] = as_campaign(found["campaign"], f"{function.__name__}: campaign")
        if "bearing" in found:
            found["bearing"] = shown_by("diagnose.from_python", "as_bearing")(found["bearing"])
        return function(*given.args, **given.kwargs)

    return wrapper
