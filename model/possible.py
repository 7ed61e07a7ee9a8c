"""Numbers that no bearing has: refused by name, before they overflow somewhere in the film or the pad."""

import math
import tomllib
from pathlib import Path
from typing import Any

from model.bearing import Bearing, BearingError, Material, Oil, Pad, Pivot

#: Dimension and flags of every key of a bearing file by its section, and bounds of every number by its class.
KEYS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("bearing_keys.toml").read_text("utf-8"))
#: Smallest and largest value, and unit, of every number, by the class that holds it.
BOUNDS = {part: KEYS["bounds"][part.__name__] for part in (Bearing, Pad, Material, Pivot, Oil)}
#: A pivot's sizes are NaN where its kind has none.
_MAY_BE_ABSENT = {"contact_length", "housing_diameter", "pivot_diameter", "sphere_diameter"}


def check_possible(bearing: Bearing) -> None:
    """Refuse a bearing with a number that no bearing has."""
    source = bearing.source or bearing.name
    _check(bearing, source)
    _check(bearing.oil, f"{source}, oil")
    checked: set[Any] = set()  # the pads of a bearing are of one make, as a rule
    for k, pad in enumerate(bearing.pads, start=1):
        _check(pad, f"{source}, pad {k}")
        parts = {"pivot": bearing.pivot_of(pad), "backing": pad.backing, "babbitt": pad.babbitt}
        for name, part in parts.items():
            if part not in checked:
                _check(part, f"{source}, pad {k}, {name}")
                checked.add(part)


def _check(part: Any, place: str) -> None:
    for name, (low, high, unit) in BOUNDS[type(part)].items():
        value = getattr(part, name)
        if not low <= value <= high and not (name in _MAY_BE_ABSENT and math.isnan(value)):
            bounds = f"{low:g} to {high:g} {unit}".rstrip()
            raise BearingError(
                f"{place}: {name} is {value!r}; no bearing has that ({bounds}). Check the number and its unit."
            )
