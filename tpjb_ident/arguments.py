"""Arguments as a user gives them: a campaign, or the path of one."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.errors import ArgumentError

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
    """Let the first argument of a function, a campaign, be a path as well.

    Parameters
    ----------
    function : callable
    """

    @functools.wraps(function)
    def wrapper(campaign: Any, *args: Any, **kwargs: Any) -> Any:
        return function(as_campaign(campaign, f"{function.__name__}: campaign"), *args, **kwargs)

    return wrapper
