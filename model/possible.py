"""Numbers that no bearing has: refused by name, before they overflow somewhere in the film or the pad."""

import math
import tomllib
from pathlib import Path
from typing import Any

from model.bearing import Bearing, BearingError, Material, Oil, Pad, Pivot

#: Dimension and flags of every key of a bearing file by its section, and bounds of every number by its class.
KEYS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("bearing_keys.toml").read_text("utf-8"))
#: Smallest and largest value of every number, its unit, and what of the bearing they are shares of; by its class.
BOUNDS = {part: KEYS["bounds"][part.__name__] for part in (Bearing, Pad, Material, Pivot, Oil)}
#: A pivot's sizes are NaN where its kind has none; bearings made in Python may have no clearance, which is a condition.
_EXCEPT: dict[str, Any] = dict.fromkeys(
    ("contact_length", "housing_diameter", "pivot_diameter", "sphere_diameter"), math.isnan
)
_EXCEPT["assembled_clearance"] = lambda value: -0.02 <= value <= 0.0


def check_possible(bearing: Bearing) -> None:
    """Refuse a bearing with a number that no bearing has."""
    parts: dict[Any, str] = {bearing.oil: ", oil"}  # the pads of a bearing are of one make, as a rule
    for k, pad in enumerate(bearing.pads, start=1):
        named = {"": pad, ", pivot": bearing.pivot_of(pad), ", backing": pad.backing, ", babbitt": pad.babbitt}
        for name, part in named.items():
            parts.setdefault(part, f", pad {k}{name}")
    for part, place in ((bearing, ""), *parts.items()):
        for name, (low, high, unit, *share) in BOUNDS[type(part)].items():
            value, size = getattr(part, name), getattr(bearing, *share) if share else 1.0
            if not low * size <= value <= high * size and not (name in _EXCEPT and _EXCEPT[name](value)):
                bounds = f"{low * size:g} to {high * size:g} {unit}".rstrip()
                raise BearingError(
                    f"{bearing.source or bearing.name}{place}: {name} is {value!r}; no bearing has that ({bounds}). "
                    "Check the number and its unit."
                )
