"""Columns of a table that people read: heading, unit and form; the one place that says in which units they read."""

from collections.abc import Callable
from typing import Any, NamedTuple

from rigdata.operating_point import ROTATIONS
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
UNITS = dict(SYSTEMS["si"])


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


#: Calibrated quantities whose unit changes with the system, and those that people read in one unit everywhere.
_SHOWN = {"displacement": "length", "force": "force", "pressure": "pressure"}
_EVERYWHERE = {"acceleration": "m/s²", "temperature": "K", "speed": "rad/s"}


def channel_unit(quantity: str) -> tuple[str, float]:
    """Symbol and size of the unit in which people read a calibrated channel; no symbol where it has none."""
    return UNITS[_SHOWN[quantity]] if quantity in _SHOWN else (_EVERYWHERE.get(quantity, ""), 1.0)


class Column(NamedTuple):
    """A column whose cells are made of one number, of several (value and interval), or are ready words.

    >>> load = Column("load {load}")
    >>> load.heading, load.cell(2500.0), load.cell(None), load.cell("any")
    ('load kN', '2.5', '-', 'any')
    """

    title: str  #: heading, with the unit of a quantity as {load}
    form: str | Callable[..., str] = "g"  #: of one number, or a function of all numbers of a cell
    words: bool = False  #: to the left, broken at spaces where room is short
    quantity: str = ""  #: in `UNITS`, where the heading has none

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return self.title.format_map({quantity: unit for quantity, (unit, _) in UNITS.items()})

    def cell(self, value: Any) -> str:
        """Write a value of this column: a number, several, words, or None."""
        if value is None or value != value:  # not a number
            return "-"
        if isinstance(value, str):
            return value
        quantity = self.quantity or self.title.partition("{")[2].partition("}")[0]
        unit = size(quantity) if quantity else 1.0
        if callable(self.form):
            return self.form(*(number / unit for number in value))
        return format(value / unit, self.form)


def words(*titles: str) -> list[Column | str]:
    """Columns of words."""
    return [Column(title, words=True) for title in titles]


def per(quantity: str) -> float:
    """Factor that makes of a value in SI one in the unit that people read."""
    return 1.0 / size(quantity)


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


def place_of(load: float, excitation: float) -> str:
    """Load [N] and excitation [Hz] of an operating point.

    >>> place_of(5000.0, 25.0)
    '5 kN, 25 Hz'
    """
    return f"{amount(load, 'load')}, {excitation:g} Hz"
