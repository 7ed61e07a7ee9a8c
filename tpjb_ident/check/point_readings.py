"""Readings of the runs of one operating point by channel, phasors and means, and what H they share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import plane_of, to_plane

#: Sectors into which the directions of a sweep's load are sorted, and share of them that must be met.
_SECTORS, _MET = 36, 0.9
#: Smaller over larger extent of displacements that move along one line.
_ONE_LINE = 0.2


@dataclass(frozen=True)
class PointReadings:
    """Readings of the n runs of one operating point, SI."""

    probes: ComplexArray  #: (n, 2) complex, m
    cells: ComplexArray  #: (n, 2) complex, N
    inertia: ComplexArray  #: (n, 2) complex, N: housing mass times acceleration, X and Y
    probe_means: FloatArray  #: (n, 2), m
    cell_means: FloatArray  #: (n, 2), N
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from the two readings to X and Y
    cell_plane: FloatArray
    centre: tuple[float | None, float | None] = (None, None)

    @property
    def displacement(self) -> ComplexArray:
        """X, Y of every run, (n, 2) [m]."""
        return np.asarray(self.probes @ self.probe_plane.T)

    @property
    def force(self) -> ComplexArray:
        """Of the film, X, Y of every run, (n, 2) [N]."""
        return np.asarray(self.cells @ self.cell_plane.T + self.inertia)

    def stiffness(self, runs: Sequence[int]) -> ComplexArray | None:
        """H (2, 2) of F = H D over some runs; None where not determined."""
        return stiffness_of(self.displacement[list(runs)], self.force[list(runs)])


def stiffness_of(displacement: ComplexArray, force: ComplexArray) -> ComplexArray | None:
    """H (2, 2) of F = H D, every run weighted by one over its displacement; None where they move along one line.

    `displacement`, `force` (n, 2) [m], [N].
    """
    sizes = np.linalg.norm(displacement, axis=1)
    if len(sizes) < 2 or not np.all(sizes > 0) or not np.all(np.isfinite(sizes)):
        return None
    unit = displacement / sizes[:, None]
    singular = np.linalg.svd(unit, compute_uv=False)
    if singular[-1] < _ONE_LINE * singular[0]:
        return None
    return np.asarray(np.linalg.lstsq(unit, force / sizes[:, None], rcond=None)[0].T)


def leverage(fitted: ComplexArray, own: ComplexArray) -> float:
    """Variance that a matrix fitted to displacements (n, 2) gives to its answer to one more (2,), over theirs."""
    return float(np.real(own.conj() @ np.linalg.solve(fitted.T @ fitted.conj(), own)))


def point_readings(
    runs: Sequence[Observation], probes: ComplexArray, force: ComplexArray, centres: dict[str, float]
) -> PointReadings | None:
    """Phasors and means of all runs of a point, by channel; None where they have not the same two cells, or no means.

    `probes` (n, 2) [m], `force` (n, 2) [N] of the film; `centres`: what probes read at the bearing's centre [m].
    """
    first = runs[0]
    places = [(run.pick("displacement"), run.pick("force")) for run in runs]
    names = [[run.channels[i].name for i in cells] for run, (_, cells) in zip(runs, places)]
    lines = [run.lines for run in runs if run.lines is not None]
    if len(names[0]) != 2 or len(lines) < len(runs) or any(other != names[0] for other in names):
        return None
    probe_channels, cell_channels = ([first.channels[i] for i in part] for part in places[0])
    cell_plane = plane_of(cell_channels)
    cells = np.stack([line.phasor[c] for line, (_, c) in zip(lines, places)])
    return PointReadings(
        probes=probes,
        cells=cells,
        inertia=force - cells @ cell_plane.T,
        probe_means=np.stack([line.mean[p] for line, (p, _) in zip(lines, places)]),
        cell_means=np.stack([line.mean[c] for line, (_, c) in zip(lines, places)]),
        probe_plane=plane_of(probe_channels),
        cell_plane=cell_plane,
        centre=(centres.get(probe_channels[0].name), centres.get(probe_channels[1].name)),
    )


def probe_centres(sweeps: Sequence[Observation]) -> dict[str, float]:
    """What every probe reads at the bearing's centre [m], from clearance runs whose load goes around."""
    table: dict[str, list[float]] = {}
    for observation in sweeps:
        cells, probes = observation.pick("force"), observation.pick("displacement")
        if len(cells) != 2 or observation.report.doubts & {"force", "displacement"}:
            continue
        load = to_plane([observation.channels[i] for i in cells], observation.samples[:, cells].T).T
        for index in probes:
            centre = _swept_centre(load, observation.samples[:, index])
            if centre is not None:
                table.setdefault(observation.channels[index].name, []).append(centre)
    return {name: float(np.median(values)) for name, values in table.items()}


def _swept_centre(load: FloatArray, reading: FloatArray) -> float | None:
    """Mean of a probe's readings (n,) over all directions of a sweeping load (n, 2); None where it does not go around.

    Sides and corners of the clearance polygon lie evenly around the centre.
    """
    finite = np.isfinite(load).all(axis=1) & np.isfinite(reading)
    if not finite.any():
        return None
    across = load[finite] - np.median(load[finite], axis=0)
    turn = np.arctan2(across[:, 1], across[:, 0]) / (2 * math.pi) + 0.5
    sector = np.floor(turn * _SECTORS) % _SECTORS
    middles = [float(np.median(reading[finite][sector == s])) for s in range(_SECTORS) if np.any(sector == s)]
    return float(np.mean(middles)) if len(middles) >= _MET * _SECTORS else None
