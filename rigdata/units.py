"""Quantities with units, as manifests, bearing files, options and notebooks give them, into SI floats.

A quantity is a number, then a unit: ``"7.78 mV/um"``. The grammar is narrower than that of pint,
so that nothing a stranger writes in a file is evaluated: single unit names are looked up, the
products, quotients and powers between them are worked out here.
"""

from __future__ import annotations

import contextlib
import functools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rigdata.problem import RigError, shown, tables_beside

#: Characters of a quantity; more are a slip or a bomb.
LONGEST = 200
ZERO_CELSIUS = 273.15
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?(?![0-9.,])")
_TOKEN = re.compile(r"\s*(?:([A-Za-z_Ω%]{1,24})(?:(?:\^|\*\*)?([+-]?[1-6]))?(?![0-9])|([*/()])|(1)(?![0-9]))")
_MAX_UNIT = 48
LISTED: dict[str, Any] = tables_beside(__file__, "units.toml")
#: SI unit of every dimension.
SI_UNITS: dict[str, str] = LISTED["si"]
#: Seconds of what loggers count times in.
TIME_FACTORS: dict[str, float] = LISTED["times"]
_SPELLINGS = str.maketrans(LISTED["spellings"])
_DASHES = str.maketrans("\u2212\u2013", "--")  # a minus as word processors write it


class UnitError(RigError):
    """A quantity that cannot be read, or has the wrong dimension."""


@dataclass(frozen=True)
class Unit:
    """A unit as a multiple of SI base units."""

    factor: float
    powers: tuple[tuple[str, int], ...] = ()

    def __mul__(self, other: Unit) -> Unit:
        powers = dict(self.powers)
        for name, power in other.powers:
            powers[name] = powers.get(name, 0) + power
        return Unit(self.factor * other.factor, tuple(sorted((n, p) for n, p in powers.items() if p)))

    def __pow__(self, power: int) -> Unit:
        return Unit(self.factor**power, tuple((n, p * power) for n, p in self.powers))


@functools.cache
def common_units() -> dict[str, Unit]:
    """Units that need no pint, by name."""
    units = {}
    for entry in LISTED["common"]:
        powers = tuple(entry["of"].items())
        for name, factor in entry["factors"].items():
            units[name] = Unit(factor, powers)
    return units


@functools.lru_cache(maxsize=512)
def _base(name: str) -> Unit:
    """One unit name, without powers or quotients."""
    return common_units().get(name) or from_pint(name)


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None, on_redefinition="ignore")


def from_pint(name: str) -> Unit:
    """One unit name as pint knows it."""
    registry = _registry()
    try:
        magnitude, units = registry.get_base_units(name)
        powers = {str(n): int(p) for n, p in units._units.items()}
        factor = float(magnitude)
    except Exception as error:  # pint raises a dozen kinds for a bad name; all mean the same to a user
        units = (*LISTED["aliases"]["any"], *common_units())
        near = {known.casefold(): f"; did you mean {known}?" for known in units}
        raise UnitError(f"unit {name!r} is not known{near.get(name.casefold(), '')}") from error
    return Unit(factor, tuple(sorted(powers.items())))


@functools.lru_cache(maxsize=1024)
def parse_unit(text: str, dimension: str = "") -> Unit:
    """Read a unit such as ``"mV/um"``, ``"m/s^2"`` or ``"V/(rad/s)"``."""
    if len(text) > _MAX_UNIT:
        raise UnitError(f"unit {text[:_MAX_UNIT]!r}... is too long to be one")
    plain = text.strip().translate(_SPELLINGS)
    if dimension == "speed":
        plain = LISTED["turns"].get(plain, plain)
    if not plain:
        return Unit(1.0)
    pieces = list(_TOKEN.finditer(plain))
    if "".join(piece[0] for piece in pieces) != plain:
        raise UnitError(f"unit {text!r} cannot be read")
    if plain.count("(") != plain.count(")"):
        raise UnitError(f"unit {text!r} has an unmatched parenthesis")
    return _product(iter(pieces), text, dimension)


def _product(pieces: Iterator[re.Match[str]], text: str, dimension: str) -> Unit:
    """Product of names, numbers one and parentheses, up to the end or to one that closes."""
    product, sign, needs_name = Unit(1.0), 1, True
    for piece in pieces:
        name, power, symbol, _ = piece.groups("")
        if symbol == ")":
            break
        if symbol in ("*", "/"):
            if needs_name:
                raise UnitError(f"unit {text!r} has {symbol!r} where a unit name should be")
            sign, needs_name = (-1 if symbol == "/" else 1), True
            continue
        factor = _product(pieces, text, dimension) if symbol else Unit(1.0)
        if name:
            aliases = LISTED["aliases"]["any"] | LISTED["aliases"].get(dimension, {})
            factor = _base(aliases.get(name, name)) ** int(power or 1)
            if dimension == "speed" and name in {"Hz", "kHz"}:  # of a shaft or a vibration: cycles
                factor *= _base("revolution") ** int(power or 1)
        product, sign, needs_name = product * factor**sign, 1, False
    if needs_name:
        raise UnitError(f"unit {text!r} ends where a unit name should be")
    return product


def unit_factor(unit: str, dimension: str) -> float:
    """SI value of one `unit`, a multiple without offset (``degC`` counts as a kelvin step)."""
    parsed = parse_unit(unit, dimension)
    # The radian of a speed is asked for: "22 1/s" is caught above as revolutions.
    is_usable = parsed.powers == parse_unit(SI_UNITS[dimension]).powers
    if dimension == "rotational stiffness":  # a moment per tilt, the radian left out
        is_usable = is_usable or parsed.powers == parse_unit("N*m").powers
    elif dimension == "angle":  # a slope: 0.2 mm/m
        is_usable = is_usable or ("/" in unit and not parsed.powers)
    if not is_usable:
        other, cure = LISTED["mistaken"].get(dimension, ("", ""))
        fault = f"unit {unit!r} is not one of {dimension}; expected something like {example_of(dimension)!r}"
        raise UnitError(fault + cure * (parsed.powers == parse_unit(other).powers))
    return parsed.factor


def measured_in(unit: str) -> str:
    """What a rig records in a unit: a "signal" or a quantity of a manifest; "" where that is nothing."""
    for quantity, dimension in LISTED["quantities"].items():
        with contextlib.suppress(UnitError):
            return "signal" if is_signal(unit) else quantity * bool(unit_factor(unit, dimension))
    return ""


def example_of(dimension: str) -> str:
    """A unit that people write for a dimension."""
    return str(LISTED["examples"].get(dimension, SI_UNITS[dimension]))


def split_quantity(value: object, dimension: str) -> tuple[float, str]:
    """Split ``"7.78 mV/um"`` into 7.78 and ``"mV/um"``."""
    example = example_of(dimension)
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError(f'expected a number with a unit in quotes, like "1 {example}", got {shown(value)}')
    number, unit = value, ""
    if isinstance(value, str):
        if len(value) > LONGEST:
            raise UnitError(f"a text of {len(value)} characters is not a quantity")
        text = value.strip().translate(_DASHES)
        match = _NUMBER.match(text)
        if match is None:
            hint = "; write a decimal point, not a comma" if re.match(r"[+-]?[0-9]*,[0-9]", text) else ""
            raise UnitError(f"{shown(value)} is not a number with a unit{hint}")
        number, unit = match[0], text[match.end() :].strip()
    if not unit and dimension != "ratio":
        size = shown(number).strip("'")
        raise UnitError(f'{shown(value)} has no unit, as in "{size} {example}"')
    return _finite(number), unit


def _finite(value: str | float) -> float:
    try:
        number = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        raise UnitError(f"{shown(value)} is not a finite number")
    return number


def parse_quantity(value: object, dimension: str, name: str = "") -> float:
    """Turn ``"22 Hz"`` into SI, ``"40 degC"`` into kelvin; an error begins with `name`.

    >>> parse_quantity("0.080 mm", "length")
    8e-05
    """
    try:
        number, unit = split_quantity(value, dimension)
        if not unit:
            return number
        offset = temperature_offset(unit) if dimension == "temperature" else 0.0
        return _finite(number * unit_factor(unit, dimension) + offset)
    except UnitError as error:
        if not name:
            raise
        raise UnitError(f"{name}: {error}") from error


def to_si(value: Any, dimension: str, name: str) -> Any:
    """Take SI floats or arrays as they are; read texts, convert pint quantities, refuse a wrong dimension."""
    if isinstance(value, str):
        return parse_quantity(value, dimension, name)
    if not (hasattr(value, "to") and hasattr(value, "magnitude")):
        return value
    if dimension == "speed" and str(value.units) in {"hertz", "kilohertz"}:
        return value.to("1/s").magnitude * 2 * math.pi
    try:
        return value.to(SI_UNITS[dimension]).magnitude
    except Exception as error:  # a foreign registry raises its own DimensionalityError
        raise UnitError(f"{name}: {value} is not a {dimension}") from error


def temperature_offset(unit: str) -> float:
    """Kelvin at 0 of the temperature `unit`."""
    return float(LISTED["offsets"].get(unit.strip().translate(_SPELLINGS), 0.0))


def is_signal(unit: str) -> bool:
    """Whether `unit` is what a data logger sees (V, mA, mV/V, count), not an engineering unit."""
    volt, ampere, count = map(parse_unit, LISTED["signals"])
    return is_bridge_ratio(unit) or parse_unit(unit).powers in (volt.powers, ampere.powers, count.powers)


def is_bridge_ratio(unit: str) -> bool:
    """Whether `unit` is volts per volt, as a strain-gauge bridge gives."""
    numerator, _, denominator = unit.partition("/")
    try:
        return parse_unit(numerator).powers == parse_unit(denominator).powers == parse_unit("V").powers
    except UnitError:
        return False


def sensitivity_gain(value: object, signal_unit: str, dimension: str) -> float:
    """SI value of the quantity per one `signal_unit` of reading."""
    number, unit = split_quantity(value, dimension)
    parsed, signal = parse_unit(unit, dimension), parse_unit(signal_unit)
    quotient = signal * parse_unit(SI_UNITS[dimension]) ** -1
    if number <= 0 or number * parsed.factor == 0:  # the second: too small for a float
        raise UnitError(f"{shown(value)} must be above zero; a falling reading is polarity = -1")
    if parsed.powers == quotient.powers:
        return _finite(signal.factor / (number * parsed.factor))
    if parsed.powers == (quotient**-1).powers:
        return _finite(number * parsed.factor * signal.factor)
    example = f"{signal_unit}/{example_of(dimension)}"
    raise UnitError(f"{shown(value)} does not lead from {signal_unit} to {dimension}; expected like {example!r}")
