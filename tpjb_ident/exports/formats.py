"""Coefficients as every export takes them, one table of what may leave; and the forms in which they leave.

A new form is a writer ``write_NAME`` and a line in `FORMATS`. Programs of rotors take a shaft that turns
counter-clockwise for granted: what was measured on another one is mirrored for them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rigdata.near_names import hint
from tpjb_ident.columns import in_us_units, place_of
from tpjb_ident.conditions import errors_in
from tpjb_ident.errors import TpjbError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, KINDS, POINT_COLUMNS, STATIC_KEY, with_endings

if TYPE_CHECKING:  # imported late: the command line asks for the names of the formats
    import pandas as pd


class ExportError(TpjbError):
    """What was given cannot be exported; says which format, column or point, and what to do."""


COLUMNS = {name[:3]: name for name in COEFFICIENT_COLUMNS}
#: A coefficient and the ends of its interval.
ENDS = ("", "_lo", "_hi")
_CROSS = ("kxy", "kyx", "cxy", "cyx")
_COUNTER_CLOCKWISE = "counter-clockwise"


@dataclass(frozen=True)
class Chosen:
    """What of a table can leave, and where others stand, those that are doubtful with the reasons.

    Attributes
    ----------
    table : DataFrame
        Sorted by static point and excitation; columns as in coefficients.csv: static point, ``excitation_Hz``,
        ``rotation``, the coefficients with ``_lo`` and ``_hi`` (NaN where the source has none, as of a prediction),
        ``quality`` (the named conditions, ``"ok"`` if there are none) and ``trusted`` (False where a point leaves
        against advice).
    left_out : tuple of str
        Points without finite coefficients.
    doubtful : tuple of str
        Points that are not to be trusted, and why.
    """

    table: pd.DataFrame | None = field(repr=False, default=None)
    left_out: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()


def chosen_rows(frame: pd.DataFrame, force: bool = False) -> Chosen:
    """Choose and sort rows of a table of coefficients; what is not to be trusted stays behind."""
    needed = [*POINT_COLUMNS, *COEFFICIENT_COLUMNS]
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise ExportError(f"the table has no column {missing[0]}. Give a coefficients.csv or prediction.csv of tpjb.")
    import numpy as np

    finite = np.isfinite(frame[needed].to_numpy(dtype=float)).all(axis=1)
    left_out = tuple(_place(row) for row in frame[~finite].to_dict("records"))
    if not finite.any():
        raise ExportError("no point of the table has finite coefficients. Identify or predict again.")
    records = frame[finite].to_dict("records")
    qualities, trusted, doubtful = [], [], []
    for row in records:
        reason = _distrust(row)
        qualities.append(_flags(row, reason))
        trusted.append(not reason)
        if reason:
            doubtful.append(f"{_place(row)}: {reason}")
    table = frame[finite].reindex(columns=[*POINT_COLUMNS, *with_endings(*ENDS)]).astype(float)
    table["rotation"] = [row.get("rotation") or _COUNTER_CLOCKWISE for row in records]
    table["quality"], table["trusted"] = qualities, trusted
    exported = table if force else table[table["trusted"]]
    keys = [*STATIC_KEY, "excitation_Hz"]
    for load in exported.loc[exported.duplicated(keys), "static_load_N"]:
        raise ExportError(f"the point {load:g} N stands twice at one frequency. Export one method at a time.")
    return Chosen(exported.sort_values(keys, ignore_index=True), left_out, tuple(doubtful))


def _place(row: Mapping[Any, Any]) -> str:
    return place_of(row["static_load_N"], row["excitation_Hz"])


def turning_counter_clockwise(table: pd.DataFrame) -> pd.DataFrame:
    """Give points in a frame in which the shaft turns counter-clockwise: x to -x where it does not (``mirrored``)."""
    clockwise = table["rotation"] != _COUNTER_CLOCKWISE
    turned = table.assign(rotation=_COUNTER_CLOCKWISE, mirrored=clockwise)
    mirrored = (180.0 - table["static_load_direction_deg"] + 180.0) % 360.0 - 180.0
    turned.loc[clockwise, "static_load_direction_deg"] = mirrored[clockwise]
    for name in (COLUMNS[short] for short in _CROSS):
        ends = [name, f"{name}_hi", f"{name}_lo"]
        turned.loc[clockwise, [name + end for end in ENDS]] = -table.loc[clockwise, ends].to_numpy()
    return turned


def flags(table: pd.DataFrame) -> list[str]:
    """A sentence for every row that has something against it."""
    sentences = []
    for row in table[table["quality"] != "ok"].to_dict("records"):
        warning = "" if row["trusted"] else "NOT TO BE TRUSTED, "
        shaft = f"{60 * row['shaft_speed_Hz']:g} rpm"
        sentences.append(
            f"{warning}{row['static_load_N']:g} N, {shaft}, at {row['excitation_Hz']:g} Hz: {row['quality']}"
        )
    return sentences


def _flags(row: Mapping[Any, Any], reasons: str) -> str:
    """Named conditions of a row with what forbids trust, each once; ``"ok"`` if there is nothing."""
    texts = reasons.split("; ")
    quality = row.get("quality", row.get("status"))
    if isinstance(quality, str):
        texts = quality.split("; ") + texts
    return "; ".join(dict.fromkeys(text for text in texts if text not in ("", "ok"))) or "ok"


def _distrust(row: Mapping[Any, Any]) -> str:
    """Say why a row of coefficients is not to be trusted.

    A film's direct stiffness and damping are positive by the sign convention of CONTRIBUTING; a wrong polarity of a
    probe or cell turns the sign of one or of all of them.
    """
    reasons = errors_in(row.get("quality"))
    if str(row.get("converged")) == "False":
        reasons.append("the model did not converge")
    for name in ("kxx", "kyy", "cxx", "cyy"):
        column = COLUMNS[name]
        value, high = float(row[column]), float(row.get(f"{column}_hi", math.nan))
        kind = KINDS[name[0]]
        if (high if math.isfinite(high) else value) < 0:
            size = f"{value / kind.display_scale:.4g} {kind.display_unit}"
            reasons.append(f"{name} is negative ({size}): check polarity and axes of probes and cells")
    return "; ".join(reasons)


#: Versions of ROSS whose files are written.
ROSS_VERSIONS = (2, 3)
#: Programs whose files hold no intervals and flags (a table beside them does), and whose shafts turn counter-clockwise.
ROTOR_PROGRAMS = ("ross", "xltrc", "dyrobes", "ansys")
_BY_SPEED = "this program knows K and C over shaft speed only: one file per excitation frequency."
#: Every form of export, and what its user must know.
FORMATS = {
    "ross": "ROSS extrapolates outside the speeds and frequencies given; K holds Re h, there are no masses.",
    **dict.fromkeys(("csv", "parquet", "excel", "mat"), ""),
    **dict.fromkeys(("xltrc", "dyrobes", "ansys"), _BY_SPEED),
}


def check_format(name: str) -> None:
    """Refuse a form that is not known, or that cannot be written in the units in use."""
    if name not in FORMATS:
        raise ExportError(f"format {name!r} is not known. {hint(name, FORMATS, 'Use one of')}")
    if name == "ross" and in_us_units():
        raise ExportError(f"US units: the format {name} is SI, all that its program reads. Leave US units out.")
