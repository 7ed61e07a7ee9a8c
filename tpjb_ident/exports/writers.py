"""The forms in which coefficients leave: tables with their intervals, and files of rotordynamic programs.

Programs of rotors take K and C of one static load over shaft speed, excitation or both, in one frame of text. One that
knows one set of K and C per speed gets a file per excitation frequency; ROSS 2 one per static point, over excitation;
ROSS 3 both axes where all speeds were run at the same frequencies. Each head says what a file holds.
"""

from __future__ import annotations

import functools
import importlib.metadata
import io
import math
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import jinja2
import numpy as np
import pandas as pd

from rigdata.arrays import FloatArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, in_us_units
from tpjb_ident.exports.formats import COLUMNS, ENDS, ROSS_VERSIONS, ExportError, flags
from tpjb_ident.presentation import UNITS, us_table
from tpjb_ident.runtime import tables
from tpjb_ident.runtime.tables import printable, write_atomic, write_text
from tpjb_ident.schema import KINDS, STATIC_KEY, with_endings

NAME = "bearing_coefficients"
#: Beside files of a form that holds no intervals.
INTERVALS = f"{NAME}_intervals"
_TIME, _NO_TIME = re.compile(rb"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:.]+Z"), b"1980-01-01T00:00:00Z"
#: Text at the start of a MATLAB file, in place of one with the time.
_MAT_HEAD = b"MATLAB 5.0 MAT-file, written by tpjb-ident".ljust(116)
#: Matrices of a MATLAB file: K, C and the ends of their intervals.
_MATRICES = ("K", "C", "K_lo", "K_hi", "C_lo", "C_hi")
_HZ = 2.0 * np.pi
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    undefined=jinja2.StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=True,
    lstrip_blocks=True,
)


def _coefficient_table(points: pd.DataFrame) -> pd.DataFrame:
    """The table as it leaves: speed in rpm, frequency in rad/s."""
    place = ["static_load_N", "static_load_direction_deg", "shaft_speed_rpm", "rotation", "frequency_rad_per_s"]
    speed, frequency = 60 * points["shaft_speed_Hz"], _HZ * points["excitation_Hz"]
    rates = points.assign(shaft_speed_rpm=speed, frequency_rad_per_s=frequency)
    return rates[[*place, *with_endings(*ENDS), "quality", "trusted"]]


def write_csv(folder: Path, points: pd.DataFrame, source: str, name: str = NAME) -> None:
    """Write bearing_coefficients.csv into an existing folder, or the same table under another name."""
    tables.write_csv(folder / f"{name}.csv", _coefficient_table(points))


def write_us(folder: Path, points: pd.DataFrame, name: str) -> None:
    """Write the same table in US units, beside what stays SI."""
    tables.write_csv(folder / f"{name}_us.csv", us_table(_coefficient_table(points)))


def write_parquet(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.parquet; the source stands in the table's metadata."""
    frame = _coefficient_table(points)
    write_atomic(folder / f"{NAME}.parquet", lambda part: tables.write_parquet(part, frame, source=printable(source)))


def write_excel(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.xlsx: all coefficients on one sheet, what they are on another.

    Every text is written as text, so that no cell from outside can become a formula. Rows that are not to be trusted
    are red.
    """
    try:
        import openpyxl.styles
    except ModuleNotFoundError as error:
        raise ExportError('an Excel file needs openpyxl. Install it: pip install "tpjb-ident[excel]"') from error
    frame = _coefficient_table(points)
    lines = [
        printable(source),
        "K = Re h, C = Im h / omega at the excitation frequency; SI units.",
        "frequency_rad_per_s is the excitation; the shaft speed is constant along it.",
        "_lo and _hi: 95 % interval, random and calibration errors together; empty for a prediction.",
        "quality: named conditions, explained in the report; trusted: FALSE was exported against advice.",
        *flags(points),
    ]
    content = io.BytesIO()
    with pd.ExcelWriter(content, engine="openpyxl") as writer:
        frame.to_excel(writer, sheet_name="coefficients", index=False, freeze_panes=(1, 0))
        pd.DataFrame(lines).to_excel(writer, sheet_name="about", index=False, header=False)
        sheet = writer.sheets["coefficients"]
        for column in sheet.columns:
            sheet.column_dimensions[column[0].column_letter].width = max(12, len(str(column[0].value)) + 2)
        for row, trusted in zip(sheet.iter_rows(min_row=2), frame["trusted"], strict=True):
            for cell in row if not trusted else ():
                cell.font = openpyxl.styles.Font(color="C00000")
        for row in (*sheet.rows, *writer.sheets["about"].rows):
            for cell in row:
                if isinstance(cell.value, str):
                    cell.data_type = "s"  # openpyxl would take a leading = for a formula

    def write(part: Path) -> None:
        """Without the times of its making: the same results are the same bytes."""
        with zipfile.ZipFile(content) as archive, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as written:
            for name in archive.namelist():
                entry = archive.read(name)
                entry = _TIME.sub(_NO_TIME, entry) if name == "docProps/core.xml" else entry
                written.writestr(zipfile.ZipInfo(name), entry, zipfile.ZIP_DEFLATED)

    write_atomic(folder / f"{NAME}.xlsx", write)


def write_mat(folder: Path, points: pd.DataFrame, source: str) -> None:
    """Write bearing_coefficients.mat (MATLAB 5): struct array ``bearing``.

    K and C are 2 x 2 x n, so are ``K_lo``, ``K_hi``, ``C_lo``, ``C_hi``, the ends of their 95 % intervals (NaN where
    there are none); ``quality`` is a cell array of n texts, ``trusted`` n truth values.
    """
    from scipy.io import savemat

    members = []
    for (load, direction, speed, rotation), rows in points.groupby(list(STATIC_KEY)):
        member = {
            "load_N": load,
            "direction_deg": direction,
            "speed_Hz": speed,
            "frequency_rad_per_s": _HZ * rows["excitation_Hz"].to_numpy(),
        }
        for name in _MATRICES:
            columns = [column + name[1:] for column in KINDS[name[0].lower()].columns]
            member[name] = rows[columns].to_numpy().T.reshape(2, 2, -1)
        member["quality"] = np.array([printable(text) for text in rows["quality"]], dtype=object)
        members.append(member | {"trusted": rows["trusted"].to_numpy(), "rotation": rotation})
    array = np.array([tuple(member.values()) for member in members], dtype=[(name, object) for name in members[0]])
    content = {"bearing": array, "source": printable(source)}
    file = io.BytesIO()
    savemat(file, content, oned_as="column", appendmat=False)
    timeless = _MAT_HEAD + file.getvalue()[len(_MAT_HEAD) :]
    write_atomic(folder / f"{NAME}.mat", lambda part: part.write_bytes(timeless))


@dataclass(frozen=True, repr=False)
class Grid:
    """What one file holds: coefficients of one static load over n shaft speeds and m excitation frequencies."""

    rows: pd.DataFrame  #: n m of them, by speed and frequency

    @functools.cached_property
    def speed(self) -> FloatArray:
        """(n,) [Hz]."""
        return self.rows["shaft_speed_Hz"].unique()

    @functools.cached_property
    def excitation(self) -> FloatArray:
        """(m,) [Hz]; NaN where it is the running speed."""
        if len(self.rows) == len(self.speed) and (self.rows["line"] == _SYNCHRONOUS).all():
            return np.full(1, np.nan)
        return self.rows["excitation_Hz"].to_numpy()[: len(self.rows) // len(self.speed)]

    @property
    def values(self) -> FloatArray:
        """(n, m, 8) kxx .. kyy [N/m], cxx .. cyy [N s/m]."""
        return self.rows[list(COLUMNS.values())].to_numpy().reshape(len(self.speed), len(self.excitation), -1)

    @property
    def mirrored(self) -> bool:
        """Whether this is the mirror image, of a shaft that turns clockwise."""
        return bool(self.rows["mirrored"].iloc[0])

    @property
    def place(self) -> tuple[float, float]:
        """Load [N] and its direction [deg]."""
        return self.rows["static_load_N"].iloc[0], self.rows["static_load_direction_deg"].iloc[0]

    def name(self, *parts: str) -> str:
        """Name of the file, of its load and what else tells it from the others."""
        load, direction = self.place
        mirrored = ("mirrored",) if self.mirrored else ()
        return "_".join((f"{load:.0f}N", f"{direction:g}deg", *parts, *mirrored))

    @property
    def line(self) -> str:
        """The one excitation frequency of a table over speed."""
        return "synchronous" if np.isnan(self.excitation[0]) else f"{self.excitation[0]:g}Hz"

    def remarks(self, source: str) -> list[str]:
        """The head: source, what it is, where intervals are, and what is not to be trusted."""
        load, direction = self.place
        parts = ["mirrored, x to -x"] if self.mirrored else []
        parts.append(f"static load {amount(load, 'force', '.6g')} at {direction:g} deg")
        if len(self.excitation) == 1:
            line = "the running speed" if self.line == "synchronous" else f"{self.excitation[0]:g} Hz"
            parts.append(f"excitation at {line}")
        if len(self.speed) == 1:
            parts.append(f"shaft speed {60 * self.speed[0]:g} rpm")
        doubtful = self.rows.loc[~self.rows["trusted"], "shaft_speed_Hz"].unique()
        speeds = ", ".join(f"{60 * speed:.6g}" for speed in doubtful)
        remarks = [printable(source).replace("\n", " "), ", ".join(parts)]
        if speeds:
            remarks.append(f"NOT TO BE TRUSTED at {speeds} rpm")
        remarks.append(f"intervals and flags: {INTERVALS}{'_us' if in_us_units() else ''}.csv")
        if self.mirrored:
            remarks.append("the rig's shaft turns clockwise: here, and in the intervals, it turns counter-clockwise")
        return remarks


def grids(points: pd.DataFrame, axes: str) -> list[Grid]:
    """Sort points by load and direction into files over ``"speed"``, ``"excitation"`` or ``"both"``."""
    parts = []
    for _, rows in points.groupby(["static_load_N", "static_load_direction_deg", "mirrored"]):
        frequency, speed = rows["excitation_Hz"].map(_rounded), rows["shaft_speed_Hz"].map(_rounded)
        line = frequency.mask(frequency == speed, _SYNCHRONOUS)
        # all speeds were run at the same frequencies
        is_grid = frequency.nunique() * speed.nunique() == len(rows)
        rows = rows.assign(line=line).sort_values(["shaft_speed_Hz", "excitation_Hz"])
        if axes == "both" and (is_grid or (line == _SYNCHRONOUS).all()):
            parts.append(Grid(rows))
        else:
            for _, part in rows.groupby("line" if axes == "speed" else "shaft_speed_Hz"):
                parts.append(Grid(part))
    return parts


def _rounded(frequency: float) -> float:
    """A frequency to the digits by which two are told apart."""
    return float(f"{frequency:.7g}")


#: Line of the running speed, at which files over speed are told apart from those at a frequency.
_SYNCHRONOUS = -1.0


def ross_version(chosen: int | None = None) -> tuple[int, str]:
    """Version of ROSS to write for, and why: the chosen one, the installed one, else the newest."""
    if chosen is not None:
        return chosen, "as chosen"
    try:
        installed = int(importlib.metadata.version("ross-rotordynamics").split(".")[0])
    except (importlib.metadata.PackageNotFoundError, ValueError):
        return ROSS_VERSIONS[-1], "the newest that is known; none is installed"
    return min(max(installed, ROSS_VERSIONS[0]), ROSS_VERSIONS[-1]), "the one that is installed"


def write_ross(folder: Path, points: pd.DataFrame, source: str, version: int | None = None) -> None:
    """Write one TOML file per element, which ``ross.BearingElement.load`` reads: Re h stands as K, there is no mass."""
    number, reason = ross_version(version)
    for grid in grids(points, "excitation" if number == 2 else "both"):
        speed = f"{grid.speed[0]:g}Hz" if len(grid.speed) == 1 else "speeds"
        tag = grid.name(speed, "excitation" if len(grid.excitation) > 1 or len(grid.speed) == 1 else grid.line)
        axes = {"speed": _HZ * grid.speed, "frequency": _HZ * grid.excitation}
        arrays = {axis: values.tolist() for axis, values in axes.items() if len(values) > 1}
        values = grid.values if len(arrays) == 2 else grid.values.reshape(-1, len(COLUMNS))
        arrays |= {name: values[..., i].tolist() for i, name in enumerate(COLUMNS)}
        remarks = [printable(remark) for remark in [*grid.remarks(source), *flags(grid.rows)]]
        fields = {"remarks": remarks, "number": number, "reason": reason, "tag": tag, "arrays": arrays}
        _write(folder / f"ross_{tag}.toml", "ross", fields)


def _write_by_speed(program: str, folder: Path, points: pd.DataFrame, source: str) -> None:
    """One file per load and excitation frequency."""
    per_metre = UNITS["N_per_m"][1] if in_us_units() else 1.0
    for grid in grids(points, "speed"):
        rows = np.column_stack([60.0 * grid.speed, grid.values[:, 0] / per_metre]).tolist()
        fields = {"rows": rows, "remarks": grid.remarks(source), "names": list(COLUMNS), "us": in_us_units()}
        _write(folder / f"{program}_{grid.name(grid.line)}.txt", program, fields)


write_xltrc = functools.partial(_write_by_speed, "xltrc")
write_dyrobes = functools.partial(_write_by_speed, "dyrobes")
write_ansys = functools.partial(_write_by_speed, "ansys")


def _write(path: Path, form: str, fields: Mapping[str, Any]) -> None:
    write_text(path, _TEMPLATES.get_template(f"{form}.jinja").render(fields))


def write_ross_bearing(folder: Path, bearing: Any, version: int | None = None) -> None:
    """Write ross_bearing.py: a function of node, speed and load that gives a ``ross.TiltingPad``."""
    clockwise = bearing.rotation == ROTATIONS[1]
    if clockwise:  # oil goes round the ring in the order of the pads
        bearing = bearing.with_pads(bearing.pads[::-1])
    number, reason = ross_version(version)
    pads = bearing.pads
    angles = list(bearing.pivot_angles)
    assembled = fmean(bearing.clearances)  # that ROSS takes: preloads give each its own
    fields = {
        "name": printable(bearing.name),
        "number": number,
        "reason": reason,
        "clockwise": clockwise,
        "bearing": bearing,
        "clearance": assembled,
        "preloads": [1.0 - assembled / pad.pad_clearance for pad in pads],
        "thickness": fmean(pad.thickness for pad in pads),
        "angles": [math.pi - angle for angle in angles] if clockwise else angles,
        "viscosity_100": float(bearing.oil.viscosity(100.0)),
    }
    _write(folder / "ross_bearing.py", "ross_bearing", fields)
