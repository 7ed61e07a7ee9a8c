"""The one run of an operating point in which one probe or cell reads some per cent too much or too little.

Two probes and two cells serve all runs of a point. If one of them reads g times the truth in one run, the part
1 - 1/g of its own reading is too much there, at the excitation line and in the mean alike. The part is estimated from
the run against the others, by generalised least squares: noise is what the others scatter by, and beside it stands
what honest runs differ by: a bearing that answers a little softer or less damped in one run, a load that misses its set
point and moves the shaft as well. A gain is named where phasors and means together leave no room for chance, the
phasors show it by themselves, the means do not contradict it, and nothing else in the run is strange.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.check.point_readings import PointReadings, leverage, one_by_one

#: Stiffness, damping and static load of one run may differ from the others' by this share, one standard deviation:
#: oil gets warmer, loads are set by hand.
_HONEST = 0.01
#: Least scatter that runs are credited with: phasors and mean loads as a share, mean positions [m].
_LEAST_PHASOR, _LEAST_LOAD, _LEAST_POSITION = 1e-4, 1e-3, 10e-9
#: How well the zero of a probe, and so its distance from there, is known from a clearance run.
_LEVER_KNOWN = 0.25
#: Probability of naming anything in an operating point without fault.
_CHANCE = 1e-4
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


@dataclass(frozen=True)
class WrongGain:
    """A gain that one channel has in one run only; channels that explain the run as well, the likeliest first."""

    run: int
    channels: tuple[int, ...]
    gain: float
    error: float
    means: bool
    chance: float

    def words(self, names: Sequence[str]) -> str:
        """What it looks like; `names` are those of probes and cells."""
        off = self.gain - 1
        others = [names[i] for i in self.channels[1:]]
        instead = f" (or {' or '.join(others)} another gain)" if others else ""
        by = "phasor and mean say so" if self.means else "its phasor says so, its mean cannot"
        return (
            f"reads {abs(off):.1%} too {'much' if off > 0 else 'little'} (standard error {self.error:.1%}) beside the "
            f"other runs at this operating point{instead}; {by}"
        )


@dataclass(frozen=True)
class Difference:
    """How one run differs from what the others foretell, with its covariance."""

    rest: FloatArray  #: (m,)
    noise: FloatArray  #: (m, m): covariance that the others' scatter tells
    honest: FloatArray  #: (m, m): covariance of what honest runs differ by beyond it
    spare: int

    def misfit(self, pattern: FloatArray, part: float) -> float:
        """Squared distance of the rest from `part` times the pattern, per equation, in units of its covariance."""
        remaining = self.rest - part * pattern
        return float(remaining @ np.linalg.solve(self.noise + self.honest, remaining)) / len(remaining)


@dataclass(frozen=True)
class Evidence:
    """An estimate of 1 - 1/g."""

    part: float = 0.0
    information: float = 0.0
    doubt: float = 0.0  #: variance of its relative variance, over two

    def chance(self) -> float:
        """Probability of so large a part where there is none, two-sided (Welch, Satterthwaite)."""
        if self.information <= 0:
            return 1.0
        from scipy.special import stdtr

        freedom = self.information**-2 / max(self.doubt, 1e-300)
        # the t distribution of infinite freedom is the normal one, which stdtr takes as a large number
        return float(2 * stdtr(min(freedom, 1e9), -abs(self.part) * np.sqrt(self.information)))


def evidence(differences: Sequence[Difference], patterns: Sequence[FloatArray]) -> Evidence:
    """The part of the patterns that independent differences show together; of nothing where no pattern shows."""
    weights = [np.linalg.solve(d.noise + d.honest, pattern) for d, pattern in zip(differences, patterns)]
    information = sum(float(pattern @ w) for pattern, w in zip(patterns, weights))
    if not information > 0:
        return Evidence()
    part = sum(float(w @ d.rest) for d, w in zip(differences, weights)) / information
    doubt = sum(float(w @ d.noise @ w) ** 2 / d.spare for d, w in zip(differences, weights)) / information**4
    return Evidence(part, information, doubt)


def wrong_gains(readings: PointReadings, known: Collection[int] = ()) -> list[WrongGain]:
    """Find runs with one wrong gain, the clearest first; `known` are runs that stand apart anyway."""
    gains: list[WrongGain] = []

    def clearest(remaining: list[int]) -> int | None:
        tried = [gain_of_run(readings, i, [j for j in remaining if j != i]) for i in remaining]
        best = min((t for t in tried if t is not None), key=lambda t: t.chance, default=None)
        # each run is tried with two cells and two probes, a probe with two zeros
        if best is None or best.chance > _CHANCE / (6 * len(remaining)):
            return None
        gains.append(best)
        return best.run

    one_by_one(len(readings), known, clearest)
    return gains


def gain_of_run(readings: PointReadings, run: int, agreeing: Sequence[int]) -> WrongGain | None:
    """The gain of one channel that explains `run` best beside the `agreeing` runs; None where no single one does.

    Where the best is too small to be a fault, no worse one is named in its place.
    """
    tried = sorted(_explanations(readings, run, agreeing), key=lambda t: t.left)
    if not tried or abs(tried[0].by.part) < _LEAST:
        return None
    best = tried[0]
    alike = dict.fromkeys(t.channel for t in tried if t.left < best.left + _AS_WELL)
    gain = 1 / (1 - best.by.part)
    error = gain**2 / float(np.sqrt(best.by.information))
    return WrongGain(run, tuple(alike), gain, error, best.means, best.by.chance())


@dataclass(frozen=True)
class _Explanation:
    """One channel's; `left` is the sum of squares that it leaves, over all equations."""

    channel: int
    by: Evidence
    means: bool
    left: float


def _explanations(readings: PointReadings, run: int, agreeing: Sequence[int]) -> Iterator[_Explanation]:
    """Explanations of `run` by one channel's gain that nothing in it contradicts."""
    stiffness = readings.stiffness(agreeing)
    dynamic = None if stiffness is None else dynamic_difference(readings, run, agreeing, stiffness)
    if stiffness is None or dynamic is None:
        return
    static = static_difference(readings, run, agreeing, stiffness)
    for channel in range(4):
        pattern = _dynamic_pattern(readings, run, channel, stiffness)
        shown = evidence([dynamic], [pattern])
        if shown.chance() > _PHASORS_SHOW or shown.part > _MOST_PART:
            continue
        for lever, slack in _levers(readings, run, channel, shown.part):
            joint, means, left = _with_means(static, channel, (lever, slack), (dynamic, pattern, shown))
            misfit = dynamic.misfit(pattern, joint.part)
            if max(left, misfit) <= _STRANGE:
                free = _FREE if lever is None else 0.0
                yield _Explanation(channel, joint, means, len(pattern) * (left + misfit) + free)


def _levers(readings: PointReadings, run: int, channel: int, part: float) -> Iterator[tuple[float | None, float]]:
    """Readings that a gain would multiply in the mean, with the uncertainty of the shift; None where not known.

    A probe's gain may count from the bearing's centre, or, as that of an amplifier, from 0 V.
    """
    if channel >= 2:
        yield float(readings.cell_means[run, channel - 2]), 0.0
        return
    mean, zero = float(readings.probe_means[run, channel]), readings.centre[channel]
    yield mean, 0.0
    yield (None, 0.0) if zero is None else (mean - zero, abs(_LEVER_KNOWN * (mean - zero) * part))


def _with_means(
    static: Difference | None,
    channel: int,
    lever_and_slack: tuple[float | None, float],
    phasors: tuple[Difference, FloatArray, Evidence],
) -> tuple[Evidence, bool, float]:
    """Evidence of phasors and means, whether the means show it too, and what they leave: infinite in contradiction."""
    (lever, slack), (dynamic, pattern, shown) = lever_and_slack, phasors
    if static is None:
        return shown, False, 0.0
    own = np.arange(4) == channel
    widened = Difference(static.rest, static.noise, static.honest + slack**2 * np.diag(own), static.spare)
    multiplied = np.where(own, 1.0 if lever is None else lever, 0.0)
    by_mean = evidence([widened], [multiplied])
    if lever is None or by_mean.information <= 0:
        # the mean may have moved by anything
        return shown, False, widened.misfit(multiplied, by_mean.part)
    apart = abs(by_mean.part - shown.part) / np.sqrt(1 / by_mean.information + 1 / shown.information)
    joint = evidence([dynamic, widened], [pattern, multiplied])
    left = widened.misfit(multiplied, joint.part) if apart <= _AGREE else np.inf
    return joint, by_mean.chance() < _PHASORS_SHOW, left


def dynamic_difference(
    readings: PointReadings, run: int, agreeing: Sequence[int], stiffness: ComplexArray
) -> Difference | None:
    """Force of `run` minus H (2, 2) [N/m] of the `agreeing` runs times its displacement: Re X, Re Y, Im X, Im Y [N].

    None where they leave no scatter.
    """
    spare = 2 * (2 * len(agreeing) - 4)
    rows = list(agreeing)
    displacement, force = readings.displacement, readings.force
    size = float(np.linalg.norm(displacement[run]))
    if spare < 4 or not size > 0:
        return None
    sizes = np.linalg.norm(displacement[rows], axis=1)[:, None]
    rest = force[rows] - displacement[rows] @ stiffness.T
    variance = float(np.sum(np.abs(rest / sizes) ** 2)) / spare * size**2
    variance *= 1 + leverage(displacement[rows] / sizes, displacement[run] / size)
    variance += (_LEAST_PHASOR * float(np.linalg.norm(force[run]))) ** 2
    # by which share of stiffness and of damping the others differ; the matrix took 8 of their 4 n equations along
    shares = [
        np.linalg.lstsq(_changes(stiffness, d), _stacked(r), rcond=None)[0] for d, r in zip(displacement[rows], rest)
    ]
    wander = np.mean(np.square(shares), axis=0) * len(rows) / (len(rows) - 2)
    changes = _changes(stiffness, displacement[run])
    honest = changes @ np.diag(_HONEST**2 + wander) @ changes.T
    return Difference(_stacked(force[run] - stiffness @ displacement[run]), variance * np.eye(4), honest, spare)


def _changes(stiffness: ComplexArray, displacement: ComplexArray) -> FloatArray:
    """Force by stiffness and by damping alone, (4, 2) as `_stacked` [N]: what a stiffer, a more damped bearing adds."""
    return np.stack([_stacked(stiffness.real @ displacement), _stacked(1j * stiffness.imag @ displacement)], axis=1)


def static_difference(
    readings: PointReadings, run: int, agreeing: Sequence[int], stiffness: ComplexArray
) -> Difference | None:
    """Mean readings of `run` minus those of the `agreeing` runs: probe, probe [m], cell, cell [N].

    A load that misses its set point shows in the cells and, over the stiffness (2, 2) [N/m], in the probes; what
    positions wander by besides is their scatter. None where the stiffness cannot carry a load.
    """
    if len(agreeing) < 2 or np.linalg.eigvalsh(stiffness.real + stiffness.real.T)[0] <= 0:
        return None
    compliance = np.linalg.inv(stiffness.real)
    rows = list(agreeing)
    loads, places = readings.cell_means @ readings.cell_plane.T, readings.probe_means @ readings.probe_plane.T
    misses = loads[rows] - loads[rows].mean(axis=0)
    wander = places[rows] - places[rows].mean(axis=0) - misses @ compliance.T
    spare = 2 * (len(agreeing) - 1)
    size = float(np.linalg.norm(loads[rows].mean(axis=0)))
    to_probes, to_cells = np.linalg.inv(readings.probe_plane), np.linalg.inv(readings.cell_plane)
    by_load = np.vstack([to_probes @ compliance, to_cells])
    by_place = np.vstack([to_probes, np.zeros((2, 2))])
    more = 1 + 1 / len(agreeing)
    load_variance, place_variance = (float(np.sum(x**2)) / spare for x in (misses, wander))
    noise = more * (load_variance * by_load @ by_load.T + place_variance * by_place @ by_place.T)
    least = np.diag([_LEAST_POSITION**2] * 2 + [max((_LEAST_LOAD * size) ** 2, 1e-12)] * 2)
    honest = (_HONEST * size) ** 2 * by_load @ by_load.T + least
    means = np.concatenate([readings.probe_means, readings.cell_means], axis=1)
    return Difference(means[run] - means[rows].mean(axis=0), noise, honest, spare)


def _dynamic_pattern(readings: PointReadings, run: int, channel: int, stiffness: ComplexArray) -> FloatArray:
    """What a channel (probes 0 and 1, cells 2 and 3) contributes to force minus H times displacement, as `_stacked`."""
    if channel < 2:
        return _stacked(-stiffness @ readings.probe_plane[:, channel] * readings.probes[run, channel])
    return _stacked(readings.cell_plane[:, channel - 2] * readings.cells[run, channel - 2])


def _stacked(vector: ComplexArray) -> FloatArray:
    """Real parts, then imaginary ones."""
    return np.concatenate([vector.real, vector.imag])
