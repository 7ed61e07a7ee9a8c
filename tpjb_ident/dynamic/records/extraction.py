"""Reading a run chunk by chunk and fitting its windows."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.record import RowReader
from tpjb_ident.dynamic.records.lines import LineSet
from tpjb_ident.dynamic.records.phasors import SCALE_LIMIT, LineFitter, PhasorBlock, fit_uneven, usual_scale
from tpjb_ident.dynamic.records.run_data import MeasuredRun, PhasorSettings, RunPhasors
from tpjb_ident.dynamic.records.shaft import ShaftCourse, window_speeds
from tpjb_ident.dynamic.records.windows import plan_windows

QUANTITIES = ("displacement", "force", "acceleration")
#: Samples of one channel held at a time: few enough for X and Y to stay in a core's cache.
CHUNK = 2**15
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02


def extract(
    run: MeasuredRun, housing_mass: float, settings: PhasorSettings, lines: LineSet, follow: ShaftCourse | None = None
) -> RunPhasors:
    """Fit all windows of a run."""
    length, count = plan_windows(run.length, run.sample_rate, lines, settings.windows)
    present = {c.quantity for c in run.channels.values()}
    quantities = tuple(q for q in QUANTITIES if q in present or q != "acceleration")
    middles = (np.arange(count) + 0.5) * length / run.sample_rate
    speeds = None if follow is None else follow.at(np.asarray(middles, dtype=float))
    work = _Work(length, run.sample_rate, lines, speeds, run.point.shaft_speed_hz)
    parts: list[_Fitted] = []
    with run.opened():
        stretches = run.row_reader(quantities)
        for first, stop in _chunks(length, count):
            parts.append(work.fit(stretches, first, stop))
        blocks = {q: _joined([part.blocks[q] for part in parts]) for q in quantities}
        if len(parts) > 1:
            _look_again(work, stretches, blocks)
    starts = np.concatenate([part.start for part in parts])
    tach = np.concatenate([part.speeds for part in parts])
    recorded = RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        starts,
        length / run.sample_rate,
        blocks["displacement"],
        blocks["force"],
        blocks.get("acceleration"),
        housing_mass,
        tach,
    )
    return recorded.advanced(settings.delays)


def _chunks(length: int, count: int) -> Iterator[tuple[int, int]]:
    step = max(1, CHUNK // length)
    for first in range(0, count, step):
        yield first, min(first + step, count)


def _look_again(work: _Work, stretches: RowReader, blocks: dict[str, PhasorBlock]) -> None:
    """Fit windows anew that are noisier than the run's usual one: a chunk alone may hold nothing to compare with."""
    usual = {q: usual_scale(block.noise) for q, block in blocks.items()}
    with np.errstate(invalid="ignore"):  # a window without phasors has no noise and stays as it is
        loud = [(block.noise > SCALE_LIMIT * usual[q]).any(axis=1) for q, block in blocks.items()]
    for k in np.flatnonzero(np.any(loud, axis=0)):
        again = work.fit(stretches, int(k), int(k) + 1, usual)
        for quantity, block in blocks.items():
            _put(block, int(k), again.blocks[quantity])


@dataclass(frozen=True)
class _Fitted:
    """Windows of one chunk: phasors by quantity, start [s] and shaft speed [Hz] of every window."""

    blocks: dict[str, PhasorBlock]
    start: FloatArray
    speeds: FloatArray


class _Work:
    """What all windows of a run are fitted with, with each window's own shaft speed where speeds are known."""

    def __init__(
        self, length: int, rate: float, lines: LineSet, speeds: FloatArray | None, nominal_speed: float
    ) -> None:
        self.length, self.rate, self.lines = length, rate, lines
        self.speeds, self.nominal_speed = speeds, nominal_speed
        self.fitter = LineFitter(length, rate, lines.frequencies)

    def fit(self, stretches: RowReader, first: int, stop: int, usual: dict[str, FloatArray] | None = None) -> _Fitted:
        """Read and fit windows first..stop-1; `usual` is the residual scale that windows of the run have."""
        stretch = stretches.read(first * self.length, stop * self.length)
        times = _times(stretch.time, first, stop, self.fitter)
        blocks = {}
        for quantity, values in stretch.rows.items():
            rows = values.reshape(2, stop - first, self.length)
            blocks[quantity] = _fit_windows(self.fitter, rows, times, None if usual is None else usual[quantity])
            if self.speeds is not None:
                self._refit(blocks[quantity], rows, times, self.speeds[first:stop])
        return _Fitted(blocks, times.start, window_speeds(stretch.speed, stop - first, self.nominal_speed))

    def _refit(self, block: PhasorBlock, rows: FloatArray, times: _Times, speeds: FloatArray) -> None:
        """Fit every window once more with its own speed."""
        usual = usual_scale(block.noise)
        for i, speed in enumerate(speeds.tolist()):
            if np.isfinite(speed) and i not in times.uneven:
                _put(block, i, self._at(speed).fit(rows[:, i : i + 1], times.start[i : i + 1], usual))

    @functools.lru_cache(maxsize=64)  # noqa: B019 -- lives as long as the run's extraction
    def _at(self, speed: float) -> LineFitter:
        return LineFitter(self.length, self.rate, self.lines.at_speed(speed).frequencies)


@dataclass(frozen=True)
class _Times:
    """Times of some windows."""

    start: FloatArray  #: (n,), s: of every window
    stamps: FloatArray | None  #: (n, length): of every sample, where they are not on an even grid
    uneven: IntArray  #: (m,): windows that are to be fitted by their stamps


def _times(time: FloatArray | None, first: int, stop: int, fitter: LineFitter) -> _Times:
    counted = (first + np.arange(stop - first)) * fitter.length / fitter.rate
    if time is None:
        return _Times(counted, None, np.empty(0, dtype=int))
    stamps = time.reshape(stop - first, fitter.length)
    grid = stamps[:, :1] + np.arange(fitter.length) / fitter.rate
    even = np.abs(stamps - grid).max(axis=1) <= MAX_JITTER / fitter.rate
    start = np.where(np.isfinite(stamps[:, 0]), stamps[:, 0], counted)
    return _Times(start, stamps, np.flatnonzero(~even))


def _fit_windows(fitter: LineFitter, rows: FloatArray, times: _Times, usual: FloatArray | None) -> PhasorBlock:
    """Fit windows, those off the even grid by their own time stamps."""
    block = fitter.fit(rows, times.start, usual)
    for i in times.uneven:
        if times.stamps is None:
            continue
        good = np.isfinite(times.stamps[i])
        if good.sum() > 2 * fitter.design.shape[1]:
            _put(block, int(i), fit_uneven(rows[:, i, good].T, times.stamps[i][good], fitter.frequencies, 0.0))
    return block


def _put(block: PhasorBlock, i: int, single: PhasorBlock) -> None:
    block.phasors[i], block.mean[i] = single.phasors[0], single.mean[0]
    block.noise[i], block.lost[i] = single.noise[0], single.lost[0]


def _joined(parts: list[PhasorBlock]) -> PhasorBlock:
    return PhasorBlock(
        np.concatenate([p.phasors for p in parts]),
        np.concatenate([p.mean for p in parts]),
        np.concatenate([p.noise for p in parts]),
        np.concatenate([p.lost for p in parts]),
    )
