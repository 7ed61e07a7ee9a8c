"""Reading a run chunk by chunk and fitting its windows, every channel at its own times."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.run import Run
from tpjb_ident.phasors.bad_samples import SCALE_LIMIT
from tpjb_ident.phasors.channel_times import ChannelReader, DeviceChannels
from tpjb_ident.phasors.line_fit import LineFitter, WindowFit, fit_uneven, joined_windows, usual_scale
from tpjb_ident.phasors.lines import LineSet
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.phasors.shaft import ShaftCourse, window_speeds
from tpjb_ident.phasors.windows import plan_windows

#: Samples of one channel held at a time: few enough for two channels to stay in a core's cache.
CHUNK = 2**15
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02


def extract(
    run: Run, housing_mass: float, settings: PhasorSettings, lines: LineSet, follow: ShaftCourse | None = None
) -> RunPhasors:
    """Fit all windows of a run."""
    reader = ChannelReader(run)
    length, count = plan_windows(run.length, run.sample_rate, lines, settings.windows)
    middles = (np.arange(count) + 0.5) * length / run.sample_rate
    speeds = None if follow is None else follow.at(np.asarray(middles, dtype=float))
    (device,) = reader.devices
    with run.opened():
        work = _DeviceFit(reader, device, length, lines, speeds)
        fit, start, tach = work.all_windows(count, run.point.shaft_speed_hz)
    recorded = RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        start,
        length / run.sample_rate,
        device.channels,
        fit.z,
        fit.mean,
        fit.scale,
        fit.lost,
        housing_mass,
        tach,
        device=(device.name,) * len(device.channels),
    )
    return recorded.advanced(settings.delays)


def _chunks(length: int, count: int) -> Iterator[tuple[int, int]]:
    step = max(1, CHUNK // length)
    for first in range(0, count, step):
        yield first, min(first + step, count)


class _DeviceFit:
    """Fit of one device's windows, with each window's own shaft speed where speeds are known."""

    def __init__(
        self, reader: ChannelReader, device: DeviceChannels, length: int, lines: LineSet, speeds: FloatArray | None
    ) -> None:
        self.reader, self.device, self.length, self.lines, self.speeds = reader, device, length, lines, speeds
        self.fitter = LineFitter(length, device.rate, lines.frequencies)

    def all_windows(self, count: int, nominal_speed: float) -> tuple[WindowFit, FloatArray, FloatArray]:
        """Fit of all windows, their start [s] and speed by tachometer [Hz]."""
        parts, starts, speeds = [], [], []
        for first, stop in _chunks(self.length, count):
            fit, start, speed = self.fit(first, stop)
            parts.append(fit)
            starts.append(start)
            speeds.append(window_speeds(speed, stop - first, nominal_speed))
        fit = joined_windows(parts)
        if len(parts) > 1:
            self._look_again(fit)
        return fit, np.concatenate(starts), np.concatenate(speeds)

    def fit(
        self, first: int, stop: int, usual: FloatArray | None = None
    ) -> tuple[WindowFit, FloatArray, FloatArray | None]:
        """Read and fit windows first..stop-1; `usual` (n_channels,) is the scale that windows of the run have."""
        samples = self.reader.read(self.device, first * self.length, stop * self.length)
        times = _times(samples.time, first, stop, self.fitter)
        rows = samples.rows.reshape(len(samples.rows), stop - first, self.length)
        fits = []
        for group in self.device.groups:
            fit = _fit_windows(self.fitter, rows[group], times, None if usual is None else usual[group])
            if self.speeds is not None:
                self._refit(fit, rows[group], times, self.speeds[first:stop])
            fits.append(fit)
        return _joined_channels(fits), times.start, samples.speed

    def _refit(self, fit: WindowFit, rows: FloatArray, times: _Times, speeds: FloatArray) -> None:
        """Fit every window once more with its own speed."""
        usual = usual_scale(fit.scale)
        for i, speed in enumerate(speeds.tolist()):
            if np.isfinite(speed) and i not in times.uneven:
                fit.put(i, slice(None), self._at(speed).fit(rows[:, i : i + 1], times.start[i : i + 1], usual))

    @functools.lru_cache(maxsize=64)  # noqa: B019 -- lives as long as the run's extraction
    def _at(self, speed: float) -> LineFitter:
        return LineFitter(self.length, self.device.rate, self.lines.at_speed(speed).frequencies)

    def _look_again(self, fit: WindowFit) -> None:
        """Fit windows anew that are noisier than the run's usual one: a chunk alone may hold nothing to compare."""
        usual = usual_scale(fit.scale)
        with np.errstate(invalid="ignore"):  # a window without phasors has no scale and stays as it is
            loud = (fit.scale > SCALE_LIMIT * usual).any(axis=1)
        for k in np.flatnonzero(loud).tolist():
            fit.put(k, slice(None), self.fit(k, k + 1, usual)[0])


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


def _fit_windows(fitter: LineFitter, rows: FloatArray, times: _Times, usual: FloatArray | None) -> WindowFit:
    """Fit windows, those off the even grid by their own time stamps."""
    fit = fitter.fit(rows, times.start, usual)
    for i in times.uneven.tolist():
        if times.stamps is None:
            continue
        good = np.isfinite(times.stamps[i])
        if good.sum() > 2 * fitter.design.shape[1]:
            fit.put(i, slice(None), fit_uneven(rows[:, i, good], times.stamps[i][good], fitter.frequencies, 0.0))
    return fit


def _joined_channels(fits: list[WindowFit]) -> WindowFit:
    z = np.concatenate([fit.z for fit in fits], axis=2)
    return WindowFit(z, *(np.concatenate([getattr(f, n) for f in fits], axis=1) for n in ("mean", "scale", "lost")))
