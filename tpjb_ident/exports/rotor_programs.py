"""Rotordynamic programs: K and C of one static load over shaft speed, excitation or both, in one frame of text.

A program that knows one set of K and C per speed gets a file per excitation frequency; ROSS 2 one per static point,
over excitation; ROSS 3 both axes where all speeds were run at the same frequencies. Each head says what a file holds.
"""

from __future__ import annotations

import functools
import importlib.metadata
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.columns import amount, in_us_units
from tpjb_ident.exports.formats import COLUMNS, ROSS_VERSIONS, StaticPoint
from tpjb_ident.exports.table import INTERVALS
from tpjb_ident.runtime.tables import printable, write_text
from tpjb_ident.us_table import UNITS

_HZ = 2.0 * math.pi
#: Excitation frequencies that differ by less than this share are one.
_SAME = 1e-6


@dataclass(frozen=True)
class Grid:
    """What one file holds: coefficients of one static load over n shaft speeds and m excitation frequencies."""

    load: float  #: [N]
    direction: float  #: [deg]
    mirrored: bool
    speed: FloatArray = field(repr=False)  #: (n,) [Hz]
    excitation: FloatArray = field(repr=False)  #: (m,) [rad/s]; NaN where it is the running speed
    values: FloatArray = field(repr=False)  #: (n, m, 8) kxx .. kyy [N/m], cxx .. cyy [N s/m]
    trusted: BoolArray = field(repr=False)  #: (n, m)
    flags: tuple[str, ...] = field(repr=False, default=())

    def name(self, *parts: str) -> str:
        """Name of the file, of its load and what else tells it from the others."""
        return "_".join((f"{self.load:.0f}N", f"{self.direction:g}deg", *parts))

    @property
    def line(self) -> str:
        """The one excitation frequency of a table over speed."""
        return "synchronous" if np.isnan(self.excitation[0]) else f"{self.excitation[0] / _HZ:g}Hz"

    def remarks(self, source: str) -> list[str]:
        """The head: source, what it is, where intervals are, and what is not to be trusted."""
        parts = ["mirrored, x to -x"] if self.mirrored else []
        parts.append(f"static load {amount(self.load, 'force')} at {self.direction:g} deg")
        if len(self.excitation) == 1:
            line = "the running speed" if self.line == "synchronous" else f"{self.excitation[0] / _HZ:g} Hz"
            parts.append(f"excitation at {line}")
        if len(self.speed) == 1:
            parts.append(f"shaft speed {60 * self.speed[0]:g} rpm")
        speeds = ", ".join(f"{60 * speed:.6g}" for speed in self.speed[~self.trusted.all(axis=1)])
        warning = [f"NOT TO BE TRUSTED at {speeds} rpm"] if speeds else []
        remarks = [
            printable(source).replace("\n", " "),
            ", ".join(parts),
            *warning,
            f"intervals and flags: {INTERVALS}{'_us' if in_us_units() else ''}.csv",
        ]
        if self.mirrored:
            remarks.append("the rig's shaft turns clockwise: here, and in the intervals, it turns counter-clockwise")
        return remarks

    def rows(self, separator: str) -> list[str]:
        """One line per speed: rpm and the eight coefficients at the first excitation."""
        lines = []
        for speed, values in zip(self.speed, self.values[:, 0], strict=True):
            lines.append(separator.join([f"{60.0 * speed:.6g}", *(f"{value:.8e}" for value in values)]))
        return lines


def grids(points: Sequence[StaticPoint], axes: str) -> list[Grid]:
    """Sort points by load and direction into files over ``"speed"``, ``"excitation"`` or ``"both"``."""
    static = attrgetter("load", "direction", "mirrored")
    made = []
    for _, at_load in itertools.groupby(sorted(points, key=lambda point: (static(point), point.speed)), static):
        members = list(at_load)
        whole = [(point, np.s_[:]) for point in members]
        lines = [_lines(point) for point in members]
        if axes == "speed":
            for line in sorted(set().union(*map(set, lines))):
                rows = [(point, own == line) for point, own in zip(members, lines, strict=True) if line in own]
                made.append(_grid(rows, np.array([math.nan if line == _SYNCHRONOUS else line])))
        elif axes == "both" and _all_alike([point.frequency for point in members]):
            made.append(_grid(whole, members[0].frequency))
        elif axes == "both" and _all_alike(lines) and lines[0].tolist() == [_SYNCHRONOUS]:
            made.append(_grid(whole, np.array([math.nan])))
        else:
            made += [_grid([row], row[0].frequency) for row in whole]
    return made


_SYNCHRONOUS = -1.0


def _lines(point: StaticPoint) -> FloatArray:
    """Excitation frequencies by which files over speed are told apart: the running speed is one."""
    synchronous = np.abs(point.frequency - _HZ * point.speed) < _SAME * point.frequency
    return np.where(synchronous, _SYNCHRONOUS, np.round(point.frequency, 9))


def _all_alike(axes: Sequence[FloatArray]) -> bool:
    first = axes[0]
    return all(len(axis) == len(first) and np.allclose(axis, first, rtol=_SAME, atol=0.0) for axis in axes)


def _grid(rows: Sequence[tuple[StaticPoint, slice | BoolArray]], excitation: FloatArray) -> Grid:
    """Grid of points, of each at some of its frequencies."""
    values = [np.array([point.coefficients[name][chosen] for name in COLUMNS]).T for point, chosen in rows]
    flags = []
    for point, _ in rows:
        flags += [f"{60 * point.speed:g} rpm, {flag}" for flag in point.flags]
    first = rows[0][0]
    return Grid(
        first.load, first.direction, first.mirrored,
        np.array([point.speed for point, _ in rows]), excitation,
        np.array(values), np.array([point.trusted[chosen] for point, chosen in rows]), tuple(flags),
    )  # fmt: skip


def ross_version(chosen: int | None = None) -> tuple[int, str]:
    """Version of ROSS to write for, and why: the chosen one, the installed one, else the newest."""
    if chosen is not None:
        return chosen, "as chosen"
    try:
        installed = int(importlib.metadata.version("ross-rotordynamics").split(".")[0])
    except (importlib.metadata.PackageNotFoundError, ValueError):
        return ROSS_VERSIONS[-1], "the newest that is known; none is installed"
    return min(max(installed, ROSS_VERSIONS[0]), ROSS_VERSIONS[-1]), "the one that is installed"


_ROSS_HEADS = {
    2: (
        '"frequency" is the excitation [rad/s] at constant shaft speed, outside it ROSS extrapolates.',
        "Its spline smooths by some 1 N/m and 1 N s/m. Do not migrate this file to ROSS 3: ross_2to3 would",
        'rename the excitation to "speed". tpjb export --to ross --ross 3 writes the file for ROSS 3.',
    ),
    3: (
        '"speed" is the shaft\'s, "frequency" the excitation, both [rad/s]; with both, arrays are (speed, frequency).',
        "Outside an axis ROSS extrapolates. This form follows ROSS's description; it was not run with ROSS 3.",
    ),
}


def write_ross(folder: Path, points: tuple[StaticPoint, ...], source: str, version: int | None = None) -> None:
    """Write one TOML file per element, which ``ross.BearingElement.load`` reads: Re h stands as K, there is no mass."""
    number, reason = ross_version(version)
    for grid in grids(points, "excitation" if number == 2 else "both"):
        speed = f"{grid.speed[0]:g}Hz" if len(grid.speed) == 1 else "speeds"
        tag = grid.name(speed, "excitation" if len(grid.excitation) > 1 or len(grid.speed) == 1 else grid.line)
        head = [*grid.remarks(source), *grid.flags, f"For ROSS {number}, {reason}.", *_ROSS_HEADS[number]]
        lines = [*(f"# {printable(line)}" for line in head), f'["BearingElement_{tag}"]', "n = 0", f'tag = "{tag}"']
        axes = {"speed": _HZ * grid.speed, "frequency": grid.excitation}
        lines += [f"{axis} = {values.tolist()}" for axis, values in axes.items() if len(values) > 1]
        flat = grid.values if min(grid.values.shape[:2]) > 1 else grid.values.reshape(-1, len(COLUMNS))
        lines += [f"{name} = {flat[..., i].tolist()}" for i, name in enumerate(COLUMNS)]
        write_text(folder / f"ross_{tag}.toml", "\n".join(lines) + "\n")


def _xltrc(grid: Grid, remarks: list[str]) -> list[str]:
    """Tab-separated table in the order of XLTRC's user-defined bearing sheet: paste it below the sheet's head."""
    per, force = ("in", "lbf") if in_us_units() else ("m", "N")
    units = {"k": f"{force}/{per}", "c": f"{force}-s/{per}"}
    head = ["Speed (rpm)", *(f"{name.capitalize()} ({units[name[0]]})" for name in COLUMNS)]
    return [*(f"* {remark}" for remark in remarks), "\t".join(head), *grid.rows("\t")]


def _dyrobes(grid: Grid, remarks: list[str]) -> list[str]:
    """External bearing file of Dyrobes: points, unit system, 8 coefficients, then one line per speed.

    Its systems are 1 and 2 with in and lbf, 3 with m and N, 4 with mm and N.
    """
    return [f"{len(grid.speed)}, {2 if in_us_units() else 3}, 8, 0, 0, 0, 0   {'; '.join(remarks)}", *grid.rows(", ")]


def _ansys(grid: Grid, remarks: list[str]) -> list[str]:
    """File that ANSYS reads for COMBI214: titles, count, keys (1: lbf and in; 1: rpm to rad/s), K and C by speed."""
    lines = [*(remark[:80] for remark in remarks[:3]), f"{len(grid.speed):10d}{in_us_units():10d}{1:10d}"]
    for i, (speed, values) in enumerate(zip(grid.speed, grid.values[:, 0], strict=True), start=1):
        lines.append(f"{i:10d}{60.0 * speed:10.2f}")
        lines += ["".join(f"{value:15.7E}" for value in part) for part in (values[:4], values[4:])]
    return lines


def _write_by_speed(
    program: str,
    text: Callable[[Grid, list[str]], list[str]],
    folder: Path,
    points: tuple[StaticPoint, ...],
    source: str,
) -> None:
    """One file per load and excitation frequency."""
    per_metre = UNITS["N_per_m"][1] if in_us_units() else 1.0
    for grid in grids(points, "speed"):
        grid = replace(grid, values=grid.values / per_metre)
        write_text(folder / f"{program}_{grid.name(grid.line)}.txt", "\n".join(text(grid, grid.remarks(source))) + "\n")


write_xltrc = functools.partial(_write_by_speed, "xltrc", _xltrc)
write_dyrobes = functools.partial(_write_by_speed, "dyrobes", _dyrobes)
write_ansys = functools.partial(_write_by_speed, "ansys", _ansys)
