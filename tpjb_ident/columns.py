"""Columns of a table that people read: heading, unit and form; the one place that says in which units they read."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from rigdata.operating_point import ROTATIONS, OperatingPoint
from rigdata.units import ZERO_CELSIUS
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import significant

#: Pounds and inches in SI.
_LBF, _INCH = 4.4482216152605, 0.0254
#: Symbol and size (in SI, degrees, Hz) of the unit in which a quantity is shown, by system.
_SI = {
    "load": ("kN", 1e3),
    "force": ("N", 1.0),
    "stiffness": ("MN/m", 1e6),
    "damping": ("kN s/m", 1e3),
    "mass": ("kg", 1.0),
    "length": ("µm", 1e-6),
    "size": ("mm", 1e-3),
    "pressure": ("MPa", 1e6),
    "acceleration": ("m/s²", 1.0),
    "angle": ("deg", 1.0),
    "frequency": ("Hz", 1.0),
    "speed": ("Hz", 1.0),
    "share": ("%", 0.01),
}
_US = {
    "load": ("lbf", _LBF),
    "force": ("lbf", _LBF),
    "stiffness": ("lbf/in", _LBF / _INCH),
    "damping": ("lbf s/in", _LBF / _INCH),
    "mass": ("lb", 0.45359237),
    "length": ("mil", 1e-3 * _INCH),
    "size": ("in", _INCH),
    "pressure": ("psi", _LBF / _INCH**2),
    "speed": ("rpm", 1 / 60.0),
}
SYSTEMS = {"si": _SI, "us": _SI | _US}
#: The system in use, which `use_units` sets.
UNITS = dict(_SI)


def use_units(system: str) -> None:
    """Choose the units in which people read: "si" or "us"; what is computed and stored stays SI."""
    if system not in SYSTEMS:
        raise BadInputError(f"--units: {system!r} is not known. Use one of {', '.join(SYSTEMS)}.")
    UNITS.update(SYSTEMS[system])


def in_us_units() -> bool:
    """Whether people read pounds, inches and rpm."""
    return SYSTEMS["us"] == UNITS


def symbol(quantity: str) -> str:
    """Symbol of the unit in which a quantity is shown."""
    return UNITS[quantity][0]


def size(quantity: str) -> float:
    """Size of that unit in SI (of angles in degrees, of frequencies and speeds in Hz)."""
    return UNITS[quantity][1]


#: Unit of a kelvin's scale in US units: its symbol, its size and its zero in K.
FAHRENHEIT = ("degF", 5 / 9, 459.67 * 5 / 9)


def channel_unit(quantity: str) -> tuple[str, float, float]:
    """Symbol, size and zero in SI of the unit in which people read a calibrated channel; no symbol if it has none."""
    if quantity == "temperature":
        return FAHRENHEIT if in_us_units() else ("degC", 1.0, ZERO_CELSIUS)
    if quantity == "speed":
        return symbol("speed"), 2 * math.pi * size("speed"), 0.0
    unit, scale = UNITS.get("length" if quantity == "displacement" else quantity, ("", 1.0))
    return unit, scale, 0.0


class Column(NamedTuple):
    """A column whose cells are made of one number, of several (value and interval), or are ready words.

    >>> load = Column("load {load}")
    >>> load.heading, load.cell(2500.0), load.cell(None), load.cell("any")
    ('load kN', '2.5', '-', 'any')
    """

    title: str  #: heading, with the unit of a quantity as {load}
    form: str | Callable[..., str] = "g"  #: of one number, or a function of all numbers of a cell
    words: bool = False  #: to the left, broken at spaces where room is short

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return self.with_unit()

    def with_unit(self, cell: str = "") -> str:
        """Title with the unit, behind a cell: ``load 2.5 kN``."""
        text = self.title.format_map({quantity: f"{cell} {unit}".strip() for quantity, (unit, _) in UNITS.items()})
        return f"{text} {cell}".strip() if text == self.title else text

    def cell(self, value: Any) -> str:
        """Write a value of this column: a number, several, words, or None."""
        if value is None or value != value:  # not a number
            return "-"
        if isinstance(value, str):
            return value
        quantity = self.title.partition("{")[2].partition("}")[0]
        unit = size(quantity) if quantity else 1.0
        if callable(self.form):
            return self.form(*(number / unit for number in value))
        return significant(value / unit, self.form)


def words(*titles: str) -> list[Column | str]:
    """Columns of words."""
    return [Column(title, words=True) for title in titles]


def amount(value: float, quantity: str, form: str = ".6g") -> str:
    """A quantity with its unit, in a sentence.

    >>> amount(2500.0, "load")
    '2.5 kN'
    """
    return f"{significant(value / size(quantity), form)} {symbol(quantity)}"


def spinning(speed: float, rotation: str = ROTATIONS[0]) -> str:
    """A shaft speed [Hz] with both its units, and its sense where that is not the usual one.

    >>> spinning(22.0)
    '22 Hz (1320 rpm)'
    """
    sense = "" if rotation == ROTATIONS[0] else f" {rotation}"
    return f"{speed:.6g} Hz ({60 * speed:.6g} rpm){sense}"


def degrees(celsius: float) -> str:
    """A temperature [degC] in the degrees that people read.

    >>> degrees(40.0)
    '40 °C'
    """
    return f"{1.8 * celsius + 32:.4g} °F" if in_us_units() else f"{celsius:.4g} °C"


def set_point(point: OperatingPoint) -> str:
    """An operating point in words."""
    words = f"{amount(point.static_load, 'load')} at {point.static_load_direction_deg:g} deg, shaft {point.speed_words}"
    return f"{words}, excited at {point.excitation_hz:g} Hz" if point.excitation else words


def place_of(load: float, excitation: float) -> str:
    """Load [N] and excitation [Hz] of an operating point.

    >>> place_of(5000.0, 25.0)
    '5 kN, 25 Hz'
    """
    return f"{amount(load, 'load')}, {excitation:g} Hz"
