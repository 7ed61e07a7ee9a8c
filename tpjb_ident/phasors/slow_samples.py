"""Bad samples and channels of slow records: glitches, channels that stand still, more than two that do not agree.

Glitches jump out of the signal and come back. A staircase, a ramp and a shaft that slides from corner to corner all
move monotonically over the length of a glitch. So a sample belongs to the signal when it lies between the median of
what came before and the median of what comes after, give or take the noise; a median filter alone would cut the
corners of every ramp.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage, special

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from rigdata.vector import directions
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.phasors.line_fit import robust_deviation

_ROUNDING = 1e-9  # of the reading, for a component that does not move at all
_SMALLEST = 1e-4  # of the range: in a computed record without noise rounding is no glitch
_NOTHING = 1e-15  # [m] or [N]: below what any sensor knows
_LONGEST_GLITCH, _LONGEST = 0.25, 60  # [s], samples
_THRESHOLD = 7.0  # noise standard deviations beyond both medians
_UNDITHERED = 0.3  # share of samples that differ from the one before, below which noise does not reach a step
_SHORTEST = 50  # samples
_TIMES_EXPECTED = 10.0
#: Share of repeated readings, apart from the longest stretch: a computed record, or a coarse converter.
_NOISE_FREE = 0.5
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


def spare_slopes(run: Run, along: FloatArray) -> dict[str, FloatArray]:
    """By how much each live reading changes with the vector of its quantity along directions (k, 2), (k,) each.

    Of quantities alone that more than two channels tell.
    """
    slopes = {}
    for quantity in ("force", "displacement"):
        names = [name for name, c in run.channels.items() if c.quantity == quantity and c.axis is not None]
        if len(names) < 3:
            continue
        moved = run.vector(quantity).values @ along.T
        for name in names:
            reading = run.record(name).values
            used = good_samples(np.column_stack([moved, reading]))
            if np.ptp(reading[used]) > 0.0:
                design = np.column_stack([moved[used], np.ones(used.sum())])
                slopes[name] = np.linalg.lstsq(design, reading[used], rcond=None)[0][:-1]
    return slopes


def refused_runs(problems: Sequence[Problem]) -> Conditions:
    """A condition that names the runs which were left out, with the first reason of each; none where all are used."""
    reasons = {str(problem.run): problem.what for problem in reversed(problems)}
    listed = "; ".join(f"{run} ({reasons[run]})" for run in sorted(reasons))
    return holding((reasons, "runs-refused", listed))


def piece_means(values: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Means of the rows of `values` (n, k) over pieces first..last-1 (m,), (m, k)."""
    total = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)])
    return (total[last] - total[first]) / (last - first)[:, None] + values[0]


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
    statistics = {}
    for name, channel in run.channels.items():
        if channel.quantity in ("force", "displacement"):
            statistics[name] = ChannelStatistics()
            statistics[name].add(run.record(name).values)
    alive = [c for name, c in run.channels.items() if name not in statistics or not statistics[name].constant]
    used = {name: c for name, c in run.channels.items() if c in alive or not is_spare(c, alive)}
    if len(used) < len(run.channels):
        run = replace(run, channels=used)
    problems = []
    for quantity in ("force", "displacement"):
        alike = [name for name, c in run.channels.items() if c.quantity == quantity]
        repeated = 0.0  # largest share of readings equal to the one before, apart from the longest stretch
        for name in alike:
            s = statistics[name]
            if not s.constant:
                repeated = max(repeated, (s.repeats - s.longest_flat + 1) / max(s.values - s.longest_flat, 1))
        # else noise is below a converter's step, and standing still is usual
        if repeated <= _NOISE_FREE:
            problems += [_problem(run, name, statistics[name]) for name in alike if stands_still(statistics[name])]
    if problems:
        raise RigDataError(problems)
    return run


def stands_still(statistics: ChannelStatistics) -> bool:
    """Whether the longest stretch of equal readings is longer than chance makes it."""
    return statistics.longest_flat >= max(_SHORTEST, _TIMES_EXPECTED * statistics.expected_flat())


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
    groups = defaultdict(list)
    for name in slopes[0] if slopes else ():
        if all(name in run_slopes for run_slopes in slopes):
            groups[channels[name].quantity, channels[name].plane].append(name)
    contradicting = []
    for (quantity, _), names in groups.items():
        columns = []
        for name in names:
            columns.append(np.concatenate([run_slopes[name] for run_slopes in slopes]))
        rows = np.column_stack(columns)
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
