"""Units that a record itself states, held against the manifest's: where they differ, the numbers would be others."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rigdata.calibration import DIMENSIONS, Channel
from rigdata.problem import Problem
from rigdata.units import UnitError, is_signal, parse_unit, temperature_offset, unit_factor

#: Factors that differ by less are rounded ones of one unit.
_SAME = 1e-3
#: Longer texts are remarks.
_LONGEST = 20


def unit_problems(
    channels: Mapping[str, Channel], units: Mapping[str, str], file: str, run: str | None
) -> tuple[Problem, ...]:
    """An error for every channel whose unit in the file is another than its unit in the manifest."""
    problems = []
    for name, text in units.items():
        channel = channels.get(name)
        if channel is None or channel.quantity not in DIMENSIONS or text.strip() in ("", channel.unit):
            continue
        if len(text) <= _LONGEST and _differ(text.strip(), channel.unit, DIMENSIONS[channel.quantity]):
            fault = f"the file states {text.strip()!r}, the manifest unit = {channel.unit!r}"
            cure = "Correct unit in the manifest, or the units of the file if those are wrong"
            problems.append(Problem("error", file, f"channel {name}", fault, cure, run))
    return tuple(problems)


def _differ(stated: str, manifest: str, dimension: str) -> bool:
    """Whether two units turn a reading into different numbers; False where the file's is no unit."""
    try:
        first, second = _meaning(stated, dimension), _meaning(manifest, dimension)
    except UnitError:
        return False
    (*kind, factor), (*other_kind, other_factor) = first, second
    return kind != other_kind or not math.isclose(factor, other_factor, rel_tol=_SAME)


def _meaning(unit: str, dimension: str) -> tuple[object, float, float]:
    """What a reading is (a signal's dimension, or the quantity itself), its offset and its factor."""
    parsed = parse_unit(unit)
    if is_signal(unit):
        return parsed.powers, 0.0, parsed.factor
    offset = temperature_offset(unit) if dimension == "temperature difference" else 0.0
    return dimension, offset, unit_factor(unit, dimension)
