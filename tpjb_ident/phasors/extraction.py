"""Reading a run chunk by chunk and fitting its windows, every channel at its own times."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.phasors.bad_samples import SCALE_LIMIT
from tpjb_ident.phasors.channel_times import DeviceReader, device_readers
from tpjb_ident.phasors.line_fit import (
    LineFitter,
    WindowFit,
    fit_uneven,
    joined,
    no_windows,
    usual_scale,
)
from tpjb_ident.phasors.lines import LineSet
from tpjb_ident.phasors.run_data import QUANTITIES, PhasorSettings, RunPhasors
from tpjb_ident.phasors.shaft import ShaftCourse, window_speeds
from tpjb_ident.phasors.windows import plan_windows

#: Samples of one channel held at a time: few enough for two channels to stay in a core's cache.
CHUNK = 2**15
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02


def extract(
    run: Run,
    housing_mass: float,
    settings: PhasorSettings,
    lines: LineSet,
    follow: ShaftCourse | None = None,
    clocks: Mapping[str, float] | None = None,
) -> RunPhasors:
    """Fit all windows of a run; `clocks`: by how much lines turn faster by a device's clock, relative."""
    readers = device_readers(run)
    length, count = plan_windows(run.length, run.sample_rate, lines, settings.windows)
    seconds = length / run.sample_rate
    speeds = (
        None
        if follow is None
        else follow.at(np.asarray((np.arange(count) + 0.5) * length / run.sample_rate, dtype=float))
    )
    firsts, start, tach, fits = length * np.arange(count), np.empty(0), np.full(count, np.nan), []
    with run.opened():
        for k, reader in enumerate(readers):
            if k and (reader.rate, reader.length) != (readers[0].rate, readers[0].length):
                firsts, length = reader.first_samples(start), int(seconds * reader.rate + 1e-6)
            fast = (clocks or {}).get(reader.device.name, 0.0)
            work = _DeviceFit(reader, length, firsts, lines.faster(fast), speeds)
            fit, times, turning = work.all_windows(run.point.shaft_speed_hz)
            if fast:  # phases count by the lines' common frequencies
                ahead = np.multiply.outer(times + 0.5 * seconds, fast * lines.frequencies)
                fit = replace(fit, z=fit.z * np.exp(2j * np.pi * ahead)[:, :, None])
            start = times if not k else start
            tach = np.where(np.isfinite(tach), tach, turning)
            fits.append(fit)
    fit = joined(fits, channels=True)
    order = np.argsort([QUANTITIES.index(c.quantity) for reader in readers for c in reader.channels], kind="stable")
    described = [(c, reader.device.name) for reader in readers for c in reader.channels]
    recorded = RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        start,
        seconds,
        tuple(described[i][0] for i in order),
        fit.z[:, :, order],
        fit.mean[:, order],
        fit.scale[:, order],
        fit.lost[:, order],
        housing_mass,
        tach,
        device=tuple(described[i][1] for i in order),
    )
    return recorded.advanced(settings.delays)


class _DeviceFit:
    """Fit of one device's windows, with each window's own shaft speed where speeds are known."""

    def __init__(
        self, reader: DeviceReader, length: int, firsts: IntArray, lines: LineSet, speeds: FloatArray | None
    ) -> None:
        self.reader, self.length, self.firsts, self.lines, self.speeds = reader, length, firsts, lines, speeds
        self.shown = reader.shows(lines.frequencies)
        if not self.shown[: len(lines.excitation)].all() or length <= 2 * (2 * self.shown.sum() + 2):
            names, run = ", ".join(c.name for c in reader.channels), reader.run
            fault = f"{reader.rate:g} samples per second cannot show the excitation in windows of {length} samples"
            raise refuse(run.file, f"channels {names}", fault, "Sample them faster, or record longer", run.id)
        self.fitter = LineFitter(length, reader.rate, lines.frequencies[self.shown])

    def all_windows(self, nominal_speed: float) -> tuple[WindowFit, FloatArray, FloatArray]:
        """Fit of all windows, their start [s] and speed by tachometer [Hz]."""
        parts, starts, speeds = [], [], []
        step = max(1, CHUNK // self.length)
        recorded = int(np.count_nonzero(self.firsts + self.length <= self.reader.length))
        for first in range(0, recorded, step):
            stop = min(first + step, recorded)
            fit, start, speed = self.fit(first, stop)
            parts.append(fit)
            starts.append(start)
            speeds.append(window_speeds(speed, stop - first, nominal_speed))
        missing = len(self.firsts) - recorded  # windows after the end of this device's record
        fit = joined([*parts, no_windows(missing, int(self.shown.sum()), len(self.reader.channels))])
        if len(parts) > 1:
            self._look_again(fit)
        none = np.full(missing, np.nan)
        return self._with_all_lines(fit), np.concatenate([*starts, none]), np.concatenate([*speeds, none])

    def _with_all_lines(self, fit: WindowFit) -> WindowFit:
        """The fit with lines that the device's rate does not show as NaN."""
        if self.shown.all():
            return fit
        z = np.full((len(fit.z), len(self.shown), fit.z.shape[2]), np.nan + 0j)
        z[:, self.shown] = fit.z
        return replace(fit, z=z)

    def fit(
        self, first: int, stop: int, usual: FloatArray | None = None
    ) -> tuple[WindowFit, FloatArray, FloatArray | None]:
        """Read and fit windows first..stop-1; `usual` (n_channels,) is the scale that windows of the run have."""
        begin = self.firsts[first]
        samples = self.reader.read(begin, self.firsts[stop - 1] + self.length)
        at = (self.firsts[first:stop] - begin)[:, None] + np.arange(self.length)
        whole = at.size == samples.rows.shape[1]
        rows = samples.rows.reshape(len(samples.rows), *at.shape) if whole else samples.rows[:, at]
        stamps = None if samples.time is None else samples.time[at]
        speed = None if samples.speed is None else samples.speed[at].ravel()
        times = _times(stamps, self.firsts[first:stop], self.fitter)
        fits = []
        for group in self.reader.groups:
            fit = _fit_windows(self.fitter, rows[group], times, None if usual is None else usual[group])
            if self.speeds is not None:
                self._refit(fit, rows[group], times, self.speeds[first:stop])
            fits.append(fit)
        return joined(fits, channels=True), times.start, speed

    def _refit(self, fit: WindowFit, rows: FloatArray, times: _Times, speeds: FloatArray) -> None:
        """Fit every window once more with its own speed."""
        usual = usual_scale(fit.scale)
        for i, speed in enumerate(speeds.tolist()):
            if np.isfinite(speed) and i not in times.uneven:
                fit.put(i, slice(None), self._at(speed).fit(rows[:, i : i + 1], times.start[i : i + 1], usual))

    @functools.lru_cache(maxsize=64)  # noqa: B019 -- lives as long as the run's extraction
    def _at(self, speed: float) -> LineFitter:
        return LineFitter(self.length, self.reader.rate, self.lines.at_speed(speed).frequencies[self.shown])

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


def _times(stamps: FloatArray | None, firsts: IntArray, fitter: LineFitter) -> _Times:
    """Times of windows from the stamps (n, length) of their samples, or from the places (n,) of their first ones."""
    counted = firsts / fitter.rate
    if stamps is None:
        return _Times(counted, None, np.empty(0, dtype=int))
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
