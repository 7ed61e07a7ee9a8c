"""Arguments as a user gives them: a campaign or a bearing, or the path of one."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.errors import ArgumentError

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign


def as_campaign(given: Any, name: str) -> Campaign:
    """Return the campaign given, or open it."""
    if isinstance(given, (str, Path)):
        from rigdata import load_campaign

        return load_campaign(given)
    if not hasattr(given, "runs"):
        raise ArgumentError(f"{name}: must be a Campaign or the path of one, got {type(given).__name__}.")
    campaign: Campaign = given
    return campaign


def as_bearing(given: Any, name: str) -> Bearing:
    """Return the bearing given, or read its file."""
    from model.bearing import Bearing
    from model.bearing_file import load_bearing

    if isinstance(given, Bearing):
        return given
    if isinstance(given, (str, Path)):
        return load_bearing(given)
    raise ArgumentError(f"{name}: must be a Bearing or the path of a bearing file, got {type(given).__name__}.")


def _path(given: Any, name: str) -> Any:
    if not isinstance(given, (str, os.PathLike)):
        raise ArgumentError(f"{name}: must be a path, got {type(given).__name__}.")
    return given


def _folder(given: Any, name: str) -> Path:
    return Path(_path(given, name))


def _curves(given: Any, name: str) -> Any:
    curves = tuple(given) if isinstance(given, Iterable) else (given,)
    for one in curves:
        if not hasattr(one, "stiffness_band"):
            raise ArgumentError(f"{name}: must hold what fit_pivots gives, got {type(one).__name__}.")
    return curves


def _comparison(given: Any, name: str) -> Any:
    if not hasattr(given, "variants"):
        raise ArgumentError(f"{name}: must be what compare_campaign gives, got {type(given).__name__}.")
    return given


#: What arguments of these names may be.
_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    "campaign": as_campaign, "bearing": as_bearing, "source": _path, "path": _path, "folder": _folder,
    "curves": _curves, "comparison": _comparison,
}  # fmt: skip


def checked(function: Callable[..., Any], called: str, names: str) -> Callable[..., Any]:
    """Let a function take paths for a campaign or a bearing, and refuse in our own words what it cannot take."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        given = signature.bind(*args, **kwargs)
        for name in names.split():
            if name in given.arguments:
                given.arguments[name] = _CHECKS[name](given.arguments[name], f"{called}: {name}")
        return function(*given.args, **given.kwargs)

    return wrapper
