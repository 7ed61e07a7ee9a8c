"""Lists and ranges with units on the command line: ``"2.5 kN, 5 kN"``, ``"2.5..8.75:1.25 kN"``, ``"22 Hz"``.

Grammar::

    values   = item { ("," | ";") item }
    item     = number [unit] | number [unit] ".." number [unit] ":" number [unit]      (from, to, step)

A number without a unit takes the unit of the next one to its right: ``"2.5, 5, 7.5 kN"``. A range holds its end
if the steps reach it. A decimal comma is refused: ``2,5 kN`` could mean two loads.
"""

from __future__ import annotations

import math
import re

from rigdata.units import LONGEST, UnitError, parse_quantity
from tpjb_ident.errors import BadInputError

#: More values than this in one option are a slip of the keyboard.
MAX_VALUES = 10_000
_NUMBER = r"[+-]?(?:\d+\.(?!\.)\d*|\d+|\.\d+)(?:[eE][+-]?\d{1,3})?"
_PART = re.compile(rf"\s*({_NUMBER})\s*([^\d\s.,;:+-][^,;:]*?)?\s*")
_EXAMPLES = {
    "force": "2.5 kN, 5 kN",
    "speed": "22 Hz",
    "angle": "-90 deg",
    "stiffness": "4e8 N/m",
    "temperature": "40 degC",
}


def parse_values(text: str, dimension: str, option: str) -> tuple[float, ...]:
    """Read a list or range of quantities."""
    if re.search(r"\d,\d", text):
        raise BadInputError(
            f"{option}: {text!r} has a comma between digits. Write a decimal point (2.5 kN), or a space after "
            "the comma of a list (2, 5 kN)."
        )
    items = [item for item in re.split(r"[,;]", text) if item.strip()]
    if not items:
        raise BadInputError(f'{option}: is empty. Write, for instance, {option} "{_EXAMPLES[dimension]}".')
    values: list[float] = []
    unit = ""
    for item in reversed(items):
        several, unit = _item(item, unit, dimension, option)
        values[:0] = several
        if len(values) > MAX_VALUES:
            raise BadInputError(f"{option}: {text!r} makes more than {MAX_VALUES} values. Take a larger step.")
    return tuple(values)


def parse_value(text: str, dimension: str, option: str) -> float:
    """Read one quantity; like `parse_values`."""
    values = parse_values(text, dimension, option)
    if len(values) != 1:
        raise BadInputError(f"{option}: takes one value, got {len(values)} from {text!r}.")
    return values[0]


def parse_amount(text: str, dimension: str, place: str, example: str) -> float:
    """Read one quantity in the words of a manifest; `place` says where it was typed, `example` how it is written."""
    try:
        return parse_quantity(text, dimension)
    except UnitError as error:
        raise BadInputError(f"{place}: {error}. Write, for instance, {example}.") from error


def _item(item: str, unit: str, dimension: str, option: str) -> tuple[list[float], str]:
    """Return the values of one list item and its leftmost unit, for the item before it."""
    if ".." not in item:
        value, unit = _quantity(item, unit, dimension, option)
        return [value], unit
    head, colon, step_text = item.partition(":")
    start_text, _, stop_text = head.partition("..")
    if not colon:
        raise BadInputError(
            f'{option}: the range {item.strip()!r} has no step. Write from..to:step, for instance "2.5..8.75:1.25 kN".'
        )
    step, unit = _quantity(step_text, unit, dimension, option)
    stop, unit = _quantity(stop_text, unit, dimension, option)
    start, unit = _quantity(start_text, unit, dimension, option)
    return _range(start, stop, step, f"{option}: the range {item.strip()!r}"), unit


def _range(start: float, stop: float, step: float, where: str) -> list[float]:
    if step == 0 or (stop - start) * step < 0:
        raise BadInputError(
            f"{where} never reaches its end. Give a step that leads from the first to the second value."
        )
    steps = (stop - start) / step
    if steps > MAX_VALUES:
        raise BadInputError(f"{where} makes more than {MAX_VALUES} values. Take a larger step.")
    return [start + i * step for i in range(math.floor(steps + 1e-9) + 1)]


def _quantity(text: str, unit: str, dimension: str, option: str) -> tuple[float, str]:
    match = _PART.fullmatch(text) if len(text) <= LONGEST else None
    if match is None:
        raise BadInputError(
            f"{option}: {text.strip()[:LONGEST]!r} is not a number with a unit. Write, for instance, "
            f'{option} "{_EXAMPLES[dimension]}".'
        )
    unit = match[2] or unit
    try:
        return parse_quantity(f"{match[1]} {unit}".strip(), dimension, option), unit
    except UnitError as error:
        raise BadInputError(f'{error}. Write, for instance, {option} "{_EXAMPLES[dimension]}".') from error
