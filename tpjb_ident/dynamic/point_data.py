"""All windows of one operating point, gathered from its runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.run_phasors import RunPhasors


@dataclass(frozen=True)
class PointData:
    """Windows of all runs at one operating point and one excitation line.

    Attributes
    ----------
    point : OperatingPoint
    runs : tuple of RunPhasors
    lines : tuple of int
        Which line of each run is meant.
    D, F, A : (n, 2) complex ndarray
        Displacement [m], oil force [N], housing acceleration [m/s^2] (zero where not measured).
    run_index : (n,) ndarray of int
        Windows of one run are repeats of one excitation.
    """

    point: OperatingPoint
    runs: tuple[RunPhasors, ...]
    lines: tuple[int, ...]
    D: ComplexArray
    F: ComplexArray
    A: ComplexArray
    run_index: IntArray

    @property
    def omega(self) -> float:
        """Excitation frequency as set [rad/s]."""
        return self.point.excitation

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, shape (n_runs, 2) [N]."""
        return np.array([_finite_mean(run.cell_force.mean) for run in self.runs])

    @property
    def mean_positions(self) -> FloatArray:
        """Mean displacement of every run, shape (n_runs, 2) [m]."""
        return np.array([_finite_mean(run.displacement.mean) for run in self.runs])


def _finite_mean(rows: FloatArray) -> FloatArray:
    """Mean of the complete rows, (2,); NaN where there is none."""
    good = rows[np.isfinite(rows).all(axis=1)]
    return good.mean(axis=0) if len(good) else np.full(2, np.nan)


def gather(runs: list[RunPhasors]) -> list[PointData]:
    """Group runs by operating point; a record with several excitation lines feeds several points."""
    groups: dict[tuple[float, ...], list[tuple[RunPhasors, int, OperatingPoint]]] = {}
    for run in runs:
        for i, line in enumerate(run.lines.excitation):
            point = _point_of(run, i, line.frequency)
            key = (
                point.static_load,
                point.static_load_direction_deg,
                point.shaft_speed_hz,
                point.excitation_hz,
            )
            groups.setdefault(key, []).append((run, i, point))
    return [_point_data(members) for _, members in sorted(groups.items())]


def _point_of(run: RunPhasors, line: int, frequency: float) -> OperatingPoint:
    """Operating point of one line; the set point's frequency where the line belongs to it."""
    nominal = run.point.excitation_hz
    if abs(frequency - nominal) <= 0.02 * max(nominal, 1e-9):
        return run.point
    rounded = 2 * np.pi * round(frequency, 3)
    return OperatingPoint(run.point.static_load, run.point.static_load_direction, run.point.shaft_speed, rounded)


def _point_data(members: list[tuple[RunPhasors, int, OperatingPoint]]) -> PointData:
    runs = tuple(run for run, _, _ in members)
    lines = tuple(i for _, i, _ in members)
    D = [run.displacement.phasors[:, i] for run, i in zip(runs, lines)]
    F = [run.oil_force(i) for run, i in zip(runs, lines)]
    A = [
        np.zeros_like(d) if run.acceleration is None else run.acceleration.phasors[:, i]
        for run, i, d in zip(runs, lines, D)
    ]
    index = np.repeat(np.arange(len(runs)), [len(d) for d in D])
    return PointData(members[0][2], runs, lines, np.concatenate(D), np.concatenate(F), np.concatenate(A), index)
