"""Reading a run chunk by chunk and fitting its windows."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from tpjb_ident.dynamic.arrays import FloatArray
from tpjb_ident.dynamic.lines import LineSet
from tpjb_ident.dynamic.phasors import LineFitter, PhasorBlock, fit_uneven, usual_scale
from tpjb_ident.dynamic.run_data import PhasorSettings, RunPhasors
from tpjb_ident.dynamic.shaft_speed import window_speeds
from tpjb_ident.dynamic.windows import plan_windows

QUANTITIES = ("displacement", "force", "acceleration")
#: Samples of one channel held at a time.
CHUNK = 2**17
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02


def extract(
    run: Any, housing_mass: float, settings: PhasorSettings, lines: LineSet, follow: FloatArray | None = None
) -> RunPhasors:
    """Fit all windows of a run.

    Parameters
    ----------
    run : rigdata.campaign.Run
    housing_mass : float
        [kg]
    settings : PhasorSettings
    lines : LineSet
    follow : (n_windows,) ndarray, optional
        Shaft speed of every window [Hz]: 1X and its harmonics then take each window's own.
    """
    rate = run.sample_rate
    length, count = plan_windows(run.length, rate, lines, settings.windows)
    fitter = LineFitter(length, rate, lines.frequencies)
    followers = _Followers(length, rate, lines, follow)
    present = {c.quantity for c in run.channels.values()}
    blocks: dict[str, list[PhasorBlock]] = {q: [] for q in QUANTITIES if q in present or q != "acceleration"}
    starts, speeds = [], []
    for first, stop in _chunks(length, count):
        start = None
        for quantity, parts in blocks.items():
            record = run.vector(quantity, first * length, stop * length)
            block, start = _fit_chunk(fitter, record, first, stop)
            followers.refit(block, record, first, start)
            parts.append(_undelayed(block, lines, settings.delays.get(quantity, 0.0)))
        starts.append(start)
        speeds.append(window_speeds(run, first, stop, length))
    joined = {quantity: _joined(parts) for quantity, parts in blocks.items()}
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        np.concatenate([s for s in starts if s is not None]),
        length / rate,
        joined["displacement"],
        joined["force"],
        joined.get("acceleration"),
        housing_mass,
        np.concatenate(speeds),
    )


def _chunks(length: int, count: int) -> Iterator[tuple[int, int]]:
    step = max(1, CHUNK // length)
    for first in range(0, count, step):
        yield first, min(first + step, count)


def _fit_chunk(fitter: LineFitter, record: Any, first: int, stop: int) -> tuple[PhasorBlock, FloatArray]:
    """Fit windows first..stop-1 of a record that starts at window `first`."""
    n, length = stop - first, fitter.length
    values = record.values.reshape(n, length, 2)
    time = record.time.reshape(n, length)
    grid = time[:, :1] + np.arange(length) / fitter.rate
    even = np.abs(time - grid).max(axis=1) <= MAX_JITTER / fitter.rate
    start = np.where(np.isfinite(time[:, 0]), time[:, 0], (first + np.arange(n)) * length / fitter.rate)
    block = fitter.fit(values, start)
    for i in np.flatnonzero(~even):
        good = np.isfinite(time[i])
        if good.sum() > 2 * fitter.design.shape[1]:
            single = fit_uneven(values[i][good], time[i][good], fitter.frequencies, 0.0)
            _put(block, int(i), single)
    return block, start


class _Followers:
    """Fitters with each window's own shaft speed; nothing to do where the speed is steady."""

    def __init__(self, length: int, rate: float, lines: LineSet, speeds: FloatArray | None) -> None:
        self.length, self.rate, self.lines, self.speeds = length, rate, lines, speeds

    def refit(self, block: PhasorBlock, record: Any, first: int, start: FloatArray) -> None:
        if self.speeds is None:
            return
        usual = usual_scale(block.noise)
        values = record.values.reshape(-1, self.length, 2)
        for i in range(len(values)):
            speed = float(self.speeds[first + i])
            if np.isfinite(speed) and np.isfinite(record.time[i * self.length]):
                own = self._at(speed).fit(values[i : i + 1], start[i : i + 1], usual)
                _put(block, i, own)

    @functools.lru_cache(maxsize=64)  # noqa: B019 -- lives as long as the run's extraction
    def _at(self, speed: float) -> LineFitter:
        return LineFitter(self.length, self.rate, self.lines.at_speed(speed).frequencies)


def _put(block: PhasorBlock, i: int, single: PhasorBlock) -> None:
    block.phasors[i], block.mean[i] = single.phasors[0], single.mean[0]
    block.noise[i], block.lost[i] = single.noise[0], single.lost[0]


def _undelayed(block: PhasorBlock, lines: LineSet, delay: float) -> PhasorBlock:
    if delay == 0.0:
        return block
    advance = np.exp(2j * np.pi * lines.frequencies * delay)
    return PhasorBlock(block.phasors * advance[None, :, None], block.mean, block.noise, block.lost)


def _joined(parts: list[PhasorBlock]) -> PhasorBlock:
    return PhasorBlock(
        np.concatenate([p.phasors for p in parts]),
        np.concatenate([p.mean for p in parts]),
        np.concatenate([p.noise for p in parts]),
        np.concatenate([p.lost for p in parts]),
    )
