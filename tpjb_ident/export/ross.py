"""ROSS: one TOML file per static point, as ``ross.BearingElement.load`` reads it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.export.points import StaticPoint
from tpjb_ident.export.table import INTERVALS
from tpjb_ident.runtime.tables import printable, write_text


def ross_text(point: StaticPoint, source: str) -> str:
    """Text of the TOML file that ``ross.BearingElement.load`` reads.

    ROSS interpolates over one axis, which it takes for the excitation frequency in a forced response and for the
    speed elsewhere; here it is the excitation frequency, at constant speed. A smoothing spline keeps stiffness to
    1e-8 but would smooth a mass array away, so Re h stands as K and M is zero.

    Parameters
    ----------
    point : StaticPoint
        A single frequency becomes constant coefficients.
    source : str
        Where the coefficients come from.
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
    """Write one TOML file per static point: ROSS reads the first table of a file.

    Parameters
    ----------
    folder : Path
    points : tuple of StaticPoint
    source : str
        Where the coefficients come from.
    """
    for point in points:
        write_text(folder / f"ross_{point.tag}.toml", ross_text(point, source))
