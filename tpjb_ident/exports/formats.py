"""Coefficients sorted by static point, as every export wants them, and the forms in which they leave.

A new form is a file with a writer and a line in `FORMATS`.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigdata.near_names import nearest_name
from tpjb_ident.condition_kinds import ERRORS
from tpjb_ident.errors import TpjbError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, KINDS, POINT_COLUMNS, STATIC_COLUMNS

if TYPE_CHECKING:  # numpy too is imported late: the command line asks for the names of the formats
    import pandas as pd

    from rigdata.arrays import BoolArray, FloatArray


class ExportError(TpjbError):
    """What was given cannot be exported; says which format, column or point, and what to do."""


COLUMNS = {name[:3]: name for name in COEFFICIENT_COLUMNS}


def _no_frequencies() -> BoolArray:
    import numpy as np

    return np.zeros(0, bool)


@dataclass(frozen=True)
class StaticPoint:
    """Coefficients of one static load and speed over excitation frequency.

    Attributes
    ----------
    load : float
        [N]
    direction : float
        [deg]
    speed : float
        [Hz]
    frequency : (n,) ndarray
        Excitation [rad/s], rising.
    coefficients : dict of str to (n,) ndarray
        ``"kxx"`` .. ``"cyy"`` [N/m], [N s/m].
    low, high : dict of str to (n,) ndarray
        Ends of their 95 % intervals; NaN where the table has none, as of a prediction.
    quality : tuple of str
        Per frequency the named conditions, ``"ok"`` if there are none.
    trusted : (n,) bool ndarray
        False where the coefficients are exported against advice.
    """

    load: float
    direction: float
    speed: float
    frequency: FloatArray = field(repr=False)
    coefficients: dict[str, FloatArray] = field(repr=False)
    low: dict[str, FloatArray] = field(repr=False)
    high: dict[str, FloatArray] = field(repr=False)
    quality: tuple[str, ...] = ()
    trusted: BoolArray = field(repr=False, default_factory=_no_frequencies)

    @property
    def tag(self) -> str:
        """Name that says what the frequency axis means."""
        return f"{self.load:.0f}N_{self.direction:g}deg_{self.speed:g}Hz_excitation"

    @property
    def flags(self) -> tuple[str, ...]:
        """A sentence per frequency that has something against it."""
        flags = []
        for omega, text, trusted in zip(self.frequency, self.quality, self.trusted, strict=True):
            if text != "ok":
                warning = "" if trusted else "NOT TO BE TRUSTED, "
                flags.append(f"{warning}at {omega / (2 * math.pi):g} Hz: {text}")
        return tuple(flags)


@dataclass(frozen=True)
class Chosen:
    """What of a table can leave: the points, and where others stand, those that are doubtful with the reasons."""

    points: tuple[StaticPoint, ...]
    left_out: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()


def static_points(frame: pd.DataFrame, force: bool = False) -> Chosen:
    """Sort a coefficient table by static point; what is not to be trusted stays behind."""
    needed = [*POINT_COLUMNS, *COLUMNS.values()]
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise ExportError(f"the table has no column {missing[0]}. Give a coefficients.csv or prediction.csv of tpjb.")
    import numpy as np

    finite = np.isfinite(frame[needed].to_numpy(dtype=float)).all(axis=1)
    left_out = tuple(_place(row) for _, row in frame[~finite].iterrows())
    if not finite.any():
        raise ExportError("no point of the table has finite coefficients. Identify or predict again.")
    usable = frame[finite]
    reasons, doubtful = [], []
    for _, row in usable.iterrows():
        reasons.append(_distrust(row))
        if reasons[-1]:
            doubtful.append(f"{_place(row)}: {reasons[-1]}")
    usable = usable.assign(_trusted=[not reason for reason in reasons], _reasons=reasons)
    exported = usable if force else usable[usable["_trusted"]]
    points = [_point(keys, group) for keys, group in exported.groupby(list(STATIC_COLUMNS), sort=True)]
    return Chosen(tuple(points), left_out, tuple(doubtful))


def _place(row: pd.Series) -> str:
    return f"{row['static_load_N']:g} N, {row['excitation_Hz']:g} Hz"


def _point(keys: tuple[float, float, float], group: pd.DataFrame) -> StaticPoint:
    load, direction, speed = (float(key) for key in keys)
    ordered = group.sort_values("excitation_Hz")
    if ordered["excitation_Hz"].duplicated().any():
        raise ExportError(f"the point {load:g} N stands twice at one frequency. Export one method at a time.")
    omega = 2 * math.pi * ordered["excitation_Hz"].to_numpy(dtype=float)
    values, low, high = (_coefficients(ordered, end) for end in ("", "_lo", "_hi"))
    column = "quality" if "quality" in ordered else "status"
    texts = list(ordered[column]) if column in ordered else [""] * len(ordered)
    flags = tuple(_with_reasons(text, reason) for text, reason in zip(texts, ordered["_reasons"], strict=True))
    trusted = ordered["_trusted"].to_numpy(bool)
    return StaticPoint(load, direction, speed, omega, values, low, high, flags, trusted)


def _coefficients(table: pd.DataFrame, end: str) -> dict[str, FloatArray]:
    """Columns of K and C with an ending, NaN where the table has none."""
    import numpy as np

    empty = np.full(len(table), np.nan)
    columns = {short: name + end for short, name in COLUMNS.items()}
    return {s: table[name].to_numpy(dtype=float) if name in table else empty for s, name in columns.items()}


def _with_reasons(quality: object, reasons: str) -> str:
    """Named conditions of a row with what forbids trust, each once; ``"ok"`` if there is nothing."""
    names = quality.split("; ") if isinstance(quality, str) and quality not in ("", "ok") else []
    names += [reason for reason in reasons.split("; ") if reason]
    return "; ".join(dict.fromkeys(names)) or "ok"


def _distrust(row: Mapping[str, Any]) -> str:
    """Say why a row of coefficients is not to be trusted.

    A film's direct stiffness and damping are positive by the sign convention of CONTRIBUTING; a wrong polarity of a
    probe or cell turns the sign of one or of all of them.
    """
    quality = row.get("quality")
    reasons = [name for name in quality.split("; ") if name in ERRORS] if isinstance(quality, str) else []
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


#: Writes points into an existing folder; the text says where they come from.
Writer = Callable[[Path, tuple[StaticPoint, ...], str], None]


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
