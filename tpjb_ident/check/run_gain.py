"""The one run of an operating point in which one probe or cell reads some per cent too much or too little.

Two probes and two cells serve all runs of a point. If one of them reads g times the truth in one run, the part
1 - 1/g of its own reading is too much there, at the excitation line and in the mean alike. The part is estimated from
the run against the others, by generalised least squares: noise is what the others scatter by, and beside it stands
what honest runs differ by: a bearing that answers a little softer or less damped in one run, a load that misses its set
point and moves the shaft as well. A gain is named where phasors and means together leave no room for chance, the
phasors show it by themselves, the means do not contradict it, and nothing else in the run is strange. Where no
clearance run tells what a probe reads at the centre its mean may have moved by anything: then the phasors decide.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.check.point_runs import PointRuns

#: Stiffness, damping and static load of one run may differ from the others' by this share, one standard deviation:
#: oil gets warmer, loads are set by hand.
_HONEST = 0.01
#: Least scatter that runs are credited with: phasors and mean loads as a share, mean positions [m].
_LEAST_PHASOR, _LEAST_LOAD, _LEAST_POSITION = 1e-4, 1e-3, 10e-9
#: Probability at which chance is no explanation any more, for all runs of an operating point.
CHANCE = 1e-4
#: The phasors must show the gain themselves, with this probability of chance at most.
_PHASORS_SHOW = 0.05
#: Rest that a lone gain may leave, per equation in units of its covariance: 1 % of honest runs leave more.
_STRANGE = 6.0
#: The estimates by phasors and by means may differ by this many standard deviations.
_AGREE = 3.0
#: Smaller gains are no fault: calibrations promise no more. A part beyond the other is no gain some per cent off.
_LEAST, _MOST_PART = 0.01, 0.9
#: Another channel explains a run as well if it leaves no more than this: a thousandth of the likelihood.
_AS_WELL = 2 * math.log(1e3)
#: An explanation that lets the mean move freely must leave this much less: ln of the equations, times one more unknown.
_FREE = 2.0
#: How well the zero of a probe, and so its distance from there, is known from a clearance run.
_LEVER_KNOWN = 0.25
#: Shift of a probe's mean that may have moved by anything [m].
_ANYTHING = 1.0


class WrongGain(NamedTuple):
    """A gain that one channel has in one run only; channels that explain the run as well, the likeliest first."""

    channels: tuple[int, ...]
    gain: float
    error: float
    chance: float


class Difference(NamedTuple):
    """How one run differs from what the others foretell, with its covariance."""

    residual: FloatArray  #: (m,)
    noise: FloatArray  #: (m, m): covariance that the others' scatter tells
    honest: FloatArray  #: (m, m): covariance of what honest runs differ by beyond it
    spare: int

    def misfit(self, pattern: FloatArray, part: float) -> float:
        """Squared distance of the residual from `part` times the pattern, per equation, in units of its covariance."""
        remaining = self.residual - part * pattern
        return float(remaining @ np.linalg.solve(self.noise + self.honest, remaining)) / len(remaining)


class Evidence(NamedTuple):
    """An estimate of 1 - 1/g, and the probability of so large a one where there is none."""

    part: float = 0.0
    error: float = math.inf
    chance: float = 1.0


def evidence(differences: Sequence[Difference], patterns: Sequence[FloatArray]) -> Evidence:
    """The part of the patterns that independent differences show together; of nothing where no pattern shows.

    The chance is two-sided, by Student's t with the freedom of Welch and Satterthwaite.
    """
    weights = [np.linalg.solve(d.noise + d.honest, pattern) for d, pattern in zip(differences, patterns)]
    information = sum(float(pattern @ w) for pattern, w in zip(patterns, weights))
    if not information > 0:
        return Evidence()
    part = sum(float(w @ d.residual) for d, w in zip(differences, weights)) / information
    doubt = sum(float(w @ d.noise @ w) ** 2 / d.spare for d, w in zip(differences, weights)) / information**2
    freedom = min(1 / max(doubt, 1e-300), 1e9)  # infinite freedom is the normal distribution
    chance = float(2 * stdtr(freedom, -abs(part) * math.sqrt(information)))
    return Evidence(part, 1 / math.sqrt(information), chance)


def wrong_gains(runs: PointRuns, outliers: Collection[int] = ()) -> dict[int, WrongGain]:
    """Runs with one wrong gain; `known` are runs that stand apart anyway."""

    def oddness(run: int, peers: list[int]) -> float:
        gain = gain_of_run(runs, run, peers)
        # each run is tried with two cells and two probes, a probe with two zeros
        return 0.0 if gain is None else CHANCE / (6 * (len(peers) + 1)) / max(gain.chance, 1e-300)

    wrong = runs.outlying(outliers, oddness)
    gains = {run: gain_of_run(runs, run, runs.without(wrong)) for run in sorted(wrong.difference(outliers))}
    return {run: gain for run, gain in gains.items() if gain is not None}


def gain_of_run(runs: PointRuns, run: int, peers: Sequence[int]) -> WrongGain | None:
    """The gain of one channel that explains `run` best beside the others; None where no single one does.

    Where the best is too small to be a fault, no worse one is named in its place.
    """
    tried = sorted(_explanations(runs, run, peers))
    if not tried or abs(tried[0][2].part) < _LEAST:
        return None
    least, _, best = tried[0]
    alike = dict.fromkeys(channel for misfit, channel, _ in tried if misfit < least + _AS_WELL)
    gain = 1 / (1 - best.part)
    return WrongGain(tuple(alike), gain, gain**2 * best.error, best.chance)


def _explanations(runs: PointRuns, run: int, peers: Sequence[int]) -> Iterator[tuple[float, int, Evidence]]:
    """Explanations of `run` by one channel's gain that nothing in it contradicts, with the squares that they leave."""
    stiffness = runs.stiffness(peers)
    dynamic = None if stiffness is None else dynamic_difference(runs, run, peers, stiffness)
    if stiffness is None or dynamic is None:
        return
    static = static_difference(runs, run, peers, stiffness)
    forces = np.hstack([-stiffness @ runs.probe_plane, runs.cell_plane]) * runs.phasors[run]  # of every channel
    for channel, pattern in enumerate(map(_stacked, forces.T)):
        shown = evidence([dynamic], [pattern])
        if shown.chance > _PHASORS_SHOW or shown.part > _MOST_PART:
            continue
        selector = np.diag(np.arange(4) == channel).astype(float)
        for lever, slack in _levers(runs, run, channel, shown.part):
            means = static._replace(honest=static.honest + slack**2 * selector)
            by_mean = evidence([means], [lever * selector[channel]])
            distance = abs(by_mean.part - shown.part) / math.hypot(by_mean.error, shown.error)
            joint = evidence([dynamic, means], [pattern, lever * selector[channel]])
            misfits = dynamic.misfit(pattern, joint.part), means.misfit(lever * selector[channel], joint.part)
            if distance <= _AGREE and max(misfits) <= _STRANGE:
                yield len(pattern) * sum(misfits) + (_FREE if slack == _ANYTHING else 0.0), channel, joint


def _levers(runs: PointRuns, run: int, channel: int, part: float) -> list[tuple[float, float]]:
    """Readings that a gain would multiply in the mean, with the uncertainty of the shift.

    A probe's gain may count from the bearing's centre, or, as that of an amplifier, from 0 V.
    """
    mean = float(runs.means[run, channel])
    if channel >= 2:
        return [(mean, 0.0)]
    lever = mean - runs.centre[channel]
    return [(mean, 0.0), (lever, abs(_LEVER_KNOWN * lever * part)) if np.isfinite(lever) else (0.0, _ANYTHING)]


def dynamic_difference(runs: PointRuns, run: int, peers: Sequence[int], stiffness: ComplexArray) -> Difference | None:
    """Force of `run` minus H (2, 2) [N/m] of the others times its displacement: Re X, Re Y, Im X, Im Y [N].

    None where they leave no scatter.
    """
    spare = 2 * (2 * len(peers) - 4)
    D, residual = runs.displacement, runs.force - runs.displacement @ stiffness.T
    sizes = np.linalg.norm(D, axis=1)
    if spare < 4 or not sizes[run] > 0:
        return None
    rows = list(peers)
    unit, direction = D[rows] / sizes[rows, None], D[run] / sizes[run]
    leverage = float(np.real(direction.conj() @ np.linalg.solve(unit.T @ unit.conj(), direction)))
    scatter = float(np.sum(np.abs(residual[rows] / sizes[rows, None]) ** 2)) / spare
    variance = scatter * sizes[run] ** 2 * (1 + leverage)
    variance += (_LEAST_PHASOR * float(np.linalg.norm(runs.force[run]))) ** 2
    # by which share of stiffness and of damping the others differ; the matrix took 8 of their 4 n equations along
    shares = [np.linalg.lstsq(_changes(stiffness, D[j]), _stacked(residual[j]), rcond=None)[0] for j in rows]
    wander = np.mean(np.square(shares), axis=0) * len(rows) / (len(rows) - 2)
    changes = _changes(stiffness, D[run])
    honest = changes @ np.diag(_HONEST**2 + wander) @ changes.T
    return Difference(_stacked(residual[run]), variance * np.eye(4), honest, spare)


def _changes(stiffness: ComplexArray, displacement: ComplexArray) -> FloatArray:
    """Force by stiffness and by damping alone, (4, 2) as `_stacked` [N]: what a stiffer, a more damped bearing adds."""
    return np.stack([_stacked(stiffness.real @ displacement), _stacked(1j * stiffness.imag @ displacement)], axis=1)


def static_difference(runs: PointRuns, run: int, peers: Sequence[int], stiffness: ComplexArray) -> Difference:
    """Mean readings of `run` minus those of the others: probe, probe [m], cell, cell [N].

    A load that misses its set point shows in the cells and, over the stiffness (2, 2) [N/m], in the probes; what
    positions wander by besides is their scatter. Means tell nothing where the stiffness cannot carry a load.
    """
    means = runs.means[list(peers)]
    residual = runs.means[run] - means.mean(axis=0)
    if np.linalg.eigvalsh(stiffness.real + stiffness.real.T)[0] <= 0:
        return Difference(residual, np.zeros((4, 4)), 1e30 * np.eye(4), 1)
    compliance = np.linalg.inv(stiffness.real)
    loads, places = means[:, 2:] @ runs.cell_plane.T, means[:, :2] @ runs.probe_plane.T
    misses = loads - loads.mean(axis=0)
    wander = places - places.mean(axis=0) - misses @ compliance.T
    spare = 2 * (len(means) - 1)
    size = float(np.linalg.norm(loads.mean(axis=0)))
    to_probes, to_cells = np.linalg.inv(runs.probe_plane), np.linalg.inv(runs.cell_plane)
    by_load = np.vstack([to_probes @ compliance, to_cells])
    by_place = np.vstack([to_probes, np.zeros((2, 2))])
    squares = [float(np.sum(x**2)) / spare * y @ y.T for x, y in ((misses, by_load), (wander, by_place))]
    least = np.diag([_LEAST_POSITION**2] * 2 + [max((_LEAST_LOAD * size) ** 2, 1e-12)] * 2)
    honest = (_HONEST * size) ** 2 * by_load @ by_load.T + least
    return Difference(residual, (1 + 1 / len(means)) * (squares[0] + squares[1]), honest, spare)


def _stacked(vector: ComplexArray) -> FloatArray:
    """Real parts, then imaginary ones."""
    return np.concatenate([vector.real, vector.imag])
