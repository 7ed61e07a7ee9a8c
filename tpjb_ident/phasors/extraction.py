"""Reading a run chunk by chunk and fitting its windows, every channel at its own times."""

from collections.abc import Mapping

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.phasors.bad_samples import SCALE_LIMIT, usual_scale
from tpjb_ident.phasors.channel_times import DeviceReader, device_readers
from tpjb_ident.phasors.line_fit import LineFitter, WindowFit
from tpjb_ident.phasors.lines import HIGHEST, LineSet
from tpjb_ident.phasors.run_data import QUANTITIES, PhasorSettings, RunPhasors
from tpjb_ident.phasors.shaft import ShaftCourse
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
    channels = [(c, reader.device.name) for reader in readers for c in reader.channels]
    channels.sort(key=lambda described: QUANTITIES.index(described[0].quantity))
    length, count = plan_windows(run.length, run.sample_rate, lines, settings.windows)
    seconds = length / run.sample_rate
    middles = np.asarray((np.arange(count) + 0.5) * length / run.sample_rate, dtype=float)
    speeds = np.full(count, np.nan) if follow is None else follow.at(middles)
    fit = WindowFit.empty(count, len(lines.frequencies), len(channels))
    start = np.empty(0)
    with run.opened():
        for k, reader in enumerate(readers):
            firsts, samples = length * np.arange(count), length
            if k and (reader.rate, reader.length) != (readers[0].rate, readers[0].length):
                firsts, samples = reader.first_samples(start), int(seconds * reader.rate + 1e-6)
            fast = (clocks or {}).get(reader.device.name, 0.0)
            device = _DeviceFit(reader, samples, firsts, lines.at_speed(lines.speed, fast), speeds)
            device.fit_all()
            # phases count by the lines' common frequencies
            ahead = np.multiply.outer(device.start + 0.5 * seconds, fast * lines.frequencies[device.shown])
            z, *figures = device.windows
            chosen = np.array([c in reader.channels for c, _ in channels])
            fit.z[np.ix_(np.arange(count), device.shown, chosen)] = z * np.exp(2j * np.pi * ahead)[:, :, None]
            for table, part in zip(fit[1:], figures):
                table[:, chosen] = part
            start = start if k else device.start
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        start,
        seconds,
        tuple(channel for channel, _ in channels),
        *fit,
        housing_mass,
        device=tuple(name for _, name in channels),
    )


class _DeviceFit:
    """Fit of one device's windows; those with times or a shaft speed of their own are fitted one by one."""

    def __init__(self, reader: DeviceReader, length: int, firsts: IntArray, lines: LineSet, speeds: FloatArray) -> None:
        self.reader, self.length, self.firsts, self.lines, self.speeds = reader, length, firsts, lines, speeds
        self.shown = lines.frequencies < HIGHEST * reader.rate
        if not self.shown[: len(lines.excitation)].all() or length <= 2 * (2 * self.shown.sum() + 2):
            names, run = ", ".join(c.name for c in reader.channels), reader.run
            fault = f"{reader.rate:g} samples per second cannot show the excitation in windows of {length} samples"
            raise refuse(run.file, f"channels {names}", fault, "Sample them faster, or record longer", run.id)
        self.fitter = LineFitter(length, reader.rate, lines.frequencies[self.shown])
        self.windows = WindowFit.empty(len(firsts), int(self.shown.sum()), len(reader.channels))
        self.start = np.full(len(firsts), np.nan)

    def fit_all(self) -> None:
        """Fit all windows that the device recorded, chunk by chunk.

        Windows that are noisier than the run's usual one are fitted anew: a chunk alone may hold nothing to compare.
        """
        step = max(1, CHUNK // self.length)
        recorded = int(np.count_nonzero(self.firsts + self.length <= self.reader.length))
        for first in range(0, recorded, step):
            self._fit(first, min(first + step, recorded))
        usual = usual_scale(self.windows.scale)
        with np.errstate(invalid="ignore"):  # a window without phasors has no scale and stays as it is
            loud = (self.windows.scale > SCALE_LIMIT * usual).any(axis=1)
        for k in np.flatnonzero(loud).tolist() if recorded > step else ():
            self._fit(k, k + 1, usual)

    def _fit(self, first: int, stop: int, usual: FloatArray | None = None) -> None:
        """Read and fit windows first..stop-1; `usual` (n_channels,) is the scale that windows of the run have."""
        begin = self.firsts[first]
        time, rows = self.reader.read(begin, self.firsts[stop - 1] + self.length)
        if time is None:
            time = np.arange(begin, begin + rows.shape[1]) / self.reader.rate
        at = (self.firsts[first:stop] - begin)[:, None] + np.arange(self.length)
        time, rows = time[at], rows[:, at]
        start = np.where(np.isfinite(time[:, 0]), time[:, 0], self.firsts[first:stop] / self.reader.rate)
        fit = self.fitter.fit(rows, start, usual)
        usual = usual_scale(fit.scale) if usual is None else usual
        speeds, uneven = self.speeds[first:stop], self._is_uneven(time)
        for i in np.flatnonzero(uneven | np.isfinite(speeds)).tolist():
            timed = np.isfinite(time[i])
            if timed.sum() > 2 * self.fitter.design.shape[1]:
                lines = self.lines.at_speed(speeds[i]) if np.isfinite(speeds[i]) else self.lines
                times = time[i, timed]
                frequencies, stamps = lines.frequencies[self.shown], times if uneven[i] else None
                fitter = LineFitter(len(times), self.reader.rate, frequencies, time=stamps)
                fit.put(slice(i, i + 1), fitter.fit(rows[:, i : i + 1, timed], times[:1], usual))
        self.windows.put(slice(first, stop), fit)
        self.start[first:stop] = start

    def _is_uneven(self, time: FloatArray) -> BoolArray:
        """Windows (n,) whose time stamps (n, length) stray from an even grid."""
        grid = time[:, :1] + np.arange(self.length) / self.reader.rate
        return ~(np.abs(time - grid).max(axis=1) <= MAX_JITTER / self.reader.rate)
