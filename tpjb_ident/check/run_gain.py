"""What the runs of an operating point answer to force: the H that they share, and those that differ from their fellows.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe wired to the
wrong input or with the wrong sign turns the answer into its mirror image, which is not.

Two probes and two cells serve all runs of a point. If one of them reads g times the truth in one run, the part
1 - 1/g of its own reading is too much there: at the excitation line, in what turns with the shaft, and in the mean load
alike. Each of the three foretells the run by its fellows; the part is estimated from all of them, by generalised least
squares: noise is what the fellows scatter by, and beside it stands what honest runs differ by: a bearing that answers a
little softer or less damped, a load that misses its set point, a shaft that is balanced a little otherwise. A gain is
named where all evidence together leaves no room for chance, the excitation line shows it by itself, nothing contradicts
it, and nothing else in the run is strange. Mean positions tell nothing: that of the probe which is asked may have moved
by anything, and a shaft wanders by more than a load some per cent off moves it.
"""

import math
from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import fdtri, stdtr

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.vector import inverse_directions
from tpjb_ident.check.findings import explanation, far, indefiniteness, repairs
from tpjb_ident.check.observation import Observation
from tpjb_ident.phasors.frequency import shaft_order

#: Smaller over larger extent of displacements that move along one line.
_ONE_LINE = 0.2
#: Runs whose pairs are tried.
_PAIRED = 24
#: Where half of the runs differ by more than this share there is no one answer to judge.
_NO_ANSWER = 0.08
#: Least over largest eigenvalue of a film's stiffness and damping, and of one whose probes were mended.
_DEFINITE, _MENDED = 0.05, 0.15
#: H of runs that do not tell it.
_NO_STIFFNESS = np.full((2, 2), np.nan + 0j)


@dataclass(frozen=True, repr=False)
class PointRuns:
    """Readings of the n runs of one operating point, SI: of two probes and, as a rule, two cells."""

    phasors: ComplexArray  #: (n, 4)
    loads: FloatArray  #: (n, 4): means of the cells; NaN of the probes, which may have moved by anything
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
            return _NO_STIFFNESS
        solution, _, _, singular = np.linalg.lstsq(D / sizes, F / sizes, rcond=None)
        return solution.T if singular[-1] >= _ONE_LINE * singular[0] else _NO_STIFFNESS

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
            return _NO_STIFFNESS
        return min(pairs, key=lambda h: float(np.median(self.misfits(h))))

    def without(self, outliers: Collection[int]) -> list[int]:
        """Runs that are none of some outliers."""
        return [i for i in range(len(self)) if i not in outliers]


def point_runs(observations: Sequence[Observation]) -> list[PointRuns]:
    """Dynamic runs by operating point and channels: of those that show what two probes and the cells answer."""
    groups = defaultdict(list)
    for observation in observations:
        point, probes = observation.run.point, observation.of("displacement")
        # runout answers at a line of the shaft too, as no film does
        is_clear = not shaft_order(point.excitation_hz, point.shaft_speed_hz)
        is_clear &= observation.shows("force") and observation.shows("displacement")
        measured = np.array([observation.film_force, observation.line("displacement")])
        if is_clear and len(probes) == 2 and not observation.report.cells_doubted and np.isfinite(measured).all():
            named = ((channel.name, channel.axis) for channel in [*probes, *observation.of("force")])
            groups[point, *named].append(observation)
    return [_readings(group) for group in groups.values()]


def _readings(runs: Sequence[Observation]) -> PointRuns:
    """Readings of all runs of a point, by channel."""
    probes, cells = runs[0].of("displacement"), runs[0].of("force")
    places = [[*run.pick("displacement"), *run.pick("force")] for run in runs]
    rows = [(run.lines.phasor[k], run.lines.mean[k], run.shaft_lines[0, k]) for run, k in zip(runs, places)]
    phasors, loads, turning = map(np.array, zip(*rows))
    loads[:, : len(probes)] = np.nan
    inertia = np.array([run.inertia for run in runs])
    planes = inverse_directions(probes), inverse_directions(cells)
    return PointRuns(phasors, loads, inertia, *planes, turning, tuple(runs), (*probes, *cells))


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
        larger, smaller = names[np.argmin(sizes)], names[np.argmax(sizes)]
        for observation in runs.observations:
            observation.report.ask("scales", float(sizes.max() / sizes.min()), *names, larger=larger, smaller=smaller)
        return
    hint = explanation(repairs(probes), lambda repair: _film_like(stiffness @ np.linalg.inv(repair)), 1 / _MENDED)
    if not hint and indefiniteness(stiffness.imag) < 1 / _DEFINITE:
        return  # stiffness may be negative: added mass, cross-coupling
    is_grave = bool(hint) or np.linalg.eigvalsh(stiffness.imag + stiffness.imag.T)[0] < 0
    for observation in runs.observations:
        observation.report.ask("signs", 2.0 if is_grave else 1.0, *names, hint=hint)


#: A run that differs by this share stands apart in any case, where the others agree to the second share.
_OUTLIER, _AGREED = 0.08, 0.03
#: Differences below this share are no fault: loads and temperatures differ from run to run.
_LEAST_MISFIT = 0.03
#: Runs needed before one can be told apart from the others, and share of them that can be.
_MIN_RUNS, _MOST = 4, 1 / 3
#: Stiffness, damping and static load of one run may differ from the others' by this share, one standard deviation:
#: oil gets warmer, loads are set by hand; what turns with the shaft by the second.
_HONEST, _HONEST_TURNING = 0.01, 0.005
#: Least scatter that the force of runs is credited with, as a share.
_LEAST_PHASOR = 1e-4
#: Probability at which chance is no explanation any more, for all runs of an operating point.
_CHANCE = 1e-4
#: The phasors must show the gain themselves, with this probability of chance at most.
_PHASORS_SHOW = 0.05
#: Rest that a lone gain may leave, per equation in units of its covariance: 1 % of honest runs leave more.
_STRANGE = 6.0
#: The estimates by phasors and by others may differ by this many standard deviations.
_AGREE = 3.0
#: Smaller gains are no fault: calibrations promise no more. A part beyond the other is no gain some per cent off.
_LEAST, _MOST_PART = 0.01, 0.9
#: Another channel explains a run as well if it leaves no more than this: a thousandth of the likelihood.
_AS_WELL = 2 * math.log(1e3)
#: Variance of what is not known; keeps divisions by no information finite.
_UNKNOWN, _NOTHING = 1e30, 1e-300


class WrongGain(NamedTuple):
    """A gain that one channel has in one run only; channels that explain the run as well, the likeliest first."""

    channels: tuple[int, ...]
    gain: float
    error: float
    chance: float


class Difference(NamedTuple):
    """How one run differs from what its fellows foretell, with its covariance."""

    residual: FloatArray  #: (4,)
    noise: FloatArray  #: (4, 4): covariance that the others' scatter tells
    honest: FloatArray  #: (4, 4): covariance of what honest runs differ by beyond it
    spare: int


def check_agreement(runs: PointRuns) -> None:
    """Name runs that answer otherwise than their fellows, with the wiring fault or the gain that explains it."""
    gains = deviating_runs(runs)
    stiffness = runs.stiffness(runs.without(gains))
    misfits = runs.misfits(stiffness)
    for run, gain in gains.items():
        report, hint = runs.observations[run].report, _miswired(runs, run, stiffness)
        if hint:
            report.ask("miswired", misfits[run], hint=hint)
        elif gain is None:
            report.ask("disagrees", misfits[run])
        else:
            name, *alike = (runs.channels[k].name for k in gain.channels)
            hint = f" (or {' or '.join(alike)} another gain)" if alike else ""
            direction, share = "much" if gain.gain > 1 else "little", abs(gain.gain - 1)
            report.ask("gain", misfits[run], name, hint=hint, share=share, direction=direction, error=gain.error)


def _miswired(runs: PointRuns, run: int, stiffness: ComplexArray) -> str:
    """The wiring fault of probes or cells that explains a run; "" where none does."""
    probes, cells = runs.channels[:2], runs.channels[2:]
    tried = [(words, np.array([repair, np.eye(2)])) for words, repair in repairs(probes, scales=True)]
    tried += [(words, np.array([np.eye(2), repair])) for words, repair in repairs(cells, scales=True)]
    inertia = runs.inertia[run]

    def unexplained(repair: FloatArray) -> float:
        # the inertia part of the force stays: only the cells are supposed to be at fault
        force = repair[1] @ (runs.force[run] - inertia) + inertia
        answer = stiffness @ repair[0] @ runs.displacement[run]
        return float(np.linalg.norm(force - answer) / np.linalg.norm(force))

    return explanation(tried, unexplained, float(runs.misfits(stiffness)[run]) / 4)


def deviating_runs(runs: PointRuns) -> dict[int, WrongGain | None]:
    """Runs that differ from their fellows, with the gain that explains it or without one.

    Those that clearly do, then the oddest until none is odd or too many are.
    """
    misfits = runs.misfits(runs.robust_stiffness)
    clear = far(misfits, _OUTLIER, 6.0) & (np.median(misfits) <= _AGREED)
    deviating = set(np.flatnonzero(clear).tolist())
    while len(deviating) + 1 <= _MOST * len(runs) and len(runs) - len(deviating) >= _MIN_RUNS:
        remaining = runs.without(deviating)
        oddness = [_oddness(runs, run, runs.without({*deviating, run})) for run in remaining]
        if max(oddness) < 1.0:
            break
        deviating.add(remaining[np.argmax(oddness)])
    fellows = runs.without(deviating)
    return {run: gain_of_run(runs, run, fellows) for run in sorted(deviating)}


def _oddness(runs: PointRuns, run: int, fellows: list[int]) -> float:
    """How far a run is from its fellows' matrix or how likely one channel's gain, over what chance allows.

    The residual's square over its variance, by the fellows' scatter, follows an F distribution.
    """
    stiffness = runs.stiffness(fellows)
    dynamic, gain = dynamic_difference(runs, run, fellows, stiffness), gain_of_run(runs, run, fellows)
    # each run is tried with two cells and two probes
    by_gain = 0.0 if gain is None else _CHANCE / (4 * (len(fellows) + 1)) / max(gain.chance, _NOTHING)
    if dynamic is None or runs.misfits(stiffness)[run] < _LEAST_MISFIT:
        return by_gain
    ratio = float(np.mean(dynamic.residual**2 / np.diag(dynamic.noise)))
    return max(by_gain, ratio / float(fdtri(4, dynamic.spare, 1 - _CHANCE)))


def gain_of_run(runs: PointRuns, run: int, fellows: Sequence[int]) -> WrongGain | None:
    """The gain of one channel that explains `run` best beside its fellows; None where no single one does.

    Where the best is too small to be a fault, no worse one is named in its place.
    """
    stiffness = runs.stiffness(fellows)
    dynamic = dynamic_difference(runs, run, fellows, stiffness)
    if dynamic is None or len(runs.channels) != 4:
        return None
    loads, turning = runs.loads, runs.turning
    load = np.linalg.norm(runs.cell_plane @ loads[fellows].mean(axis=0)[2:])
    shown = size_difference(turning, _HONEST_TURNING * turning[fellows].mean(axis=0), run, fellows)
    sources = dynamic, size_difference(loads, np.full(4, _HONEST * load), run, fellows), shown
    residual, noise, honest, spare = (np.array(values) for values in zip(*sources))
    inverse = np.linalg.inv(noise + honest)
    # what a part of a channel's own reading adds: (channel, source, row)
    pattern = np.eye(4)[:, None] * np.nan_to_num([loads[run], loads[run], turning[run]])
    pattern[:, 0] = _stacked(np.hstack([-stiffness @ runs.probe_plane, runs.cell_plane]) * runs.phasors[run]).T
    weight = np.einsum("sab,csb->csa", inverse, pattern)
    scatter = np.einsum("csa,sab,csb->cs", weight, noise, weight)
    evidence = np.array([np.sum(weight * residual, axis=2), np.sum(weight * pattern, axis=2), scatter**2 / spare])
    part, error, chance = _estimated(*evidence)
    joint = _estimated(*evidence.sum(axis=2))
    remaining = residual - joint[0][:, None, None] * pattern
    misfits = np.einsum("csa,sab,csb->cs", remaining, inverse, remaining)
    is_consistent = np.all(np.abs(part - part[:, :1]) <= _AGREE * np.hypot(error, error[:, :1]), axis=1)
    is_possible = is_consistent & (chance[:, 0] <= _PHASORS_SHOW) & (part[:, 0] <= _MOST_PART)
    is_possible &= misfits.max(axis=1) <= 4 * _STRANGE
    left = np.where(is_possible, misfits.sum(axis=1), np.inf)
    order = np.argsort(left)
    part, error, chance = joint[:, order[0]].tolist()
    if not is_possible.any() or abs(part) < _LEAST or chance > _CHANCE:
        return None
    alike = order[left[order] < left.min() + _AS_WELL]
    gain = 1 / (1 - part)
    return WrongGain(tuple(alike.tolist()), gain, gain**2 * error, chance)


def _estimated(weighted: FloatArray, information: FloatArray, doubt: FloatArray) -> FloatArray:
    """Part 1 - 1/g, its standard error, and the probability of so large a one where there is none, (3, ..).

    By its sum weighted with the information, the information, and this one's variance over it by the freedom of the
    noise; what is independent adds up. Two-sided, by the freedom of Welch and Satterthwaite.
    """
    information = np.maximum(information, _NOTHING)
    part, error, square = weighted / information, 1 / np.sqrt(information), information**2 + _NOTHING
    freedom = square / np.maximum(doubt, 1e-9 * square)  # infinite freedom is the normal distribution
    return np.array([part, error, 2 * stdtr(freedom, -np.abs(part) / error)])


def dynamic_difference(runs: PointRuns, run: int, fellows: Sequence[int], stiffness: ComplexArray) -> Difference | None:
    """Force of `run` minus H (2, 2) [N/m] of the others times its displacement: Re X, Re Y, Im X, Im Y [N].

    None where they leave no scatter, or do not tell H.
    """
    spare = 2 * (2 * len(fellows) - 4)
    D, residual = runs.displacement, runs.force - runs.displacement @ stiffness.T
    sizes = np.linalg.norm(D, axis=1)
    if spare < 4 or not sizes[run] > 0 or not np.isfinite(stiffness).all():
        return None
    rows = list(fellows)
    unit, direction = D[rows] / sizes[rows, None], D[run] / sizes[run]
    leverage = np.real(direction.conj() @ np.linalg.solve(unit.T @ unit.conj(), direction))
    scatter = np.sum(np.abs(residual[rows] / sizes[rows, None]) ** 2) / spare
    variance = scatter * sizes[run] ** 2 * (1 + leverage)
    variance += (_LEAST_PHASOR * np.linalg.norm(runs.force[run])) ** 2
    # by which share of stiffness and of damping the others differ; the matrix took 8 of their 4 n equations along
    shares = [np.linalg.lstsq(_changes(stiffness, D[j]), _stacked(residual[j]), rcond=None)[0] for j in rows]
    wander = np.mean(np.square(shares), axis=0) * len(rows) / (len(rows) - 2)
    changes = _changes(stiffness, D[run])
    honest = changes @ np.diag(_HONEST**2 + wander) @ changes.T
    return Difference(_stacked(residual[run]), variance * np.eye(4), honest, spare)


def _changes(stiffness: ComplexArray, displacement: ComplexArray) -> FloatArray:
    """Force by stiffness and by damping alone, (4, 2) as `_stacked` [N]: what a stiffer, a more damped bearing adds."""
    return np.stack([_stacked(stiffness.real @ displacement), _stacked(1j * stiffness.imag @ displacement)], axis=1)


def size_difference(sizes: FloatArray, honest: FloatArray, run: int, fellows: Sequence[int]) -> Difference:
    """Sizes (n, 4) of `run` minus the others', by channel [m, N]; nothing where they are not told (NaN).

    `honest` (4,): by how much they may differ besides.
    """
    known = np.isfinite(sizes[[run, *fellows]]).all(axis=0)
    size, *others = np.where(known, sizes, 0.0)[[run, *fellows]]
    scatter = (1 + 1 / len(others)) * np.var(others, axis=0, ddof=1)
    variance = np.where(known, honest**2 + _NOTHING, _UNKNOWN)
    return Difference(size - np.mean(others, axis=0), np.diag(scatter), np.diag(variance), len(others) - 1)


def _stacked(vector: ComplexArray) -> FloatArray:
    """Real parts, then imaginary ones."""
    return np.concatenate([vector.real, vector.imag])
