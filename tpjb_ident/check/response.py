"""What the runs of an operating point answer to force: the H that they share, and whether a film can be like that.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe wired to the
wrong input or with the wrong sign turns the answer into its mirror image, which is not.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.wiring import explanation, indefiniteness, plane_of, repairs
from tpjb_ident.phasors.shaft import shaft_order

#: Smaller over larger extent of displacements that move along one line.
_ONE_LINE = 0.2
#: Runs whose pairs are tried.
_PAIRED = 24
#: Where half of the runs differ by more than this share there is no one answer to judge.
_NO_ANSWER = 0.08
#: Least over largest eigenvalue of a film's stiffness and damping, and of one whose probes were mended.
_DEFINITE, _MENDED = 0.05, 0.15
#: H of runs that do not tell it.
_UNKNOWN = np.full((2, 2), np.nan + 0j)


@dataclass(frozen=True, repr=False)
class PointRuns:
    """Readings of the n runs of one operating point, SI: of two probes and, as a rule, two cells."""

    phasors: ComplexArray  #: (n, 4)
    means: FloatArray  #: (n, 4)
    inertia: ComplexArray  #: (n, 2), N: housing mass times acceleration, X and Y
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from the two readings to X and Y
    cell_plane: FloatArray
    turning: FloatArray  #: (n, 4): size of what turns with the shaft; NaN where that is not told
    observations: tuple[Observation, ...] = ()
    channels: tuple[Channel, ...] = ()  #: probes and cells

    def __len__(self) -> int:
        return len(self.phasors)

    @property
    def displacement(self) -> ComplexArray:
        """X, Y of every run, (n, 2) [m]."""
        return self.phasors[:, :2] @ self.probe_plane.T

    @property
    def force(self) -> ComplexArray:
        """Of the film, X, Y of every run, (n, 2) [N]."""
        return self.phasors[:, 2:] @ self.cell_plane.T + self.inertia

    def stiffness(self, runs: Sequence[int]) -> ComplexArray:
        """H (2, 2) of F = H D over some runs, each weighted by one over its displacement.

        NaN where they move along one line.
        """
        D, F = self.displacement[list(runs)], self.force[list(runs)]
        sizes = np.linalg.norm(D, axis=1, keepdims=True)
        if len(sizes) < 2 or not np.all(sizes > 0):
            return _UNKNOWN
        solution, _, _, singular = np.linalg.lstsq(D / sizes, F / sizes, rcond=None)
        return np.asarray(solution.T) if singular[-1] >= _ONE_LINE * singular[0] else _UNKNOWN

    def misfits(self, stiffness: ComplexArray) -> FloatArray:
        """Share of every run's force that H does not explain, (n,)."""
        residual = self.force - self.displacement @ stiffness.T
        return np.linalg.norm(residual, axis=1) / np.linalg.norm(self.force, axis=1)

    @cached_property
    def robust_stiffness(self) -> ComplexArray:
        """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it.

        NaN where all move along one line.
        """
        tried = (self.stiffness(pair) for pair in combinations(range(min(len(self), _PAIRED)), 2))
        pairs = [h for h in tried if np.isfinite(h).all()]
        if not pairs:
            return _UNKNOWN
        return min(pairs, key=lambda h: float(np.median(self.misfits(h))))

    def without(self, outliers: Collection[int]) -> list[int]:
        """Runs that are none of some outliers."""
        return [i for i in range(len(self)) if i not in outliers]


def point_runs(observations: Sequence[Observation], mass: float) -> list[PointRuns]:
    """Dynamic runs by operating point and channels: of those that show what two probes and the cells answer."""
    groups: dict[object, list[Observation]] = {}
    for observation in observations:
        point, probes = observation.run.point, observation.of("displacement")
        # runout answers at a line of the shaft too, as no film does
        is_clear = not shaft_order(point.excitation_hz, point.shaft_speed_hz)
        is_clear &= observation.shows("force") and observation.shows("displacement")
        measured = np.array([observation.film_force(mass), observation.line("displacement")])
        if is_clear and len(probes) == 2 and "force" not in observation.report.doubts and np.isfinite(measured).all():
            named = ((channel.name, channel.axis) for channel in [*probes, *observation.of("force")])
            groups.setdefault((point, *named), []).append(observation)
    return [_readings(group, mass) for group in groups.values()]


def _readings(runs: Sequence[Observation], mass: float) -> PointRuns:
    """Readings of all runs of a point, by channel."""
    probes, cells = runs[0].of("displacement"), runs[0].of("force")
    places = [[*run.pick("displacement"), *run.pick("force")] for run in runs]
    rows = [(run.lines.phasor[k], run.lines.mean[k], run.shaft_line[k]) for run, k in zip(runs, places)]
    phasors, means, turning = map(np.array, zip(*rows))
    plane = plane_of(cells)
    inertia = np.asarray([run.film_force(mass) for run in runs] - phasors[:, 2:] @ plane.T, dtype=complex)
    return PointRuns(phasors, means, inertia, plane_of(probes), plane, turning, tuple(runs), (*probes, *cells))


def _film_like(stiffness: ComplexArray) -> float:
    """Misfit of a matrix to what a film can be."""
    return max(indefiniteness(stiffness.real), indefiniteness(stiffness.imag))


def check_film(runs: PointRuns) -> None:
    """Positive stiffness and damping, alike along both probes; most of the runs must agree on them."""
    stiffness = runs.robust_stiffness
    if not np.median(runs.misfits(stiffness)) <= _NO_ANSWER:
        return
    probes = runs.channels[:2]
    names = [probe.name for probe in probes]
    if _film_like(stiffness) < 1 / _DEFINITE:
        sizes = np.linalg.norm(stiffness @ runs.probe_plane, axis=0)
        larger, smaller = names[int(np.argmin(sizes))], names[int(np.argmax(sizes))]
        for observation in runs.observations:
            observation.report.ask("scales", float(sizes.max() / sizes.min()), *names, larger=larger, smaller=smaller)
        return
    hint = explanation(repairs(probes), lambda repair: _film_like(stiffness @ np.linalg.inv(repair)), 1 / _MENDED)
    if not hint and indefiniteness(stiffness.imag) < 1 / _DEFINITE:
        return  # stiffness may be negative: added mass, cross-coupling
    is_grave = bool(hint) or np.linalg.eigvalsh(stiffness.imag + stiffness.imag.T)[0] < 0
    for observation in runs.observations:
        observation.report.ask("signs", 2.0 if is_grave else 1.0, *names, hint=hint)
