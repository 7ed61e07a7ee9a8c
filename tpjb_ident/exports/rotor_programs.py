"""Rotordynamic programs: K and C of one static load over shaft speed, excitation or both, in one frame of text.

A program that knows one set of K and C per speed gets a file per excitation frequency; ROSS 2 one per static point,
over excitation; ROSS 3 both axes where all speeds were run at the same frequencies. Each head says what a file holds.
"""

from __future__ import annotations

import functools
import importlib.metadata
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, in_us_units
from tpjb_ident.exports.formats import COLUMNS, ROSS_VERSIONS, flags
from tpjb_ident.exports.table import INTERVALS
from tpjb_ident.presentation import UNITS
from tpjb_ident.runtime.tables import printable, write_text

if TYPE_CHECKING:
    import pandas as pd

_HZ = 2.0 * np.pi
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    undefined=jinja2.StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=True,
    lstrip_blocks=True,
)


@dataclass(frozen=True, repr=False)
class Grid:
    """What one file holds: coefficients of one static load over n shaft speeds and m excitation frequencies."""

    rows: pd.DataFrame  #: n m of them, by speed and frequency

    @functools.cached_property
    def speed(self) -> FloatArray:
        """(n,) [Hz]."""
        return np.asarray(self.rows["shaft_speed_Hz"].unique())

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
        parts.append(f"static load {amount(load, 'force')} at {direction:g} deg")
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
        frequency, speed = (rows[name].map(_rounded) for name in ("excitation_Hz", "shaft_speed_Hz"))
        line = frequency.mask(frequency == speed, _SYNCHRONOUS)
        # all speeds were run at the same frequencies
        is_grid = frequency.nunique() * speed.nunique() == len(rows)
        rows = rows.assign(line=line).sort_values(["shaft_speed_Hz", "excitation_Hz"])
        if axes == "both" and (is_grid or (line == _SYNCHRONOUS).all()):
            parts.append(rows)
        else:
            parts += [part for _, part in rows.groupby("line" if axes == "speed" else "shaft_speed_Hz")]
    return [Grid(part) for part in parts]


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
        remarks = grid.remarks(source)
        for hz in grid.speed:
            remarks += [f"{60 * hz:g} rpm, {flag}" for flag in flags(grid.rows[grid.rows["shaft_speed_Hz"] == hz])]
        axes = {"speed": _HZ * grid.speed, "frequency": _HZ * grid.excitation}
        arrays = {axis: values.tolist() for axis, values in axes.items() if len(values) > 1}
        values = grid.values if len(arrays) == 2 else grid.values.reshape(-1, len(COLUMNS))
        arrays |= {name: values[..., i].tolist() for i, name in enumerate(COLUMNS)}
        remarks = [printable(remark) for remark in remarks]
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
    angles = [pad.pivot_angle for pad in bearing.pads]
    assembled = fmean(pad.assembled_clearance for pad in bearing.pads)  # that ROSS takes: preloads give each its own
    fields = {
        "name": printable(bearing.name),
        "number": number,
        "reason": reason,
        "remarks": [printable(remark) for remark in _not_held(bearing, number)],
        "bearing": bearing,
        "clearance": assembled,
        "preloads": [1.0 - assembled / pad.pad_clearance for pad in bearing.pads],
        "thickness": fmean(pad.thickness for pad in bearing.pads),
        "angles": [math.pi - angle for angle in angles] if clockwise else angles,
        "viscosity_100": float(bearing.oil.viscosity(100.0)),
    }
    _write(folder / "ross_bearing.py", "ross_bearing", fields)


def _not_held(bearing: Any, version: int) -> list[str]:
    """What a call of `TiltingPad` loses of a bearing."""
    pads = bearing.pads
    remarks = [
        f"pivots ({bearing.pivot.kind}): rigid here; no law per pad, and none that was measured",
        "mass of pads, their bending, heat into them, thermal expansion of the oil",
    ]
    if bearing.rotation == ROTATIONS[1]:
        remarks.append("the sense of the drawing, clockwise: this is its mirror image, x to -x, last pad first")
    if len({pad.assembled_clearance for pad in pads}) > 1:
        clearances = ", ".join(f"{1e6 * pad.assembled_clearance:.4g}" for pad in pads)
        remarks.append(f"assembled clearance by pad ({clearances} um): the mean stands for all")
    if len({pad.thickness for pad in pads}) > 1:
        remarks.append("thickness by pad: the mean stands for all")
    if version == 2 and len({(pad.arc, pad.pivot_offset, pad.pad_clearance) for pad in pads}) > 1:
        remarks.append("pads that differ: ROSS 2 takes arc, offset and preload of the first for all")
    return remarks
