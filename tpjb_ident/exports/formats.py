"""The forms in which coefficients leave: by name, where each is written. A new one is a file and a line here."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rigdata.near_names import nearest_name
from tpjb_ident.errors import TpjbError

if TYPE_CHECKING:
    from tpjb_ident.exports.points import StaticPoint


class ExportError(TpjbError):
    """What was given cannot be exported; says which format, column or point, and what to do."""


#: Writes points into an existing folder; the text says where they come from.
Writer = Callable[[Path, "tuple[StaticPoint, ...]", str], None]


@dataclass(frozen=True)
class Format:
    """One form of export; its writer puts files of some points into an existing folder.

    A writer is called with the folder, the points (tuple of StaticPoint) and a text that says where they come from.

    Attributes
    ----------
    module, function : str
        Where its writer is; imported when it is used.
    holds_intervals : bool
        Whether its files hold intervals and flags; where not, a table of them is written beside.
    note : str
        What its user must know.
    """

    module: str
    function: str
    holds_intervals: bool = True
    note: str = ""

    @property
    def writer(self) -> Writer:
        """The function that writes it."""
        writer: Writer = getattr(importlib.import_module(f"tpjb_ident.exports.{self.module}"), self.function)
        return writer


_BY_SPEED = "this program knows K and C over shaft speed only: one file per excitation frequency."
FORMATS: dict[str, Format] = {
    "ross": Format(
        "rotor_programs",
        "write_ross",
        holds_intervals=False,
        note="ROSS extrapolates outside the frequencies given; K holds Re h, the masses are zero.",
    ),
    "csv": Format("table", "write_csv"),
    "parquet": Format("table", "write_parquet"),
    "excel": Format("table", "write_excel"),
    "mat": Format("table", "write_mat"),
    "xltrc": Format("rotor_programs", "write_xltrc", holds_intervals=False, note=_BY_SPEED),
    "dyrobes": Format("rotor_programs", "write_dyrobes", holds_intervals=False, note=_BY_SPEED),
    "ansys": Format("rotor_programs", "write_ansys", holds_intervals=False, note=_BY_SPEED),
}


def export_format(name: str) -> Format:
    """Format of a name."""
    if name not in FORMATS:
        near = nearest_name(name, FORMATS)
        hint = f"Did you mean {near!r}?" if near else f"Use one of {', '.join(FORMATS)}."
        raise ExportError(f"--to: {name!r} is not known. {hint}")
    return FORMATS[name]
