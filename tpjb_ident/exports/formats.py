"""Coefficients sorted by static point, as every export wants them, and the forms in which they leave.

A new form is a file with a writer and a line in `FORMATS`. Programs of rotors take a shaft that turns counter-clockwise
for granted: what was measured on another one is mirrored for them.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rigdata.near_names import nearest_name
from tpjb_ident.columns import in_us_units, place_of
from tpjb_ident.condition_kinds import ERRORS
from tpjb_ident.errors import TpjbError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, KINDS, POINT_COLUMNS, STATIC_COLUMNS

if TYPE_CHECKING:  # numpy too is imported late: the command line asks for the names of the formats
    import pandas as pd

    from rigdata.arrays import BoolArray, FloatArray


class ExportError(TpjbError):
    """What was given cannot be exported; says which format, column or point, and what to do."""


COLUMNS = {name[:3]: name for name in COEFFICIENT_COLUMNS}
CROSS = ("kxy", "kyx", "cxy", "cyx")
_ROTATION, _COUNTER_CLOCKWISE = "rotation", "counter-clockwise"


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
    rotation : str
        ``"counter-clockwise"`` or ``"clockwise"``, of the shaft in the frame of the coefficients.
    mirrored : bool
        Whether that frame is the mirror image of the rig's, x to -x.
    """

    load: float
    direction: float
    speed: float
    frequency: FloatArray = field(repr=False)
    coefficients: dict[str, FloatArray] = field(repr=False)
    low: dict[str, FloatArray] = field(repr=False)
    high: dict[str, FloatArray] = field(repr=False)
    quality: tuple[str, ...]
    trusted: BoolArray = field(repr=False)
    rotation: str = _COUNTER_CLOCKWISE
    mirrored: bool = False

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
    usable = frame[finite].assign(_reasons=[_distrust(row) for _, row in frame[finite].iterrows()])
    trusted = usable["_reasons"] == ""
    doubtful = tuple(f"{_place(row)}: {row['_reasons']}" for _, row in usable[~trusted].iterrows())
    exported = usable if force else usable[trusted]
    if _ROTATION not in exported:
        exported = exported.assign(**{_ROTATION: _COUNTER_CLOCKWISE})
    points = [_point(keys, group) for keys, group in exported.groupby([*STATIC_COLUMNS, _ROTATION], sort=True)]
    return Chosen(tuple(points), left_out, doubtful)


def _place(row: pd.Series) -> str:
    return place_of(row["static_load_N"], row["excitation_Hz"])


def _point(keys: tuple[Any, ...], group: pd.DataFrame) -> StaticPoint:
    load, direction, speed = (float(key) for key in keys[:3])
    ordered = group.sort_values("excitation_Hz")
    if ordered["excitation_Hz"].duplicated().any():
        raise ExportError(f"the point {load:g} N stands twice at one frequency. Export one method at a time.")
    omega = 2 * math.pi * ordered["excitation_Hz"].to_numpy(dtype=float)
    values, low, high = (_coefficients(ordered, end) for end in ("", "_lo", "_hi"))
    column = "quality" if "quality" in ordered else "status"
    texts = list(ordered[column]) if column in ordered else [""] * len(ordered)
    flags = tuple(_with_reasons(text, reason) for text, reason in zip(texts, ordered["_reasons"], strict=True))
    trusted = (ordered["_reasons"] == "").to_numpy(bool)
    return StaticPoint(load, direction, speed, omega, values, low, high, flags, trusted, str(keys[3]))


def turning_counter_clockwise(point: StaticPoint) -> StaticPoint:
    """Give a point in a frame in which its shaft turns counter-clockwise: x to -x where it does not."""
    if point.rotation == _COUNTER_CLOCKWISE:
        return point
    ends = ((point.coefficients, point.coefficients), (point.low, point.high), (point.high, point.low))
    values, low, high = (end | {name: -opposite[name] for name in CROSS} for end, opposite in ends)
    direction = (180.0 - point.direction + 180.0) % 360.0 - 180.0
    return replace(
        point, direction=direction, coefficients=values, low=low, high=high, rotation=_COUNTER_CLOCKWISE, mirrored=True
    )


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


#: Versions of ROSS whose files are written.
ROSS_VERSIONS = (2, 3)
#: Writes points into an existing folder; the text says where they come from. ROSS's takes a version as well.
Writer = Callable[..., None]


@dataclass(frozen=True)
class Format:
    """One form of export; its writer puts files of some points into an existing folder.

    A writer is called with the folder, the points (tuple of StaticPoint) and a text that says where they come from.

    Attributes
    ----------
    module, function : str
        Where its writer is; imported when it is used.
    of_rotors : bool
        Whether it is a rotor program's: its files hold no intervals and flags (a table beside them does), and its
        shafts turn counter-clockwise.
    note : str
        What its user must know.
    only_si : bool
        Whether its program takes numbers in SI alone, so that US units are refused.
    """

    module: str
    function: str
    of_rotors: bool = False
    note: str = ""
    only_si: bool = False

    @property
    def writer(self) -> Writer:
        """The function that writes it."""
        writer: Writer = getattr(importlib.import_module(f"tpjb_ident.exports.{self.module}"), self.function)
        return writer


_BY_SPEED = "this program knows K and C over shaft speed only: one file per excitation frequency."
_ROSS = "ROSS extrapolates outside the speeds and frequencies given; K holds Re h, there are no masses."


FORMATS: dict[str, Format] = {
    "ross": Format("rotor_programs", "write_ross", True, _ROSS, only_si=True),
    "csv": Format("table", "write_csv"),
    "parquet": Format("table", "write_parquet"),
    "excel": Format("table", "write_excel"),
    "mat": Format("table", "write_mat"),
    "xltrc": Format("rotor_programs", "write_xltrc", True, _BY_SPEED),
    "dyrobes": Format("rotor_programs", "write_dyrobes", True, _BY_SPEED),
    "ansys": Format("rotor_programs", "write_ansys", True, _BY_SPEED),
}


def export_format(name: str) -> Format:
    """Format of a name, if it can be written in the units in use."""
    if name not in FORMATS:
        near = nearest_name(name, FORMATS)
        hint = f"Did you mean {near!r}?" if near else f"Use one of {', '.join(FORMATS)}."
        raise ExportError(f"--to: {name!r} is not known. {hint}")
    if FORMATS[name].only_si and in_us_units():
        raise ExportError(f"--units us: --to {name} writes SI, all that its program reads. Leave --units us out.")
    return FORMATS[name]
