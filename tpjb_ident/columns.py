"""Columns of a table that people read: heading, unit and form; the one place that says in which units they read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

#: Symbol and size of the unit in which a quantity is printed; sizes in SI, of angles in degrees, of speeds in Hz.
UNITS = {
    "load": ("kN", 1e3),
    "stiffness": ("MN/m", 1e6),
    "damping": ("kNs/m", 1e3),
    "mass": ("kg", 1.0),
    "length": ("µm", 1e-6),
    "angle": ("deg", 1.0),
    "frequency": ("Hz", 1.0),
    "share": ("%", 0.01),
}
_SYMBOLS = {quantity: symbol for quantity, (symbol, _) in UNITS.items()}


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
        return self.title.format_map(_SYMBOLS)

    def cell(self, value: Any) -> str:
        """Write a value of this column: a number, several, words, or None."""
        if value is None:
            return "-"
        if isinstance(value, str):
            return value
        quantity = self.quantity or self.title.partition("{")[2].partition("}")[0]
        size = UNITS[quantity][1] if quantity else 1.0
        if callable(self.form):
            return self.form(*(number / size for number in value))
        return format(value / size, self.form)


def words(*titles: str) -> list[Column | str]:
    """Columns of words."""
    return [Column(title, words=True) for title in titles]


def amount(value: float, quantity: str) -> str:
    """A quantity with its unit, in a sentence.

    >>> amount(2500.0, "load")
    '2.5 kN'
    """
    symbol, size = UNITS[quantity]
    return f"{value / size:g} {symbol}"
