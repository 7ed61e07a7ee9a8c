"""The runs of one operating point: their readings by channel, phasors and means, and what H they share."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.wiring import plane_of

#: Smaller over larger extent of displacements that move along one line.
_ONE_LINE = 0.2
#: Runs whose pairs are tried.
_PAIRED = 24
#: Runs needed before one can be told apart from the others, and share of them that can be.
_MIN_RUNS, _MOST = 4, 1 / 3


@dataclass(frozen=True)
class PointRuns:
    """Readings of the n runs of one operating point, SI: of two probes and two cells."""

    phasors: ComplexArray  #: (n, 4): X and Y in place of the cells where the runs have not the same two
    means: FloatArray  #: (n, 4)
    inertia: ComplexArray  #: (n, 2), N: housing mass times acceleration, X and Y
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from the two readings to X and Y
    cell_plane: FloatArray
    centre: tuple[float, float] = (np.nan, np.nan)  #: m: what the probes read at the bearing's centre; NaN: not known
    observations: tuple[Observation, ...] = field(default=(), repr=False)
    channels: tuple[Channel, ...] = ()  #: the probes, and the cells where there are two in all runs

    def __len__(self) -> int:
        return len(self.phasors)

    @property
    def displacement(self) -> ComplexArray:
        """X, Y of every run, (n, 2) [m]."""
        return np.asarray(self.phasors[:, :2] @ self.probe_plane.T)

    @property
    def force(self) -> ComplexArray:
        """Of the film, X, Y of every run, (n, 2) [N]."""
        return np.asarray(self.phasors[:, 2:] @ self.cell_plane.T + self.inertia)

    def stiffness(self, runs: Sequence[int]) -> ComplexArray | None:
        """H (2, 2) of F = H D over some runs, each weighted by one over its displacement.

        None where they move along one line.
        """
        D, F = self.displacement[list(runs)], self.force[list(runs)]
        sizes = np.linalg.norm(D, axis=1)
        if len(sizes) < 2 or not np.all(sizes > 0):
            return None
        unit = D / sizes[:, None]
        solution, _, _, singular = np.linalg.lstsq(unit, F / sizes[:, None], rcond=None)
        return np.asarray(solution.T) if singular[-1] >= _ONE_LINE * singular[0] else None

    def misfits(self, stiffness: ComplexArray) -> FloatArray:
        """Share of every run's force that H does not explain, (n,)."""
        residual = self.force - self.displacement @ stiffness.T
        return np.asarray(np.linalg.norm(residual, axis=1) / np.linalg.norm(self.force, axis=1))

    def robust_stiffness(self) -> ComplexArray | None:
        """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it."""
        tried = (self.stiffness(pair) for pair in combinations(range(min(len(self), _PAIRED)), 2))
        pairs = [h for h in tried if h is not None]
        if not pairs:
            return None
        medians = [float(np.median(self.misfits(h))) for h in pairs]
        least = int(np.argmin(medians))
        close = np.flatnonzero(self.misfits(pairs[least]) <= max(3 * medians[least], 1e-9))
        refined = self.stiffness(close.tolist())
        return pairs[least] if refined is None else refined

    def outlying(self, initial: Collection[int], oddness: Callable[[int, list[int]], float]) -> set[int]:
        """Runs that differ from the others: `known` ones, then the oddest until none is odd or too many are.

        `oddness` of a run beside some others: over what chance allows.
        """
        outliers = set(initial)
        while len(outliers) + 1 <= _MOST * len(self) and len(self) - len(outliers) >= _MIN_RUNS:
            remaining = self.without(outliers)
            odd = [oddness(i, [j for j in remaining if j != i]) for i in remaining]
            if max(odd) < 1.0:
                break
            outliers.add(remaining[int(np.argmax(odd))])
        return outliers

    def without(self, outliers: Collection[int]) -> list[int]:
        """Runs that are none of some outliers."""
        return [i for i in range(len(self)) if i not in outliers]


def point_runs(runs: Sequence[Observation], mass: float, centres: Mapping[str, float]) -> PointRuns:
    """Phasors and means of all runs of a point, by channel; `centres`: what probes read at the bearing's centre [m]."""
    channels, cells = runs[0].of("displacement"), runs[0].of("force")
    force = np.array([run.film_force(mass) for run in runs])
    if len(cells) == 2 and all(run.names("force") == runs[0].names("force") for run in runs):
        places = [[*run.pick("displacement"), *run.pick("force")] for run in runs]
        phasors = np.array([run.lines.phasor[k] for run, k in zip(runs, places)])
        means = np.array([run.lines.mean[k] for run, k in zip(runs, places)])
        plane = plane_of(cells)
        channels += cells
    else:
        probes = [run.pick("displacement") for run in runs]
        phasors = np.hstack([[run.lines.phasor[k] for run, k in zip(runs, probes)], force])
        means, plane = np.zeros((len(runs), 4)), np.eye(2)
    inertia = np.asarray(force - phasors[:, 2:] @ plane.T, dtype=complex)
    first, second = (centres.get(probe.name, np.nan) for probe in channels[:2])
    probe_plane = plane_of(channels[:2])
    return PointRuns(phasors, means, inertia, probe_plane, plane, (first, second), tuple(runs), tuple(channels))


def probe_centres(sweeps: Sequence[Observation]) -> dict[str, float]:
    """What every probe reads at the bearing's centre [m]: in the middle of the way that a load around takes it."""
    table: dict[str, list[float]] = {}
    for sweep in sweeps:
        if not sweep.report.doubts & {"force", "displacement"}:
            for index in sweep.pick("displacement"):
                table.setdefault(sweep.channels[index].name, []).append(float(np.nanmean(sweep.samples[:, index])))
    return {name: float(np.median(values)) for name, values in table.items()}
