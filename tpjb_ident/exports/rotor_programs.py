"""Rotordynamic programs: ROSS reads coefficients over frequency; XLTRC, Dyrobes, ANSYS over shaft speed, as text.

The latter know one set of K and C per speed. A static point identified at several frequencies therefore gives one file
per excitation frequency; which one belongs into a model depends on what is computed with it, and the file says so.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.exports.formats import COLUMNS, StaticPoint
from tpjb_ident.exports.table import INTERVALS
from tpjb_ident.runtime.tables import printable, write_text


def ross_text(point: StaticPoint, source: str) -> str:
    """Text of the TOML file that ``ross.BearingElement.load`` reads.

    ROSS interpolates over one axis, which it takes for the excitation frequency in a forced response and for the
    speed elsewhere; here it is the excitation frequency, at constant speed. A smoothing spline keeps stiffness to
    1e-8 but would smooth a mass array away, so Re h stands as K and M is zero.
    """
    several = len(point.frequency) > 1
    lines = [
        f"# {printable(source)}".replace("\n", " "),
        f"# static load {point.load:g} N at {point.direction:g} deg, shaft speed {point.speed:g} Hz",
        "# frequency: excitation [rad/s]; outside this range ROSS extrapolates" if several
        else f"# constant: identified at {point.frequency[0] / (2 * math.pi):g} Hz excitation only",
        f"# 95 % intervals and flags: {INTERVALS}, beside this file",
        *(f"# {printable(flag)}" for flag in point.flags),
        f'["BearingElement_{point.tag}"]',
        'color = "#355d7a"',
        "n = 0",
        "scale_factor = 1.0",
        f'tag = "{point.tag}"',
    ]  # fmt: skip
    if several:
        lines.append(f"frequency = {point.frequency.tolist()}")
    values = dict(point.coefficients)
    for name in ("kzz", "czz", "mxx", "mxy", "myx", "myy", "mzz"):
        values[name] = np.zeros(len(point.frequency))
    lines += [f"{name} = {values[name].tolist()}" for name in sorted(values)]
    return "\n".join(lines) + "\n"


def write_ross(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write one TOML file per static point: ROSS reads the first table of a file."""
    for point in points:
        write_text(folder / f"ross_{point.tag}.toml", ross_text(point, source))


@dataclass(frozen=True)
class SpeedTable:
    """Coefficients over n shaft speeds, of one static load and one excitation frequency."""

    load: float  #: [N]
    direction: float  #: [deg]
    frequency: float  #: [rad/s]; NaN where it is the running speed
    speed: FloatArray = field(repr=False)  #: (n,) [Hz]
    values: FloatArray = field(repr=False)  #: (n, 8) kxx .. kyy [N/m], cxx .. cyy [N s/m]
    trusted: BoolArray = field(repr=False)  #: (n,)

    @property
    def name(self) -> str:
        """For a file name."""
        line = "synchronous" if np.isnan(self.frequency) else f"{self.frequency / (2 * np.pi):g}Hz"
        return f"{self.load:.0f}N_{self.direction:g}deg_{line}"

    @property
    def title(self) -> str:
        """What it is, in one line."""
        line = "the running speed" if np.isnan(self.frequency) else f"{self.frequency / (2 * np.pi):g} Hz"
        return f"static load {self.load:g} N at {self.direction:g} deg, excitation at {line}"

    @property
    def warning(self) -> str:
        """Which speeds are not to be trusted, empty if all are."""
        speeds = ", ".join(f"{60 * speed:.6g}" for speed in self.speed[~self.trusted])
        return f"NOT TO BE TRUSTED at {speeds} rpm" if speeds else ""

    def rows(self, separator: str) -> list[str]:
        """One line per speed: rpm and the eight coefficients."""
        lines = []
        for speed, values in zip(self.speed, self.values, strict=True):
            lines.append(separator.join([f"{60.0 * speed:.6g}", *(f"{value:.8e}" for value in values)]))
        return lines


def speed_tables(points: tuple[StaticPoint, ...]) -> tuple[SpeedTable, ...]:
    """Sort coefficients by load, direction and excitation frequency, each over shaft speed."""
    groups: dict[tuple[float, float, float], list[tuple[float, list[float], bool]]] = {}
    for point in points:
        for i, omega in enumerate(point.frequency):
            synchronous = abs(omega - 2 * np.pi * point.speed) < 1e-6 * omega
            line = -1.0 if synchronous else round(float(omega), 9)
            coefficients = [point.coefficients[name][i] for name in COLUMNS]
            rows = groups.setdefault((point.load, point.direction, line), [])
            rows.append((point.speed, coefficients, bool(point.trusted[i])))
    tables = []
    for load, direction, line in sorted(groups):
        by_speed = sorted(groups[load, direction, line], key=lambda row: row[0])
        columns = [np.array(column) for column in zip(*by_speed, strict=True)]
        tables.append(SpeedTable(load, direction, math.nan if line < 0 else line, *columns))
    return tuple(tables)


def _write_by_speed(
    program: str,
    text: Callable[[SpeedTable, str], list[str]],
    folder: Path,
    points: tuple[StaticPoint, ...],
    source: str,
) -> None:
    """One file per load and excitation frequency."""
    for table in speed_tables(points):
        lines = text(table, printable(source).replace("\n", " "))
        write_text(folder / f"{program}_{table.name}.txt", "\n".join(lines) + "\n")


def _xltrc(table: SpeedTable, source: str) -> list[str]:
    """Tab-separated table in the order of XLTRC's user-defined bearing sheet: paste it below the sheet's head."""
    units = {"k": "N/m", "c": "N-s/m"}
    head = ["Speed (rpm)", *(f"{name.capitalize()} ({units[name[0]]})" for name in COLUMNS)]
    remarks = [source, f"{table.title}; SI units", f"95 % intervals and flags: {INTERVALS}"]
    remarks += [table.warning] if table.warning else []
    return [*(f"* {remark}" for remark in remarks), "\t".join(head), *table.rows("\t")]


def _dyrobes(table: SpeedTable, source: str) -> list[str]:
    """External bearing file of Dyrobes: points, unit system 4 (N, m, s), 8 coefficients, then one line per speed."""
    remarks = [source, table.title, f"intervals and flags: {INTERVALS}"]
    remarks += [table.warning] if table.warning else []
    return [f"{len(table.speed)}, 4, 8, 0, 0, 0, 0   {'; '.join(remarks)}", *table.rows(", ")]


def _ansys(table: SpeedTable, source: str) -> list[str]:
    """File that ANSYS reads for COMBI214: titles, count and unit keys (0: SI; 1: rpm to rad/s), K and C by speed."""
    remark = table.warning or f"K11 .. K22, C11 .. C22 in N/m, N s/m; intervals: {INTERVALS}"
    lines = [source[:80], table.title[:80], remark[:80], f"{len(table.speed):10d}{0:10d}{1:10d}"]
    for i, (speed, values) in enumerate(zip(table.speed, table.values, strict=True), start=1):
        lines.append(f"{i:10d}{60.0 * speed:10.2f}")
        lines += ["".join(f"{value:15.7E}" for value in part) for part in (values[:4], values[4:])]
    return lines


write_xltrc = functools.partial(_write_by_speed, "xltrc", _xltrc)
write_dyrobes = functools.partial(_write_by_speed, "dyrobes", _dyrobes)
write_ansys = functools.partial(_write_by_speed, "ansys", _ansys)
