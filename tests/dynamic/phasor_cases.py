"""A dynamic stiffness and circular noise, for exact limits of estimates made by hand."""

from __future__ import annotations

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.records.lines import known_lines
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.records.run_data import RunPhasors
from tpjb_ident.dynamic.runs.point_data import PointData, gather

H = np.array([[2.0 + 0.7j, 0.3 - 0.2j], [-0.4 + 0.1j, 1.5 + 0.9j]])


def complex_normal(rng, *shape):
    """Circular, unit power per component."""
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


#: Of a film [N/m], at the frequency of `run`.
FILM_H = np.array([[2.1e8 + 6.3e7j, 2.0e7 + 3.1e6j], [-1.5e7 + 1.6e6j, 5.0e8 + 9.4e7j]])
OMEGA = 2 * np.pi * 25.0
WINDOWS = 6


def run(name: str, direction: float, force: float = 500.0, h=FILM_H, load: float = 5000.0, seed: int = 0):
    """A run of six windows, F = h D but for a little noise."""
    rng = np.random.default_rng([seed, round(1e3 * direction)])
    noise = rng.standard_normal((WINDOWS, 4)) + 1j * rng.standard_normal((WINDOWS, 4))
    F = force * np.array([np.cos(direction), np.sin(direction)]) + 0.1 * noise[:, :2]
    D = np.linalg.solve(h, F.T).T + 1e-9 * noise[:, 2:]
    mean = np.tile([0.0, -load], (WINDOWS, 1))
    point = OperatingPoint(load, -np.pi / 2, 2 * np.pi * 22, OMEGA)
    lines = known_lines((25.0,), 22.0, 1000.0)

    def block(z, mean=mean):
        lost = np.zeros(WINDOWS)
        return PhasorBlock(z[:, None, :], mean, np.full((WINDOWS, 2), 1e-9), lost)

    start = 0.25 * np.arange(WINDOWS)
    return RunPhasors(
        name, point, direction, lines, start, 0.25, block(D), block(F), None, 30.0, np.full(WINDOWS, 22.0)
    )


def point_of(runs) -> PointData:
    (data,) = gather(list(runs))
    return data
