"""Rotordynamic programs: ROSS reads coefficients over frequency; XLTRC, Dyrobes, ANSYS over shaft speed, as text.

The latter know one set of K and C per speed. A static point identified at several frequencies therefore gives one file
per excitation frequency; which one belongs into a model depends on what is computed with it, and the file says so.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.exports.formats import StaticPoint
from tpjb_ident.exports.table import INTERVALS
from tpjb_ident.runtime.tables import printable, write_text
from tpjb_ident.schema import ENTRIES


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
        lines.append(f"frequency = {_list(point.frequency)}")
    values = dict(point.coefficients)
    zero = np.zeros(len(point.frequency))
    for name in ("kzz", "czz", "mxx", "mxy", "myx", "myy", "mzz"):
        values[name] = zero
    lines += [f"{name} = {_list(values[name])}" for name in sorted(values)]
    return "\n".join(lines) + "\n"


def _list(values: FloatArray) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def write_ross(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write one TOML file per static point: ROSS reads the first table of a file."""
    for point in points:
        write_text(folder / f"ross_{point.tag}.toml", ross_text(point, source))


@dataclass(frozen=True)
class SpeedTable:
    """Coefficients over shaft speed, of one static load and one excitation frequency."""

    load: float
    direction: float
    frequency: float
    speed: FloatArray = field(repr=False)
    k: FloatArray = field(repr=False)
    c: FloatArray = field(repr=False)
    trusted: BoolArray = field(repr=False)

    @property
    def name(self) -> str:
        """For a file name."""
        line = "synchronous" if np.isnan(self.frequency) else f"{self.frequency / (2 * np.pi):g}Hz"
        return f"{self.load:.0f}N_{self.direction:g}deg_{line}"

    @property
    def words(self) -> str:
        """What it is, in one line."""
        line = "the running speed" if np.isnan(self.frequency) else f"{self.frequency / (2 * np.pi):g} Hz"
        return f"static load {self.load:g} N at {self.direction:g} deg, excitation at {line}"

    @property
    def warning(self) -> str:
        """Which speeds are not to be trusted, empty if all are."""
        speeds = ", ".join(f"{60 * speed:.6g}" for speed, ok in zip(self.speed, self.trusted, strict=True) if not ok)
        return f"NOT TO BE TRUSTED at {speeds} rpm" if speeds else ""


def speed_tables(points: tuple[StaticPoint, ...]) -> tuple[SpeedTable, ...]:
    """Sort coefficients by load, direction and excitation frequency, each over shaft speed."""
    rows = []
    for p in points:
        for i, omega in enumerate(p.frequency):
            synchronous = abs(omega - 2 * np.pi * p.speed) < 1e-6 * omega
            k, c = ([p.coefficients[f"{kind}{e}"][i] for e in ENTRIES] for kind in "kc")
            line = -1.0 if synchronous else round(float(omega), 9)
            rows.append(((p.load, p.direction, line), p.speed, k, c, bool(p.trusted[i])))
    rows.sort(key=lambda row: (row[0], row[1]))
    out = []
    for (load, direction, line), group in itertools.groupby(rows, key=lambda row: row[0]):
        own = list(group)
        out.append(
            SpeedTable(
                load, direction, float("nan") if line < 0 else line, np.array([r[1] for r in own]),
                np.array([r[2] for r in own]), np.array([r[3] for r in own]), np.array([r[4] for r in own]),
            )
        )  # fmt: skip
    return tuple(out)


def _rows(table: SpeedTable) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    yield from zip(60.0 * table.speed, table.k, table.c, strict=True)


def _xltrc_text(table: SpeedTable, source: str) -> str:
    """Tab-separated table in the order of XLTRC's user-defined bearing sheet: paste it below the sheet's head."""
    names = [f"{kind}{e}" for kind in "KC" for e in ENTRIES]
    head = "\t".join(["Speed (rpm)", *(f"{n} ({'N/m' if n[0] == 'K' else 'N-s/m'})" for n in names)])
    lines = [f"* {_one_line(source)}", f"* {table.words}; SI units", f"* 95 % intervals and flags: {INTERVALS}"]
    lines += [f"* {table.warning}"] if table.warning else []
    lines.append(head)
    lines += ["\t".join([f"{rpm:.6g}", *(f"{v:.8e}" for v in (*k, *c))]) for rpm, k, c in _rows(table)]
    return "\n".join(lines) + "\n"


def _dyrobes_text(table: SpeedTable, source: str) -> str:
    """External bearing file of Dyrobes: points, unit system 4 (N, m, s), 8 coefficients, then one line per speed."""
    lines = [f"{len(table.speed)}, 4, 8, 0, 0, 0, 0   {_one_line(source)}; {table.words}{_appendix(table)}"]
    lines += [", ".join([f"{rpm:.6g}", *(f"{v:.8e}" for v in (*k, *c))]) for rpm, k, c in _rows(table)]
    return "\n".join(lines) + "\n"


def _ansys_text(table: SpeedTable, source: str) -> str:
    """File that ANSYS reads for COMBI214: titles, count and unit keys (0: SI; 1: rpm to rad/s), K and C by speed."""
    third = table.warning or f"K11 .. K22, C11 .. C22 in N/m, N s/m; intervals: {INTERVALS}"
    lines = [_one_line(source)[:80], table.words[:80], third[:80]]
    lines.append(f"{len(table.speed):10d}{0:10d}{1:10d}")
    for i, (rpm, k, c) in enumerate(_rows(table), start=1):
        lines.append(f"{i:10d}{rpm:10.2f}")
        lines += ["".join(f"{v:15.7E}" for v in values) for values in (k, c)]
    return "\n".join(lines) + "\n"


def _appendix(table: SpeedTable) -> str:
    return f"; intervals and flags: {INTERVALS}" + (f"; {table.warning}" if table.warning else "")


def _one_line(text: str) -> str:
    return printable(text).replace("\n", " ")


def write_xltrc(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write xltrc_*.txt, one per load and excitation frequency."""
    for table in speed_tables(points):
        write_text(folder / f"xltrc_{table.name}.txt", _xltrc_text(table, source))


def write_dyrobes(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write dyrobes_*.txt, one per load and excitation frequency."""
    for table in speed_tables(points):
        write_text(folder / f"dyrobes_{table.name}.txt", _dyrobes_text(table, source))


def write_ansys(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write ansys_*.txt, one per load and excitation frequency."""
    for table in speed_tables(points):
        write_text(folder / f"ansys_{table.name}.txt", _ansys_text(table, source))
