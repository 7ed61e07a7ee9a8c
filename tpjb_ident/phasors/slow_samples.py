"""Bad samples and channels of slow records: glitches, channels that stand still, more than two that do not agree.

Glitches jump out of the signal and come back. A staircase, a ramp and a shaft that slides from corner to corner all
move monotonically over the length of a glitch. So a sample belongs to the signal when it lies between the median of
what came before and the median of what comes after, give or take the noise; a median filter alone would cut the
corners of every ramp.

The noise of a displacement channel over seconds is white, 1/f, walk and drift, learnt from the records themselves.
A staircase test lasts some ten seconds, in which a probe drifts by a tenth of a micrometre or more. Drift
grows with time and so does the load: taken for deflection it makes a stiff pivot several per cent softer or
stiffer. What tells them apart is that drift goes on during the holds. A covariance with a drift term uses
exactly that, and widens the interval by what is left; averages with a standard deviation over the square
root of n would be blind to it.

A drift is straight, with a bend; a walk has a rate that changes all the time, as in a draught: over ten seconds it
goes further than the 1/f noise that looks like it over one.

The four levels are estimated by restricted maximum likelihood (Patterson and Thompson, Biometrika 58,
1971, 545-554), pooled over all series of a campaign: the probes are the same in each.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage, optimize, special

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from rigdata.vector import directions
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.line_fit import robust_deviation

_ROUNDING = 1e-9  # of the reading, for a component that does not move at all
_SMALLEST = 1e-4  # of the range: in a computed record without noise rounding is no glitch
_NOTHING = 1e-15  # [m] or [N]: below what any sensor knows
_LONGEST_GLITCH, _LONGEST = 0.25, 60  # [s], samples
_THRESHOLD = 7.0  # noise standard deviations beyond both medians
_UNDITHERED = 0.3  # share of samples that differ from the one before, below which noise does not reach a step
_SHORTEST = 50  # samples
_TIMES_EXPECTED = 10.0
_NOISE_FREE = (
    0.5  # share of repeated readings, apart from the longest stretch: a computed record, or a coarse converter
)
REMEDY = "Check sensitivities and axes against the certificates and the drawing; set the wrong one to ignore"
#: Two directions whose smallest singular value is below this tell no plane.
_PLANE = 0.1
#: Gain uncertainty of a channel where nothing is stated; what a curved path leaves of a slope; chance of a false alarm.
_GAIN, _CURVED, _BY_CHANCE = 0.005, 1e-3, 1e-4


def slow_samples(run: Run) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray, float]:
    """Both vectors of a slow record at the times of the slower one, and which samples are good.

    Gives time (n,) and force, displacement (n, 2), good (n,) and the rate [Hz]; `run` is a `live_run`.
    """
    force, displacement = run.vector("force"), run.vector("displacement")
    slower = force if len(force) < len(displacement) else displacement
    load, place = force.at(slower.time), displacement.at(slower.time)
    # a slow logger's glitches are a few samples long, and so may be its holds
    longest = int(np.clip(_LONGEST_GLITCH * slower.rate, 3, _LONGEST))
    return slower.time, load, place, good_samples(np.hstack([load, place]), longest), slower.rate


def _statistics(run: Run) -> dict[str, ChannelStatistics]:
    """Statistics of every force and displacement channel."""
    statistics: dict[str, ChannelStatistics] = {}
    for name, channel in run.channels.items():
        if channel.quantity in ("force", "displacement"):
            statistics[name] = ChannelStatistics()
            statistics[name].add(np.asarray(run.record(name).values))
    return statistics


def spare_slopes(run: Run, along: FloatArray) -> dict[str, FloatArray]:
    """By how much each live reading changes with the vector of its quantity along directions (k, 2), (k,) each.

    Of quantities alone that more than two channels tell.
    """
    slopes: dict[str, FloatArray] = {}
    for quantity in ("force", "displacement"):
        names = [name for name, c in run.channels.items() if c.quantity == quantity and c.axis is not None]
        if len(names) < 3:
            continue
        moved = run.vector(quantity).values @ along.T
        for name in names:
            reading = np.asarray(run.record(name).values)
            used = good_samples(np.column_stack([moved, reading]))
            if np.ptp(reading[used]) > 0.0:
                design = np.column_stack([moved[used], np.ones(used.sum())])
                slopes[name] = np.linalg.lstsq(design, reading[used], rcond=None)[0][:-1]
    return slopes


def refused_runs(problems: Sequence[Problem]) -> tuple[Condition, ...]:
    """A condition that names the runs which were left out, with the first reason of each; none where all are used."""
    reasons = {str(problem.run): problem.what for problem in reversed(problems)}
    listed = "; ".join(f"{run} ({reasons[run]})" for run in sorted(reasons))
    return holding((reasons, "runs-refused", listed))


def piece_means(values: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Means of the rows of `values` (n, k) over pieces first..last-1 (m,), (m, k)."""
    total = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)])
    return np.asarray((total[last] - total[first]) / (last - first)[:, None] + values[0])


def good_samples(values: FloatArray, longest: int = _LONGEST) -> BoolArray:
    """Samples that are neither missing nor part of a glitch, (n,); `values` (n, d)."""
    good = np.asarray(np.isfinite(values).all(axis=1))
    index = np.flatnonzero(good)
    if len(index) >= 8:
        bad = np.any([_outside_both_medians(column, longest) for column in values[index].T], axis=0)
        # the flanks of a glitch stay below the threshold
        good[index[ndimage.binary_dilation(bad, iterations=2)]] = False
    return good


def _outside_both_medians(x: FloatArray, longest: int) -> BoolArray:
    """True where `x` leaves the range between the medians of its two neighbourhoods."""
    n = len(x)
    half = min(longest, (n - 1) // 4)
    width = 2 * half + 1
    # a record that begins or ends within a ramp is continued by its point reflection, so the ramp stays a
    # ramp
    padded = np.concatenate([2 * np.median(x[:5]) - x[half:0:-1], x, 2 * np.median(x[-5:]) - x[-2 : -half - 2 : -1]])
    median = ndimage.median_filter(padded, size=width, mode="nearest")
    centre = np.arange(n) + half
    before = median[np.clip(centre - half - 1, half, n + half - 1)]
    after = median[np.clip(centre + half + 1, half, n + half - 1)]
    noise = max(  # never below the recording's resolution
        robust_deviation(x - median[centre]),
        0.5 * converter_step(x)[0],
        _SMALLEST * np.ptp(x),
        _ROUNDING * np.max(np.abs(x)),
        _NOTHING,
    )
    beyond = np.maximum(np.minimum(before, after) - x, x - np.maximum(before, after))
    return beyond > _THRESHOLD * noise


def converter_step(x: FloatArray) -> tuple[float, float]:
    """Usual step between readings (n,) that differ, and the share that differs.

    Two converters turned into X and Y leave rounding residues, and so does text that rounds: those are no steps.
    """
    moves = np.abs(np.diff(x))
    steps = moves[moves > 1e-6 * np.ptp(x)]
    return (float(np.median(steps)), len(steps) / len(moves)) if len(steps) else (0.0, 0.0)


def level_error(displacement: FloatArray) -> float:
    """Error of a level [m] that stands between two steps of the converter, where no noise dithers it."""
    steps = [step for step, share in map(converter_step, displacement.T) if share < _UNDITHERED]
    return max(steps, default=0.0) / math.sqrt(6.0)


def live_run(run: Run) -> Run:
    """The run without channels that nobody misses; refused where one of force or displacement stands still for a while.

    A force or displacement that stops in the middle of a staircase looks like a very stiff or very soft pivot: nothing
    in the curve itself gives it away, but readings without noise do.
    """
    statistics = _statistics(run)
    alive = [c for name, c in run.channels.items() if name not in statistics or not statistics[name].constant]
    used = {name: c for name, c in run.channels.items() if c in alive or not is_spare(c, alive)}
    if len(used) < len(run.channels):
        run = replace(run, channels=used)
    problems = []
    for quantity in ("force", "displacement"):
        alike = [name for name, c in run.channels.items() if c.quantity == quantity]
        moving = [_repeated(statistics[name]) for name in alike if not statistics[name].constant]
        if (
            max(moving, default=0.0) <= _NOISE_FREE
        ):  # else noise is below a converter's step, and standing still is usual
            problems += [_problem(run, name, statistics[name]) for name in alike if stands_still(statistics[name])]
    if problems:
        raise RigDataError(problems)
    return run


def stands_still(statistics: ChannelStatistics) -> bool:
    """Whether the longest stretch of equal readings is longer than chance makes it."""
    return statistics.longest_flat >= max(_SHORTEST, _TIMES_EXPECTED * statistics.expected_flat())


def _repeated(statistics: ChannelStatistics) -> float:
    """Share of samples equal to the one before, apart from the longest stretch."""
    return (statistics.repeats - statistics.longest_flat + 1) / max(statistics.values - statistics.longest_flat, 1)


def _problem(run: Run, name: str, statistics: ChannelStatistics) -> Problem:
    start, share = statistics.flat_start / run.sample_rate, statistics.longest_flat / max(statistics.samples, 1)
    how_long = f"from {start:.2f} s on for {100 * share:.0f} % of the run"
    text = f"run {run.id}: stands still {how_long}: stuck, clipped or dead"
    cure = "Check sensor, range and logger, and repeat the run"
    return Problem("error", run.file, f"channel {name}", text, cure, run=run.id)


def is_spare(channel: Channel, alive: Sequence[Channel]) -> bool:
    """Whether the others of a channel's quantity that are alive tell the plane without it."""
    axes = [c.axis for c in alive if c.quantity == channel.quantity and c.name != channel.name and c.axis is not None]
    return len(axes) > 1 and bool(np.linalg.svd(directions(axes), compute_uv=False)[-1] > _PLANE)


def contradictions(
    channels: Mapping[str, Channel], slopes: Sequence[Mapping[str, FloatArray]], noise: Mapping[str, Sequence[float]]
) -> list[str]:
    """Names of channels of one plane that do not agree, each set of them in one text.

    `slopes`: of every run, by how much each reading changes with some directions (k,); `noise`: by quantity, standard
    error of the slopes of every run.
    """
    groups: dict[tuple[str, float], list[str]] = {}
    for name in slopes[0] if slopes else ():
        if all(name in run_slopes for run_slopes in slopes):
            groups.setdefault((str(channels[name].quantity), channels[name].plane), []).append(name)
    contradicting = []
    for (quantity, _), names in groups.items():
        rows = np.vstack([np.column_stack([run_slopes[name] for name in names]) for run_slopes in slopes])
        spread = np.repeat(np.clip(noise[quantity], _CURVED, 1.0), len(rows) // len(slopes))
        if len(names) > 2 and _chance([channels[name] for name in names], rows, spread) < _BY_CHANCE:
            listed = ", ".join(names)
            contradicting.append(f"{listed} contradict one another: no movement makes all of them read what they do")
    return contradicting


def _chance(channels: Sequence[Channel], rows: FloatArray, noise: FloatArray) -> float:
    """Chance of channels (m) that are as stated to leave as much as these do.

    The changes s (m,) of readings along axes A (m, 2) with null space N leave N s, which gains and angles of the
    channels, common to all rows (r, m), and each row's own noise (r,) must explain.
    """
    axes = directions([channel.axis or 0.0 for channel in channels])
    null = np.linalg.svd(axes)[0][:, 2:].T
    gain = np.array([_GAIN if channel.uncertainty is None else channel.uncertainty for channel in channels])
    angle = np.array([channel.axis_uncertainty for channel in channels])
    moved = np.linalg.lstsq(axes, rows.T, rcond=None)[0]
    turned = (axes @ np.array([moved[1], -moved[0]])).T
    effects = [np.hstack([null * (s * gain), null * (t * angle)]) for s, t in zip((axes @ moved).T, turned)]
    spread = np.repeat(noise, len(null))[:, None]
    design, residual = np.vstack(effects) / spread, (rows @ null.T).ravel() / spread[:, 0]
    best, _, rank, _ = np.linalg.lstsq(design, residual, rcond=None)
    # what no gain or angle whatever explains is noise: of probes that drift more than they seem to
    inexplicable = np.sum((residual - design @ best) ** 2) / max(len(residual) - rank, 1)
    covariance = design @ design.T + max(inexplicable, 1.0) * np.eye(len(residual))
    return float(special.chdtrc(len(residual), residual @ np.linalg.solve(covariance, residual)))


DRIFT_RATE = 1.0e-8  # [m/s], centre of the prior
DRIFT_OVER_FLICKER = 0.7  # [1/sqrt(s)], drift rate to be expected over the square root of the 1/f power density
_BEND = 0.5  # of a drift: half of what its rate at either end differs by from that in the middle, standard deviation
_WAVES = 8  # half cosines over a record that stand for the slowest part of a walk, which no stationary noise resembles
_WALK_OVER_FLICKER = 0.2  # [1/sqrt(s)], walk to be expected over the square root of the 1/f power density
_PINNED = 0.01  # of ln(drift rate): as good as given
# time constants [s] of the exponentially correlated processes whose sum has a 1/f spectrum from some 5 mHz
# to 5 Hz
_FLICKER_TIMES = 0.05 * 4.0 ** np.arange(7)
# power density [1/Hz] at 1 Hz of the sum of unit processes
_FLICKER_GAIN = float(np.sum(4.0 * _FLICKER_TIMES / (1.0 + (2.0 * np.pi * _FLICKER_TIMES) ** 2)))


@dataclass(frozen=True)
class NoiseModel:
    """Levels of the four kinds of noise."""

    white: float  #: [m^2 s]
    flicker: float  #: [m^2]
    drift: float  #: [m/s]
    walk: float = 0.0  #: [m/sqrt(s)]

    def covariance(self, time: FloatArray, duration: FloatArray) -> FloatArray:
        """Covariance of block averages, (m, m); `time`, `duration` (m,) [s]."""
        return np.diag(self.white / duration) + self.slow_covariance(time, duration)

    def slow_covariance(self, time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
        """All but the white noise, (m, m); `time` (m,) [s]; of averages where `duration` (m,) [s] is given."""
        centred = time - np.mean(time)
        bent = 2.0 * _BEND * (centred**2 - np.mean(centred**2)) / max(np.ptp(time), 1e-300)
        drift = self.drift * np.column_stack([centred, bent])
        slow = self.flicker * flicker_kernel(time, duration) + drift @ drift.T
        return slow + self.walk**2 * walk_kernel(time, duration)

    def mean_variance(self, duration: float) -> float:
        """Variance of one average over `duration` seconds about the run's own level [m^2]."""
        time = (np.arange(40) + 0.5) * duration / 40
        return self.white / duration + self.flicker * float(np.mean(flicker_kernel(time)))


def walk_kernel(time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
    """Covariance (m, m) about its mean of a walk of one metre per square root of a second; of averages if `duration`.

    `time` (m,) [s], `duration` (m,) [s].
    """
    span = max(np.ptp(time), 1e-300)
    share = (time - np.min(time)) / span
    square = 0.5 * share**2
    kernel = span * (1.0 / 3.0 + square[:, None] + square - np.maximum(share[:, None], share))
    # the later of two moments within an average comes a sixth of it after its middle
    return kernel if duration is None else kernel - np.diag(duration / 6.0)


def _walk_columns(time: FloatArray) -> FloatArray:
    """Columns (m, k) that sum up, with random factors, to a walk of one metre per square root of a second at `time`."""
    span = max(np.ptp(time), 1e-300)
    waves = np.pi * np.arange(1, _WAVES + 1)
    return np.cos((time[:, None] - np.min(time)) / span * waves) * np.sqrt(2.0 * span) / waves


def flicker_kernel(time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
    """Covariance (m, m) of 1/f noise of unit power density at 1 Hz; of averages where `duration` is given.

    `time` (m,) [s], `duration` (m,) [s].
    """
    lag = np.abs(time[:, None] - time[None, :])
    kernel = np.zeros_like(lag)
    for tau in _FLICKER_TIMES:
        term = np.exp(-lag / tau)
        if duration is not None:
            x = duration / tau
            # variance of the average of an exponentially correlated process over x time constants
            np.fill_diagonal(term, 2.0 / x * (1.0 + np.expm1(-x) / x))
        kernel += term
    return kernel / _FLICKER_GAIN


@dataclass(frozen=True)
class NoiseSeries:
    """One series from which noise is learnt."""

    time: FloatArray  #: `time`, `duration` (m,), s: blocks
    duration: FloatArray
    values: FloatArray  #: (m,), m: block averages
    mean: FloatArray  #: (m, p)


def _rotated(series: Sequence[NoiseSeries], unit: float) -> list[tuple[FloatArray, FloatArray]]:
    """Series of one shape together, k of them, each in the basis in which white and 1/f noise are both diagonal.

    Every level that the search tries costs a few products of small matrices for all of them together. Gives spectra
    (k, m, 2) over the white noise, of the 1/f noise and (all but diagonal there) of a walk's quick part; and signal,
    drift, the walk's slow part and values (k, m, p + 10).
    """
    groups: dict[tuple[int, ...], list[tuple[FloatArray, FloatArray]]] = {}
    for samples in series:
        root = np.sqrt(samples.duration)
        kernel = flicker_kernel(samples.time, samples.duration) * np.outer(root, root)
        spectrum, basis = np.linalg.eigh(kernel)
        waves = _walk_columns(samples.time)
        quick = (walk_kernel(samples.time, samples.duration) - waves @ waves.T) * np.outer(root, root)
        spectra = np.column_stack([spectrum, np.sum(basis * (quick @ basis), axis=0)])
        scale = np.maximum(np.max(np.abs(samples.mean), axis=0), 1e-300)
        mean, _ = np.linalg.qr((samples.mean / scale) * root[:, None])
        drift = samples.time - np.mean(samples.time)
        slow = np.column_stack([drift, waves]) * root[:, None]
        columns = np.column_stack([mean, slow, samples.values / unit * root])
        groups.setdefault(samples.mean.shape, []).append((np.maximum(spectra, 0.0), basis.T @ columns))
    stacks = (zip(*alike) for alike in groups.values())
    return [(np.stack(spectra), np.stack(columns)) for spectra, columns in stacks]


def _minus_log_likelihood(spectra: FloatArray, columns: FloatArray, levels: FloatArray) -> float:
    """Sum over series of one shape; white, 1/f, drift and walk `levels` (4,) in the unit of `_rotated`."""
    white, flicker, drift, walk = levels
    variance = white + spectra @ [flicker, walk**2]
    p = columns.shape[2] - _WAVES - 2
    scale = np.r_[np.ones(p), drift, np.full(_WAVES, walk), 1.0]
    gram = np.swapaxes(columns, 1, 2) @ (columns / variance[..., None]) * np.outer(scale, scale)
    # drift and walk are random columns: Woodbury takes them out of every product at once
    u = gram[:, p:-1]
    inner = np.eye(_WAVES + 1) + u[:, :, p:-1]
    gram = gram - np.swapaxes(u, 1, 2) @ np.linalg.solve(inner, u)
    xx, xy, yy = gram[:, :p, :p], gram[:, :p, -1], gram[:, -1, -1]
    log_det = np.log(variance).sum() + np.linalg.slogdet(inner)[1].sum() + np.linalg.slogdet(xx)[1].sum()
    explained = np.sum(xy * np.linalg.solve(xx, xy[..., None])[..., 0])
    return 0.5 * float(log_det + yy.sum() - explained)


def estimate_noise(
    series: Sequence[NoiseSeries], drift_rate: float = DRIFT_RATE, learn_drift: bool = True
) -> NoiseModel:
    """Estimate the noise levels common to several series."""
    usable = [s for s in series if len(s.time) > s.mean.shape[1] + 2]
    if not usable:
        raise BadInputError("no series is long enough to learn noise from: record longer holds")
    white = float(np.median([_white_level(s) for s in usable]))
    unit = np.sqrt(white)
    rotated = _rotated(usable, unit)
    prior = np.log(drift_rate / unit)
    spread = np.r_[5.0, 5.0, np.full(2, 1.0 if learn_drift else _PINNED)]

    def objective(logs: FloatArray) -> float:
        levels = np.exp(np.clip(logs, -30.0, 30.0))
        # probes that flicker more drift and walk more; beyond that, a level that the data do not feel (no 1/f at all)
        # must not run away to minus infinity
        drift = 0.5 * np.log(np.exp(2.0 * prior) + DRIFT_OVER_FLICKER**2 * levels[1])
        expected = np.array([0.0, 0.0, drift, np.log(_WALK_OVER_FLICKER) + 0.5 * logs[1]])
        likelihood = sum(_minus_log_likelihood(*alike, levels) for alike in rotated)
        return likelihood + 0.5 * float(np.sum(((logs - expected) / spread) ** 2))

    corner = np.array([-0.5, -0.5, prior, -2.0])
    simplex = np.vstack([corner, corner + 1.4 * np.eye(4)])  # a factor of four in each level
    options = {"xatol": 0.05, "fatol": 0.05, "maxiter": 250, "initial_simplex": simplex}
    solution = optimize.minimize(objective, corner, method="Nelder-Mead", options=options)
    return NoiseModel(*(np.exp(solution.x) * [white, white, unit, unit]).tolist())


def _white_level(series: NoiseSeries) -> float:
    """Rough white level [m^2 s] from second differences of neighbouring blocks."""
    second = np.diff(series.values, 2) * np.sqrt(np.median(series.duration) / 6.0)
    # a noise-free record (a simulation): anything far below the signal will do
    least = max(1e-6 * np.ptp(series.values), 1e-15) ** 2 * np.median(series.duration)
    return float(max(np.median(second**2) / 0.455, least))
