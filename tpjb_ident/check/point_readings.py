"""Readings of the runs of one operating point by channel, phasors and means, and what H they share."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import oil_force, plane_of

#: Sectors into which the directions of a sweep's load are sorted, and share of them that must be met.
_SECTORS, _MET = 36, 0.9
#: Smaller over larger extent of displacements that move along one line.
_ONE_LINE = 0.2
#: Runs whose pairs are tried.
_PAIRED = 24
#: Runs needed before one can be told apart from the others, and share of them that can be.
MIN_RUNS, _MOST = 4, 1 / 3


@dataclass(frozen=True)
class PointReadings:
    """Readings of the n runs of one operating point, SI."""

    probes: ComplexArray  #: (n, 2) complex, m
    cells: ComplexArray  #: (n, 2) complex, N; X and Y where the runs have not the same two
    inertia: ComplexArray  #: (n, 2) complex, N: housing mass times acceleration, X and Y
    probe_means: FloatArray  #: (n, 2), m
    cell_means: FloatArray  #: (n, 2), N
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from the two readings to X and Y
    cell_plane: FloatArray
    centre: tuple[float | None, float | None] = (None, None)
    seen: tuple[Observation, ...] = field(default=(), repr=False)
    channels: tuple[Channel, ...] = ()  #: the probes, and the cells where there are two in all runs

    def __len__(self) -> int:
        return len(self.probes)

    @property
    def displacement(self) -> ComplexArray:
        """X, Y of every run, (n, 2) [m]."""
        return np.asarray(self.probes @ self.probe_plane.T)

    @property
    def force(self) -> ComplexArray:
        """Of the film, X, Y of every run, (n, 2) [N]."""
        return np.asarray(self.cells @ self.cell_plane.T + self.inertia)

    def stiffness(self, runs: Sequence[int]) -> ComplexArray | None:
        """H (2, 2) of F = H D over some runs, each weighted by one over its displacement.

        None where they move along one line.
        """
        D, F = self.displacement[list(runs)], self.force[list(runs)]
        sizes = np.linalg.norm(D, axis=1)
        if len(sizes) < 2 or not np.all(sizes > 0) or not np.all(np.isfinite(sizes)):
            return None
        unit = D / sizes[:, None]
        singular = np.linalg.svd(unit, compute_uv=False)
        if singular[-1] < _ONE_LINE * singular[0]:
            return None
        return np.asarray(np.linalg.lstsq(unit, F / sizes[:, None], rcond=None)[0].T)

    def misfits(self, stiffness: ComplexArray) -> FloatArray:
        """Share of every run's force that H does not explain, (n,)."""
        rest = self.force - self.displacement @ stiffness.T
        return np.asarray(np.linalg.norm(rest, axis=1) / np.linalg.norm(self.force, axis=1))

    def robust_stiffness(self) -> ComplexArray | None:
        """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it."""
        tried = (self.stiffness(pair) for pair in combinations(range(min(len(self), _PAIRED)), 2))
        found = [h for h in tried if h is not None]
        if not found:
            return None
        medians = [float(np.median(self.misfits(h))) for h in found]
        least = int(np.argmin(medians))
        close = np.flatnonzero(self.misfits(found[least]) <= max(3 * medians[least], 1e-9))
        refined = self.stiffness(close.tolist())
        return found[least] if refined is None else refined


def one_by_one(count: int, known: Collection[int], worst: Callable[[list[int]], int | None]) -> set[int]:
    """Runs that differ: `known` ones, and what `worst` finds among the others until it finds none or too many are."""
    outliers = set(known)
    while len(outliers) + 1 <= _MOST * count:
        remaining = [i for i in range(count) if i not in outliers]
        run = worst(remaining) if len(remaining) >= MIN_RUNS else None
        if run is None:
            break
        outliers.add(run)
    return outliers


def leverage(fitted: ComplexArray, own: ComplexArray) -> float:
    """Variance that a matrix fitted to displacements (n, 2) gives to its answer to one more (2,), over theirs."""
    return float(np.real(own.conj() @ np.linalg.solve(fitted.T @ fitted.conj(), own)))


def point_readings(runs: Sequence[Observation], mass: float, centres: dict[str, float]) -> PointReadings:
    """Phasors and means of all runs of a point, by channel; `centres`: what probes read at the bearing's centre [m]."""
    lines = [(run, run.lines) for run in runs if run.lines is not None]
    channels = tuple(runs[0].of("displacement"))
    plane = plane_of(channels)
    force = np.array([oil_force(run, mass) for run in runs], dtype=complex)
    names = {tuple(cell.name for cell in run.of("force")) for run in runs}
    phasors, means, cell_plane = force, np.zeros((len(runs), 2)), np.eye(2)
    if len(names) == 1 and len(runs[0].pick("force")) == 2:
        channels += tuple(runs[0].of("force"))
        phasors = np.stack([line.phasor[run.pick("force")] for run, line in lines])
        means = np.stack([line.mean[run.pick("force")] for run, line in lines])
        cell_plane = plane_of(channels[2:])
    return PointReadings(
        probes=np.stack([line.phasor[run.pick("displacement")] for run, line in lines]),
        cells=phasors,
        inertia=np.asarray(force - phasors @ cell_plane.T, dtype=complex),
        probe_means=np.stack([line.mean[run.pick("displacement")] for run, line in lines]),
        cell_means=means,
        probe_plane=plane,
        cell_plane=cell_plane,
        centre=(centres.get(channels[0].name), centres.get(channels[1].name)),
        seen=tuple(runs),
        channels=channels,
    )


def probe_centres(sweeps: Sequence[Observation]) -> dict[str, float]:
    """What every probe reads at the bearing's centre [m], from clearance runs whose load goes around."""
    table: dict[str, list[float]] = {}
    for observation in sweeps:
        cells, probes = observation.pick("force"), observation.pick("displacement")
        if len(cells) != 2 or observation.report.doubts & {"force", "displacement"}:
            continue
        load = observation.samples[:, cells] @ plane_of(observation.of("force")).T
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
