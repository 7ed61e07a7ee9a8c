"""What the columns of the tables on disk are: name, quantity, unit, meaning; `schema.csv` lists them by table.

The names are promised to scripts (docs/results.md, whose lists a test holds to this file). A name ends in its unit;
what is derived from a column (an interval's ends, a standard error) adds its own ending behind the unit.
"""

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

from tpjb_ident.columns import UNIT_TABLES, size, symbol

ENTRIES = ("xx", "xy", "yx", "yy")


@dataclass(frozen=True)
class Coefficient:
    """A kind of coefficient: stiffness, damping or mass."""

    symbol: str
    quantity: str
    suffix: str

    @property
    def display_unit(self) -> str:
        """Symbol of the unit that people read."""
        return symbol(self.quantity)

    @property
    def display_scale(self) -> float:
        """Its size in SI."""
        return size(self.quantity)

    def column(self, entry: str) -> str:
        """Name of the column of one entry, ``"xx"`` to ``"yy"``."""
        return f"{self.symbol}{entry}_{self.suffix}"

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all four, row by row."""
        return tuple(self.column(entry) for entry in ENTRIES)


STIFFNESS = Coefficient("k", "stiffness", "N_per_m")  # Re h at the excitation frequency
DAMPING = Coefficient("c", "damping", "Ns_per_m")  # Im h / omega there
MASS = Coefficient("m", "mass", "kg")  # apparent mass of K - omega^2 M
KINDS = {kind.symbol: kind for kind in (STIFFNESS, DAMPING, MASS)}
#: Half of a 95 % interval in standard errors.
HALF_INTERVAL = 1.96
#: Columns of K and C, row by row.
COEFFICIENT_COLUMNS = (*STIFFNESS.columns, *DAMPING.columns)
#: Columns that say which operating point a row is about: static point first.
STATIC_COLUMNS = ("static_load_N", "static_load_direction_deg", "shaft_speed_Hz")
POINT_COLUMNS = (*STATIC_COLUMNS, "excitation_Hz")
#: The same with the sense of turning: the values of `OperatingPoint.static_key` and `key`.
STATIC_KEY = (*STATIC_COLUMNS, "rotation")
POINT_KEY = (*POINT_COLUMNS, "rotation")
#: Of pivot curves: tangent and secant.
TANGENT, SECANT = f"stiffness_{STIFFNESS.suffix}", f"secant_{STIFFNESS.suffix}"


def coefficient_column(name: str) -> str:
    """Column of a coefficient."""
    return KINDS[name[0]].column(name[1:])


def with_endings(*endings: str) -> list[str]:
    """Columns of K and C, row by row, each with every ending in turn: an interval's ends, a standard error."""
    names = []
    for name in COEFFICIENT_COLUMNS:
        names += [name + ending for ending in endings]
    return names


#: Quantity of the unit that a name ends in.
_QUANTITIES: dict[str, str] = UNIT_TABLES["endings"]
_NAME = re.compile(rf".+?_({'|'.join(_QUANTITIES)})(?:_predicted)?")
#: Least value of a quantity in a table, and endings that are widths; anything else may be negative.
_LEAST = {"force": 0.0, "frequency": 0.0, "count": 0.0}
_WIDTHS = ("_se", "_se_systematic", "_random95", "_systematic95", "_dof")
#: What may be infinite, apart from the limits and widths of what is not known at all.
_UNBOUNDED = ("dof", "condition_number")


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    name: str
    meaning: str
    kind: str = "text"  #: of what has no unit
    endings: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """Unit of its cells as the name ends in it; empty where it has none."""
        match = _NAME.fullmatch(self.name)
        return match[1] if match else ""

    @property
    def quantity(self) -> str:
        """What its cells are, by the unit; of what has none its kind."""
        return _QUANTITIES.get(self.unit, self.kind)

    def least(self, ending: str = "") -> float:
        """Least value that a cell can hold."""
        return 0.0 if ending in _WIDTHS else -math.inf if ending else _LEAST.get(self.quantity, -math.inf)

    def may_be_infinite(self, ending: str = "") -> bool:
        """Whether a cell may hold an infinite number."""
        return ending in (*_WIDTHS, "_lo", "_hi") or self.name in _UNBOUNDED

    def pattern(self) -> str:
        """Regular expression of the names that this column stands for."""
        name = re.escape(self.name).replace(r"\{e\}", "(xx|xy|yx|yy)").replace("padN", r"pad\d+")
        name = name.replace("_N_K", r"_\d+_K")
        return name + (f"({'|'.join(self.endings)})?" if self.endings else "")


def _listed() -> dict[str, tuple[Column, ...]]:
    """Columns of every table and group; a name that is that of one before it stands for all of its columns."""
    tables: dict[str, tuple[Column, ...]] = {}
    text = Path(__file__).with_name("schema.csv").read_text(encoding="utf-8")
    for table, name, endings, kind, meaning in csv.reader(text.splitlines()[1:]):
        column = Column(name, meaning, kind or "text", tuple(endings.split()))
        tables[table] = tables.get(table, ()) + tables.get(name, (column,))
    return tables


#: Columns of every table by file name; what begins with @ is a group that several share.
LISTED = _listed()
TABLES = {name: columns for name, columns in LISTED.items() if not name.startswith("@")}
