"""Arguments as a user gives them: a campaign or a bearing, or the path of one."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import os
import warnings
from collections.abc import Callable, Iterable
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.errors import ArgumentError, BadInputError

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign


def _required(fits: bool, value: Any, name: str, expected: str) -> Any:
    """The value of an argument, where it is what it must be."""
    if not fits:
        raise ArgumentError(f"{name}: must {expected}, got {type(value).__name__}.")
    return value


def as_campaign(value: Any, name: str) -> Campaign:
    """Return the campaign given, or open it."""
    if isinstance(value, (str, Path)):
        from rigdata import load_campaign

        return load_campaign(value)
    campaign: Campaign = _required(hasattr(value, "runs"), value, name, "be a Campaign or the path of one")
    return campaign


def as_bearing(value: Any, name: str) -> Bearing:
    """Return the bearing given, or read its file."""
    from model.bearing import Bearing
    from model.bearing_file import load_bearing

    if isinstance(value, (str, Path)):
        return load_bearing(value)
    bearing: Bearing = _required(isinstance(value, Bearing), value, name, "be a Bearing or the path of a bearing file")
    return bearing


def _path(value: Any, name: str) -> Any:
    return _required(isinstance(value, (str, os.PathLike)), value, name, "be a path")


def _each(fits: Callable[[Any], bool], expected: str) -> Callable[[Any, str], Any]:
    """Make the check of an argument that holds several."""

    def check(value: Any, name: str) -> Any:
        items = tuple(value) if isinstance(value, Iterable) else (value,)
        for item in items:
            _required(fits(item), item, name, expected)
        return items

    return check


def carried_bearing(campaign: Campaign, warn: Callable[[str], Any]) -> Bearing | None:
    """Bearing that a campaign carries; None without one that can be read."""
    from model.bearing import BearingError
    from model.bearing_file import parse_bearing

    if campaign.bearing_text:
        try:
            return parse_bearing(campaign.bearing_text, campaign.bearing_name)
        except BearingError as error:  # coefficients need no bearing
            warn(f"{error} Until then the amplitude is not held against the clearance.")
    return None


#: What arguments of these names may be.
_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    "campaign": as_campaign, "bearing": as_bearing, "source": _path, "path": _path,
    "folder": lambda value, name: Path(_path(value, name)),
    "curves": _each(lambda curve: hasattr(curve, "stiffness_band"), "hold what fit_pivots gives"),
    "pivot_angles": _each(lambda angle: isinstance(angle, Real), "hold the direction of every pad [rad]"),
    "comparison": lambda v, name: _required(hasattr(v, "predictions"), v, name, "be what compare_campaign gives"),
}  # fmt: skip


def checked(
    function: Callable[..., Any], called: str, names: str, settings: Callable[[], Any] | None = None
) -> Callable[..., Any]:
    """Let a function take paths for a campaign or a bearing, and refuse in our own words, with its name.

    Where `settings` are given, its default ones, it is called with the clearance of the campaign's bearing in them.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:
            raise TypeError(f"{called}: {error}; it takes {', '.join(signature.parameters)}") from None
        try:
            for name in names.split():
                if name in bound.arguments:
                    bound.arguments[name] = _CHECKS[name](bound.arguments[name], name)
            if settings is not None:
                chosen = bound.arguments.get("settings") or settings()
                if chosen.clearance is None:  # the amplitude check knows the bearing, as on the command line
                    bearing = carried_bearing(
                        bound.arguments["campaign"], functools.partial(warnings.warn, stacklevel=3)
                    )
                    chosen = dataclasses.replace(chosen, clearance=bearing and min(bearing.clearances))
                bound.arguments["settings"] = chosen
            return function(*bound.args, **bound.kwargs)
        except OSError as error:  # reading refuses in words of its own
            place = bound.arguments.get("path", bound.arguments.get("folder", error.filename or "a file"))
            raise BadInputError(f"{called}: {place}: {error.strerror}. Give a place that can be written.") from error
        except ValueError as error:
            text = str(error)
            if error.args == (text,) and not text.startswith(called):  # else its text is made of more than one
                error.args = (f"{called}: {text}",)
            raise

    return wrapper
