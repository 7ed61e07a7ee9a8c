"""From a table: K and C alone as observations, as a paper's figures or another program give them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.diagnose.observations.layout import DynamicTest, Layout
from tpjb_ident.diagnose.observations.observe import ENTRY_NAMES, Element, Observations
from tpjb_ident.diagnose.observations.tolerance import Tolerance
from tpjb_ident.errors import BadInputError

if TYPE_CHECKING:
    import pandas as pd

#: A small coefficient is read off the same axis as the large ones: its error is no smaller than that of a value of this
#: share of the direct ones.
AXIS = 0.1
HZ = 2.0 * math.pi
_UNITS = {"k": "N_per_m", "c": "Ns_per_m"}


def observe_table(path: Path, reading_error: float | None = None, tolerance: Tolerance | None = None) -> Observations:
    """Read a table of coefficients.

    Parameters
    ----------
    path : Path
        CSV with the columns of ``coefficients.csv``: ``static_load_N``, ``shaft_speed_Hz``, one of the coefficients at
        least (``kxx_N_per_m`` .. ``cyy_Ns_per_m``) with ``.._se`` or ``.._lo`` and ``.._hi``;
        ``static_load_direction_deg`` (else -90) and ``excitation_Hz`` (else the shaft's). Empty cells are left out.
    reading_error : float, optional
        Standard error of a coefficient without one in the table, as a share of its value.
    tolerance : Tolerance, optional

    Raises
    ------
    BadInputError
        No such file or column, a cell that is no number, or a coefficient without any error.
    """
    tolerance = tolerance or Tolerance()
    frame = _read(path)
    rows: list[tuple[Element, float, float, float]] = []
    tests: dict[tuple[float, float, float], list[float]] = {}
    for number, row in enumerate(frame.to_dict("records"), start=2):
        place = _place(row, path, number)
        found = _coefficients(row, reading_error, f"{path.name}, line {number}")
        if not found:
            continue
        load, direction, speed, omega = place
        lines = tests.setdefault((load, direction, speed), [])
        if omega in lines:
            raise BadInputError(f"{path.name}, line {number}: a second row for the same point. Keep one of them.")
        lines.append(omega)
        where = (("load", load), ("direction", direction), ("speed", speed), ("excitation", omega))
        block = f"load {load:.0f} N, {omega / HZ:g} Hz"
        for part in "kc":
            factor = omega if part == "c" else 1.0
            direct = [abs(v) for name, (v, _) in found.items() if name in {f"{part}xx", f"{part}yy"}]
            mine = {n: v for n, v in found.items() if n[0] == part}
            scale = factor * float(np.mean(direct or [abs(v) for v, _ in mine.values()] or [1.0]))
            for name, (value, error) in mine.items():
                least = AXIS * scale * (reading_error or 0.0)
                sigma = max(factor * error, least) if reading_error else factor * error
                rows.append((Element("h", name, block, where), factor * value, sigma, tolerance.stiffness * scale))
    if not rows:
        raise BadInputError(f"{path.name}: holds no coefficient. Name columns as in coefficients.csv: kxx_N_per_m, ...")
    dynamic = tuple(DynamicTest(*key, tuple(lines)) for key, lines in tests.items())
    value, error, sigma = np.array([row[1:] for row in rows]).T
    elements = tuple(row[0] for row in rows)
    return Observations(Layout(dynamic), value, np.diag(error**2), sigma, elements)


def _read(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        frame = pd.read_csv(path, sep=None, engine="python", comment="#", encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise BadInputError(
            f"{path}: cannot be read as a table ({error}). Save it as CSV with a line of names."
        ) from error
    for name in ("static_load_N", "shaft_speed_Hz"):
        if name not in frame.columns:
            raise BadInputError(f"{path.name}: column {name} is missing. Add it.")
    return frame


def _number(row: Mapping[Any, Any], name: str, where: str) -> float:
    value = row.get(name)
    try:
        return float(value) if value is not None and value != "" else math.nan
    except (TypeError, ValueError) as error:
        raise BadInputError(
            f"{where}, {name}: {value!r} is no number. Leave the cell empty where nothing is known."
        ) from error


def _place(row: Mapping[Any, Any], path: Path, number: int) -> tuple[float, float, float, float]:
    where = f"{path.name}, line {number}"
    load, speed = _number(row, "static_load_N", where), HZ * _number(row, "shaft_speed_Hz", where)
    direction, line = _number(row, "static_load_direction_deg", where), HZ * _number(row, "excitation_Hz", where)
    if not (load > 0.0 and speed > 0.0):
        raise BadInputError(f"{where}: static_load_N and shaft_speed_Hz must be positive numbers.")
    return load, math.radians(-90.0 if math.isnan(direction) else direction), speed, speed if math.isnan(line) else line


def _coefficients(row: Mapping[Any, Any], reading_error: float | None, where: str) -> dict[str, tuple[float, float]]:
    """Value and standard error of every coefficient that a row holds."""
    out = {}
    for part, unit in _UNITS.items():
        for entry in ENTRY_NAMES:
            name = f"{part}{entry}_{unit}"
            value = _number(row, name, where)
            if math.isnan(value):
                continue
            error = _number(row, f"{name}_se", where)
            if math.isnan(error):
                error = (_number(row, f"{name}_hi", where) - _number(row, f"{name}_lo", where)) / (2 * 1.96)
            if math.isnan(error) and reading_error is not None:
                error = reading_error * abs(value)
            if not error >= 0.0:
                raise BadInputError(
                    f"{where}, {name}: nothing says how far it holds. Add {name}_se, _lo and _hi, or --reading-error."
                )
            out[f"{part}{entry}"] = (value, error)
    return out
