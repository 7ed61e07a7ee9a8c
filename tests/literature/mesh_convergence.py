"""Observed order of mesh convergence of the bearing model: a table.

    OMP_NUM_THREADS=1 python -m tests.literature.mesh_convergence

Every mesh has twice the intervals of the one before, along and across. The order is the binary logarithm of the
ratio of successive differences; the error is taken against Richardson's extrapolation of the two finest meshes.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from model.bearing_file import load_bearing
from model.predict import predict
from rigdata.arrays import FloatArray
from tests.studies import results

FOLDER = Path(__file__).resolve().parents[2] / "model" / "bearings"
SPEED, EXCITATION, DOWN = 2 * math.pi * 22.0, 2 * math.pi * 25.0, -math.pi / 2
MESHES = ((20, 2), (40, 4), (80, 8), (160, 16), (320, 32))
NAMES = ("p max", "load of pad #1", "y", "kxx", "kyy", "cxx", "cyy")


class Case(NamedTuple):
    """One bearing and point."""

    name: str
    bearing: str
    load: float
    thermal: str
    pivots: str


CASES = (
    Case("rocker, 5 kN, isothermal, rigid pivots (films full)", "rocker", 5000.0, "isothermal", "rigid"),
    Case("rocker, 5 kN, adiabatic, Kirk", "rocker", 5000.0, "adiabatic", "kirk"),
    Case("spherical, 8.75 kN, isothermal, Kirk (film ruptures)", "spherical", 8750.0, "isothermal", "kirk"),
    Case("spherical, 8.75 kN, adiabatic, Kirk (film ruptures)", "spherical", 8750.0, "adiabatic", "kirk"),
)


def numbers(case: Case, mesh: tuple[int, int]) -> FloatArray:
    """`NAMES` on one mesh."""
    drawn = load_bearing(FOLDER / f"{case.bearing}.toml")
    p = predict(drawn, case.load, DOWN, SPEED, EXCITATION, pivots=case.pivots, thermal=case.thermal, mesh=mesh)
    if not p.converged:
        raise RuntimeError(f"{case.name} on {mesh}: {p.status}")
    return np.array([p.max_pressure, p.pad_load[0], p.position[1], p.kxx, p.kyy, p.cxx, p.cyy])


def table(case: Case, meshes: tuple[tuple[int, int], ...] = MESHES) -> FloatArray:
    """`NAMES` over the meshes, (meshes, names)."""
    return np.array([numbers(case, mesh) for mesh in meshes])


def orders(values: FloatArray) -> FloatArray:
    """Observed order from every three successive meshes, (meshes - 2, names)."""
    steps = np.abs(np.diff(values, axis=0))
    return np.asarray(np.log2(steps[:-1] / steps[1:]))


def overall_order(values: FloatArray) -> FloatArray:
    """Order over all meshes at once: single steps scatter with where the rupture line falls between nodes."""
    steps = np.abs(np.diff(values, axis=0))
    return np.asarray(np.log2(steps[0] / steps[-1]) / (len(steps) - 1))


def errors(values: FloatArray) -> FloatArray:
    """Relative errors against the extrapolation of the two finest meshes at second order."""
    limit = values[-1] + (values[-1] - values[-2]) / 3.0
    return np.asarray(np.abs(values / limit - 1.0))


def main() -> None:
    """Write the table: order over all meshes, error on the third of them."""
    rows = []
    for case in CASES:
        values = table(case)
        rows.append([case.name, "order", *(f"{x:.1f}" for x in overall_order(values))])
        rows.append(["", f"error at {MESHES[2][0]} x {MESHES[2][1]}", *(f"{100 * x:.4f} %" for x in errors(values)[2])])
    text = results.table(("case", "", *NAMES), rows)
    results.write_section("convergence", "python -m tests.literature.mesh_convergence", text)


if __name__ == "__main__":
    main()
