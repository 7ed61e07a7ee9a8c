"""Coefficients in the forms that rotordynamic programs read: ROSS, a plain CSV table, MATLAB."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.tables import printable, safe_for_spreadsheets, write_atomic, write_text

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]
ENTRIES = ("xx", "xy", "yx", "yy")
KEYS = ("static_load_N", "static_load_direction_deg", "shaft_speed_Hz")
COLUMNS = {
    **{f"k{e}": f"k{e}_N_per_m" for e in ENTRIES},
    **{f"c{e}": f"c{e}_Ns_per_m" for e in ENTRIES},
}


class ExportError(ValueError):
    """The table cannot be exported; says which column or point and what to do."""


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
    """

    load: float
    direction: float
    speed: float
    frequency: FloatArray = field(repr=False)
    coefficients: dict[str, FloatArray] = field(repr=False)

    @property
    def tag(self) -> str:
        """Name that says what the frequency axis means."""
        return f"{self.load:.0f}N_{self.direction:g}deg_{self.speed:g}Hz_excitation"


def static_points(frame: pd.DataFrame) -> tuple[tuple[StaticPoint, ...], tuple[str, ...]]:
    """Sort a coefficient table by static point.

    Parameters
    ----------
    frame : DataFrame
        As in coefficients.csv or prediction.csv.

    Returns
    -------
    points : tuple of StaticPoint
    left_out : tuple of str
        Points without finite coefficients, which no program can use.

    Raises
    ------
    ExportError
        A column is missing, a point stands twice, or nothing is left.
    """
    needed = [*KEYS, "excitation_Hz", *COLUMNS.values()]
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise ExportError(f"the table has no column {missing[0]}. Give a coefficients.csv or prediction.csv of tpjb.")
    finite = np.isfinite(frame[needed].to_numpy(dtype=float)).all(axis=1)
    left_out = tuple(
        f"{row.static_load_N:g} N, {row.excitation_Hz:g} Hz" for row in frame[~finite].itertuples(index=False)
    )
    if not finite.any():
        raise ExportError("no point of the table has finite coefficients. Identify or predict again.")
    points = []
    for keys, group in frame[finite].groupby(list(KEYS), sort=True):
        ordered = group.sort_values("excitation_Hz")
        if ordered["excitation_Hz"].duplicated().any():
            raise ExportError(f"the point {keys[0]:g} N stands twice at one frequency. Export one method at a time.")
        omega = 2 * math.pi * ordered["excitation_Hz"].to_numpy(dtype=float)
        values = {short: ordered[column].to_numpy(dtype=float) for short, column in COLUMNS.items()}
        points.append(StaticPoint(float(keys[0]), float(keys[1]), float(keys[2]), omega, values))
    return tuple(points), left_out


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


def write_csv(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.csv: speed in rpm, frequency in rad/s, K and C in SI."""
    import pandas as pd

    parts = [
        pd.DataFrame(
            {
                "static_load_N": p.load,
                "static_load_direction_deg": p.direction,
                "shaft_speed_rpm": 60 * p.speed,
                "frequency_rad_per_s": p.frequency,
                **{COLUMNS[name]: values for name, values in p.coefficients.items()},
            }
        )
        for p in points
    ]
    frame = safe_for_spreadsheets(pd.concat(parts, ignore_index=True))
    path = folder / "bearing_coefficients.csv"
    write_atomic(path, lambda part: frame.to_csv(part, index=False, encoding="utf-8", lineterminator="\n"))


def write_mat(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.mat (MATLAB 5): struct array ``bearing``, K and C as 2 x 2 x n."""
    from scipy.io import savemat

    fields = [(name, object) for name in ("load_N", "direction_deg", "speed_Hz", "frequency_rad_per_s", "K", "C")]
    array = np.zeros(len(points), dtype=fields)
    for i, p in enumerate(points):
        array[i] = (p.load, p.direction, p.speed, p.frequency, _matrices(p, "k"), _matrices(p, "c"))
    path = folder / "bearing_coefficients.mat"
    content = {"bearing": array, "source": printable(source)}
    write_atomic(path, lambda part: savemat(part, content, oned_as="column", appendmat=False))


def _matrices(point: StaticPoint, kind: str) -> FloatArray:
    stacked = np.array([point.coefficients[f"{kind}{entry}"] for entry in ENTRIES])
    return stacked.reshape(2, 2, -1)


WRITERS: dict[str, Callable[[Path, tuple[StaticPoint, ...], str], None]] = {
    "ross": write_ross,
    "csv": write_csv,
    "mat": write_mat,
}
