"""What options hold: operating points in lists and ranges with units, pivots, effects, a table in place of records.

Grammar::

    values   = item { ("," | ";") item }
    item     = number [unit] | number [unit] ".." number [unit] ":" number [unit]      (from, to, step)

A number without a unit takes the unit of the next one to its right: ``"2.5, 5, 7.5 kN"``. A range holds its end
if the steps reach it. A decimal comma is refused: ``2,5 kN`` could mean two loads.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigdata.near_names import hint
from rigdata.operating_point import ROTATIONS, OperatingPoint
from rigdata.units import LONGEST, UnitError, example_of, parse_quantity
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.options import choices, refuse_unknown
from tpjb_ident.errors import BadInputError

if TYPE_CHECKING:
    from model.bearing import Bearing
    from tpjb_ident.compare.predictions import ModelSettings

#: More values than this in one option are a slip of the keyboard.
MAX_VALUES = 10_000
_NUMBER = r"[+-]?(?:\d+\.(?!\.)\d*|\d+|\.\d+)(?:[eE][+-]?\d{1,3})?"
_PART = re.compile(rf"\s*({_NUMBER})\s*([^\d\s.,;:+-][^,;:]*?)?\s*")


def parse_values(text: str, dimension: str, option: str, is_positive: bool = False) -> tuple[float, ...]:
    """Read a list or range of quantities."""
    if re.search(r"\d,\d", text):
        raise BadInputError(
            f"{option}: {text!r} has a comma between digits. Write a decimal point (2.5 kN), or a space after "
            "the comma of a list (2, 5 kN)."
        )
    values: list[float] = []
    unit = ""
    for item in filter(str.strip, reversed(re.split(r"[,;]", text))):
        start, dots, end = item.partition("..")
        place = f"{option}: the range {item.strip()!r}"
        if dots and ":" not in end:
            raise BadInputError(f'{place} has no step. Write from..to:step, for instance "2.5..8.75:1.25 kN".')
        quantities: list[float] = []
        for part in reversed([start, *end.split(":", 1)] if dots else [item]):
            quantity, unit = _quantity(part, unit, dimension, option)
            quantities.insert(0, quantity)
        values[:0] = _range(quantities, place) if dots else quantities
    if not values:
        raise BadInputError(f'{option}: is empty. Write, for instance, "5 {example_of(dimension)}".')
    if len(values) > MAX_VALUES:
        raise BadInputError(f"{option}: {text[:LONGEST]!r} makes more than {MAX_VALUES} values. Take a larger step.")
    if is_positive and min(values) <= 0:
        raise BadInputError(f"{option}: must be positive. Directions have options of their own.")
    return tuple(values)


def parse_value(text: str, dimension: str, option: str, least: float = -math.inf) -> float:
    """Read one quantity, as `parse_values` does."""
    values = parse_values(text, dimension, option)
    if len(values) != 1:
        raise BadInputError(f"{option}: takes one value, got {len(values)} from {text!r}.")
    if values[0] < least:
        raise BadInputError(f"{option} {text!r}: must not be below {least:g}.")
    return values[0]


def parse_share(text: str | None, option: str) -> float | None:
    """Read a share, if one is given."""
    return None if text is None else parse_value(text, "ratio", option, 0.0)


def _range(quantities: Sequence[float], place: str) -> list[float]:
    start, stop, step = quantities
    steps = (stop - start) / step if step else -1.0
    if steps < 0:
        raise BadInputError(
            f"{place} never reaches its end. Give a step that leads from the first to the second value."
        )
    if steps > MAX_VALUES:
        raise BadInputError(f"{place} makes more than {MAX_VALUES} values. Take a larger step.")
    return [start + i * step for i in range(math.floor(steps + 1e-9) + 1)]


def _quantity(text: str, unit: str, dimension: str, option: str) -> tuple[float, str]:
    match = _PART.fullmatch(text) if len(text) <= LONGEST else None
    try:
        if match is None:
            raise UnitError(f"{option}: {text.strip()[:LONGEST]!r} is not a number with a unit")
        unit = match[2] or unit
        return parse_quantity(f"{match[1]} {unit}".strip(), dimension, option), unit
    except UnitError as error:
        raise BadInputError(f'{error}. Write, for instance, "5 {example_of(dimension)}".') from error


_PIVOTS = ("rigid", "kirk", "kirk-secant")


def operating_points(
    load: str, load_direction: str, speed: str, excitation: str | None, rotation: str = ROTATIONS[0]
) -> list[OperatingPoint]:
    """Every combination of the first four options, SI."""
    loads = parse_values(load, "force", "--load", is_positive=True)
    directions = parse_values(load_direction, "angle", "--load-direction")
    speeds = parse_values(speed, "speed", "--speed", is_positive=True)
    frequencies = parse_values(excitation, "speed", "--excitation", is_positive=True) if excitation else (0.0,)
    axes = loads, directions, speeds, frequencies
    if math.prod(map(len, axes)) > MAX_VALUES:
        raise BadInputError(f"more than {MAX_VALUES} operating points. Take larger steps.")
    return [OperatingPoint(*point, rotation) for point in itertools.product(*axes)]


def rotation_choice(c: Command, bearing: Bearing) -> str:
    """What --rotation means: itself, or the bearing file's sense of turning."""
    rotation = c.typed["rotation"]
    if rotation is not None:
        refuse_unknown(rotation, ROTATIONS, "--rotation")
    c.options["rotation"] = chosen = rotation or bearing.rotation or ROTATIONS[0]
    return chosen


def pivot_choice(c: Command) -> str | float | Path:
    """What --pivots means: a name, a stiffness [N/m], or the path of a file."""
    text = c.typed["pivots"]
    if text in _PIVOTS:
        return text
    path = Path(text)
    if path.is_file():
        c.options["pivots"] = c.file(path)
        return path
    if text[:1].isdigit():
        return parse_value(text, "stiffness", "--pivots")
    use = hint(text, _PIVOTS, "Give a pivots.toml, a stiffness, or one of")
    raise BadInputError(f"--pivots: {text!r} is no such file and no pivot model. {use}")


def model_settings(c: Command, pivots: str | float | Path, bearing: Bearing | None) -> ModelSettings:
    """Build `ModelSettings` with --thermal and --effects; those that cannot be, or count twice, are refused."""
    thermal, path = c.typed["thermal"], c.typed["effects"]
    refuse_unknown(thermal, choices("thermal"), "--thermal")
    from tpjb_ident.compare.predictions import ModelSettings, refuse_counted_twice

    if path is None:
        return ModelSettings(pivots, thermal)
    from model.effects import EffectError, apply_effects, load_effects
    from model.pivots import pivot_laws
    from model.setup import Setup

    effects = load_effects(c.file(path))
    refuse_counted_twice(pivots, effects, path)
    if bearing is None:
        raise BadInputError("--effects: effects are of a bearing. Add --bearing FILE, or leave them out.")
    try:
        apply_effects(Setup(bearing, pivot_laws("rigid", bearing)), effects)
    except EffectError as error:
        raise BadInputError(f"--effects {path.name}: {error}") from error
    return ModelSettings(pivots, thermal, effects)


def open_source(c: Command, predicted: bool = False) -> tuple[Any, Any, list[object]]:
    """Open a campaign with its bearing, or in its place a `TableSource` of coefficients with the bearing file.

    A table whose points another program has predicted needs no bearing. With them come the words of a command that
    name the same.
    """
    campaign, table, bearing = c.typed["campaign"], c.typed["coefficients"], c.typed["bearing"]
    words = [] if bearing is None else ["--bearing", bearing]
    if table is None and campaign is not None:
        source = c.open(campaign)
        return source, c.bearing_of(source), [campaign, *words]
    if table is None or campaign is not None:
        raise BadInputError(f"{c.name}: give a campaign, or --coefficients TABLE.csv with --bearing FILE; one of them.")
    from tpjb_ident.compare.coefficient_table import TableSource

    c.file(table)
    if not table.is_file():
        raise BadInputError(f"{table}: no such file. Give the table of coefficients as CSV.")
    if bearing is None and not predicted:
        raise BadInputError(f"{c.name} --coefficients: a table names no bearing. Add --bearing FILE.")
    drawing = None if bearing is None else c.bearing(bearing)
    return TableSource(table.stem), drawing, ["--coefficients", table, *words]
