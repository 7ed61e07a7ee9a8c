"""Observed order of mesh convergence of the bearing model: a table, and a picture of errors against the mesh.

    OMP_NUM_THREADS=1 python tests/studies/convergence_model.py [--picture docs/model_convergence.svg]

Every mesh has twice the intervals of the one before, along and across. The order is the binary logarithm of the
ratio of successive differences; the error is taken against Richardson's extrapolation of the two finest meshes.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.predict import predict

FloatArray = NDArray[np.float64]
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


def bearing(name: str) -> Bearing:
    return load_bearing(FOLDER / f"{name}.toml")


def numbers(case: Case, mesh: tuple[int, int]) -> FloatArray:
    """`NAMES` on one mesh."""
    p = predict(
        bearing(case.bearing), case.load, DOWN, SPEED, EXCITATION, pivots=case.pivots, thermal=case.thermal, mesh=mesh
    )
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


def show(case: Case, values: FloatArray) -> None:
    print(case.name)
    print(f"  {'mesh':10s}" + "".join(f"{n:>16s}" for n in NAMES))
    for mesh, row in zip(MESHES, errors(values), strict=True):
        print(f"  {mesh[0]:4d} x {mesh[1]:<3d}" + "".join(f"{100 * x:15.4f}%" for x in row))
    for k, row in enumerate(orders(values)):
        print(f"  order {k + 1:3d} " + "".join(f"{x:16.2f}" for x in row))
    print("  overall   " + "".join(f"{x:16.2f}" for x in overall_order(values)), flush=True)


def draw(results: list[tuple[Case, FloatArray]], path: Path) -> None:
    """Errors against intervals along the arc, with a line of second order."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    along = np.array([m[0] for m in MESHES], float)
    for axes, (case, values) in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, results, strict=True):
        for name, column, mark in zip(NAMES, errors(values).T, "osv^<>D", strict=True):
            axes.loglog(along[:-1], column[:-1], marker=mark, markersize=4, linewidth=1.0, label=name)
        axes.loglog(along[:-1], 0.05 * (along[0] / along[:-1]) ** 2, "k--", linewidth=1.0, label="second order")
        axes.axvline(80.0, color="0.8", zorder=0)
        axes.set_title(case.name, fontsize=9)
        axes.grid(alpha=0.3)
        axes.set_xticks(along[:-1], [f"{m[0]} x {m[1]}" for m in MESHES[:-1]])
        axes.minorticks_off()
    figure.supxlabel("film mesh, along x across half the width")
    figure.supylabel("relative error")
    figure.axes[0].legend(fontsize=7, ncols=2)
    figure.savefig(path)
    print(f"drawn: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="draw the errors into this file (svg, png, pdf)")
    arguments = parser.parse_args()
    results = []
    for case in CASES:
        values = table(case)
        show(case, values)
        results.append((case, values))
    if arguments.picture:
        draw(results, arguments.picture)


if __name__ == "__main__":
    main()
