"""Samples of one broadband run, whole, channel by channel: its transform needs all of them on an even grid.

A device of another rate is read at the times of the first one; single readings that their neighbours contradict are
bridged, as missing ones are.

Lines that turn with the shaft or come from the mains are fitted over the whole record, taken off, their bins left out.
The amplitude of each may change slowly over the record, as a polynomial of time; so a frequency that is a little off,
or creeps, is taken along. A periodic excitation is fitted together with them, period by period, and stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.problem import refuse
from rigdata.run import Run
from rigdata.vector import Directed, directions
from tpjb_ident.check.signals import is_spare
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.phasors.line_fit import BAD_LIMIT, even_design, robust_deviation
from tpjb_ident.phasors.lines import HIGHEST, MAINS_DRIFT, SPEED_DRIFT, Line, strong_lines
from tpjb_ident.phasors.run_data import DeviceReader, device_readers
from tpjb_ident.phasors.whole_record import vertex

#: Share of a channel's samples that may be missing in stretches, bridged by straight lines,
_MAX_LOST = 0.01
#: and from which share on it is said.
_TOLD_LOST = 1e-4
#: Time stamps may stray this share of a sample from the even grid.
_MAX_JITTER = 0.05
#: Half the length of the kernel [samples], and the shape of its Kaiser window: 1e-5 of a tone up to 0.4 of the rate.
_TAPS, _KAISER, _REACH = 24, 9.0, 0.4
#: Relative difference of rates up to which devices are alike but for their clocks.
_ALIKE = 1e-3
#: A reading by the cubic through the two on either side of it.
_CUBIC = np.array([-1.0, 4.0, 0.0, 4.0, -1.0]) / 6
#: What is left of one bad reading of size one, and of good ones about it, after that.
_BAD_READING = np.array([0.0, 0.0, 1.0, 0.0, 0.0]) - _CUBIC
#: Bad readings that are looked for, as places from the first one: alone, or two so near that one hides the other;
_BAD = ((0,), (0, 1), (0, 2), (0, 3), (0, 4))
#: and how often: some stand behind others.
_PASSES = 3


@dataclass(frozen=True)
class Samples(Directed):
    """One run in memory, SI."""

    rate: float
    channels: tuple[Channel, ...]  #: probes, cells, accelerometers, in this order
    rows: FloatArray  #: (m, n)
    command: FloatArray | None  #: (2, n): along X and Y, in units of its own
    conditions: Conditions = ()
    is_finer: bool = False  #: whether a slower device was read at these times, through the kernel

    @property
    def length(self) -> int:
        """Samples per channel."""
        return int(self.rows.shape[1])

    def signals(self) -> FloatArray:
        """Rows (k, n) about their means, each quantity of unit power: an idle channel weighs nothing beside others.

        The command comes alone where there is one: what was meant to move the shaft tells the period best.
        """
        groups = [self.rows[self.pick(q)] for q in ("displacement", "force")]
        if self.command is not None:
            groups = [self.command]
        scaled = []
        for rows in groups:
            centred = rows - rows.mean(axis=1, keepdims=True)
            if centred.any():
                scaled.append(centred / centred.std())
        return np.concatenate(scaled)

    def mapped(self, change: Callable[[FloatArray], FloatArray], rate: float | None = None) -> Samples:
        """The record with all rows (k, n) changed alike, command too; at another rate where one is given."""
        command = None if self.command is None else change(self.command)
        return replace(self, rate=rate or self.rate, rows=change(self.rows), command=command)


def read_samples(run: Run, seconds: float, fast: Mapping[str, float], highest: float) -> Samples:
    """Read the first `seconds` of a run.

    `fast`: channels by whose clock time runs faster than the first's, relative; `highest`: frequency [Hz] that every
    device must show.
    """
    n = min(run.length, round(seconds * run.sample_rate))
    readers = device_readers(run, command=True)
    described: list[Channel] = []
    for reader in readers:
        described += reader.channels
    single = len(run.of("command")) == 1
    recorded = []
    begins, lost, command, is_finer = [], 0.0, np.zeros((2, n)), False
    inside, grid = np.ones(n, dtype=bool), np.arange(float(n))
    for reader in readers:
        if highest >= HIGHEST * reader.rate:
            text = f"the band reaches {highest:g} Hz, more than 0.45 of the sample rate of {reader.rate:g} Hz"
            raise refuse(run.file, "excitation_band", text, "Sample faster, or excite lower frequencies", run.id)
        is_alike = reader.length == readers[0].length and abs(reader.rate / readers[0].rate - 1) <= _ALIKE
        time, rows = reader.read(0, n if is_alike else reader.length)
        begins.append(_begin(run, time, reader.rate))
        at = grid  # the places [samples] of the first device's times
        if not is_alike:
            _refuse_unlike(run, reader, highest)
            is_finer |= reader.rate < run.sample_rate
            at = (grid / run.sample_rate + begins[0] - begins[-1]) * reader.rate
            inside &= (at >= _TAPS) & (at <= reader.length - 1 - _TAPS)  # as far as the kernel reaches
        for channel, values in zip(reader.channels, rows):
            if channel.quantity == "command":
                is_stated = single and run.excitation_direction is not None
                angle = run.excitation_direction if is_stated else channel.axis
                readings = _at(_bridged(run, channel, values), at)
                command += np.outer(directions(angle or 0.0), readings - readings.mean())
                continue
            values = values if run.excitation_kind == "impact" else without_glitches(values)  # a blow is sudden itself
            if _lost(values) <= _MAX_LOST or not is_spare(channel, described):
                faster = 1 + fast.get(channel.name, 0.0)
                recorded.append((channel, _at(_bridged(run, channel, values), at * faster)))
                lost = max(lost, (~np.isfinite(values)).mean())
    recorded.sort(key=lambda record: VECTOR_QUANTITIES.index(record[0].quantity))
    channels, readings_of = zip(*recorded)
    bridged = holding((lost > _TOLD_LOST, "samples-lost", f"run {run.id}: {lost:.1%} of a channel's samples"))
    driven = command[:, inside] if command.any() else None
    return Samples(run.sample_rate, channels, np.array(readings_of)[:, inside], driven, bridged, is_finer)


def _begin(run: Run, time: FloatArray | None, rate: float) -> float:
    """Time of a device's first sample [s], by all of its stamps; refused where these have gaps."""
    if time is None or np.isfinite(time).sum() < 3:
        return 0.0
    place = np.flatnonzero(np.isfinite(time))
    off = time[place] * rate - place
    drift = np.polyval(np.polyfit(place, off, 1), place)
    if np.abs(off - drift).max() > _MAX_JITTER:
        text = "the samples are not evenly spaced; a transform over a band needs an even grid"
        raise refuse(run.file, "time", text, "Resample the record, or export it without gaps", run.id)
    return float(np.median(off)) / rate


def _refuse_unlike(run: Run, reader: DeviceReader, highest: float) -> None:
    """Refuse a device of its own rate that is too slow for the kernel; blows hold what folds back into the band."""
    need, cure = "", "Sample faster, or excite lower frequencies"
    if run.excitation_kind == "impact":
        need, cure = f"the first one at {run.sample_rate:.6g} Hz; blows need one rate", "Record all at one rate"
    elif highest >= _REACH * reader.rate:
        need = f"a band up to {highest:g} Hz needs {highest / _REACH:.4g} Hz"
    if need:
        place, fault = f"device of channel {reader.channels[0].name}", f"is sampled at {reader.rate:.6g} Hz, {need}"
        raise refuse(run.file, place, fault, cure, run.id)


def without_glitches(values: FloatArray) -> FloatArray:
    """Readings (n,) without bad ones that the two on either side contradict, where all agree without them."""
    values = np.array(values, dtype=float)
    limit = 0.0
    for places in _BAD * _PASSES:
        last = places[-1]
        off = values - np.convolve(values, _CUBIC, "same")
        limit = limit or BAD_LIMIT * robust_deviation(off[np.isfinite(off)])
        at = 4 + np.flatnonzero(np.abs(off[4 : -4 - last]) > limit)
        if not len(at):
            break
        base = np.append(_BAD_READING, np.zeros(last))
        pattern = np.transpose([np.roll(base, place) for place in places])  # what bad readings do to `off`
        near = off[at[:, None] + np.arange(-2, last + 3)]
        size = near @ np.linalg.pinv(pattern).T
        is_bad = np.abs(near - size @ pattern.T).max(axis=1) < limit
        values[at[is_bad, None] + places] -= size[is_bad]
    return values


def _lost(values: FloatArray) -> float:
    """Share of missing readings that stand beside others."""
    missing = ~np.isfinite(values)
    return float((missing & (np.convolve(missing, [1, 1, 1], "same") > 1)).mean())


def _bridged(run: Run, channel: Channel, values: FloatArray) -> FloatArray:
    """A channel (n,) with what is missing bridged: by straight lines, single readings by the cubic about them."""
    missing = ~np.isfinite(values)
    lost = _lost(values)
    if lost > _MAX_LOST or missing.all():
        text = f"{missing.mean():.1%} of its samples are missing"
        raise refuse(run.file, f"channel {channel.name}", text, "Repeat the run", run.id)
    if not missing.any():
        return values
    at = np.arange(len(values))
    bridged = np.interp(at, at[~missing], values[~missing])
    return np.where(missing, np.convolve(bridged, _CUBIC, "same"), values) if not lost else bridged


def _at(values: FloatArray, places: FloatArray) -> FloatArray:
    """A channel (n,) at places [samples] of its own grid."""
    if np.array_equal(places, np.arange(len(values))):
        return values
    mean = values.mean()
    return interpolated((values - mean)[None], places)[0] + mean


def interpolated(rows: FloatArray, at: np.ndarray) -> FloatArray:
    """Rows (k, n) at the places `at` [samples]; `at` (m,)."""
    base = np.floor(at).astype(int)
    share = at - base
    out = np.zeros((len(rows), len(at)))
    last = rows.shape[1] - 1
    norm = np.i0(_KAISER)
    for tap in range(-_TAPS + 1, _TAPS + 1):
        distance = share - tap
        window = np.i0(_KAISER * np.sqrt(np.maximum(1 - (distance / _TAPS) ** 2, 0.0))) / norm
        out += rows[:, np.clip(base + tap, 0, last)] * (np.sinc(distance) * window)
    return out


#: Highest harmonics of shaft and mains that are looked for.
_SHAFT_HARMONICS, _MAINS_HARMONICS = 8, 5
#: Highest power of time in a line's amplitude.
_CREEP = 3
#: Power of a line, over that of noise of the record's size, from which its frequency is believed.
_SHOWN = 20.0
#: Part of a line's power that the excitation's period must leave: one that it holds stays where it is.
_NOTHING = 1e-6
#: Bins next to a line that are left out, in whole-record bins.
LEFT_OUT = 4.0
#: The same of a period, in its own bins: lines between its bins are told from it by all its repeats.
LEFT_OUT_OF_PERIOD = 0.6


def find_disturbances(samples: Samples, speed: float, mains: float, top: float) -> tuple[Line, ...]:
    """Shaft harmonics and mains up to above the band, at the frequencies at which the record shows them."""
    reach = min(HIGHEST * samples.rate, 1.5 * top)
    shaft = _shown(samples, speed, SPEED_DRIFT) if samples.length / samples.rate * speed > 2 else 0.0
    supply = _shown(samples, mains, MAINS_DRIFT) if mains > 0 else 0.0
    resolved: list[Line] = []
    for line in strong_lines((), shaft, supply, _SHAFT_HARMONICS, _MAINS_HARMONICS):
        is_resolved = all(abs(line.frequency - near.frequency) > samples.rate / samples.length for near in resolved)
        if line.frequency < reach and is_resolved:
            resolved.append(line)
    return tuple(resolved)


def _shown(samples: Samples, nominal: float, wander: float) -> float:
    """Frequency of the highest peak near `nominal` [Hz], where one stands clear of what is around it."""
    from scipy.signal import zoom_fft  # takes longer to import than a run to read

    n, window = samples.length, np.hanning(samples.length)
    step = 0.25 * samples.rate / n
    reach = int(wander / step) + 1
    ends = [nominal - reach * step, nominal + reach * step]
    power = np.zeros(2 * reach + 1)
    for quantity in ("displacement", "force"):
        rows = samples.rows[samples.pick(quantity)]
        rows = rows - rows.mean(axis=1, keepdims=True)
        spectra = zoom_fft(rows * window, ends, len(power), fs=samples.rate, endpoint=True)
        size = max(np.sum(rows**2) * np.sum(window**2), 1e-300)
        power += np.sum(np.abs(spectra) ** 2, axis=0) / size
    k = np.argmax(power)
    if not 0 < k < 2 * reach or power[k] < _SHOWN:
        return nominal
    return float(ends[0] + step * (k + vertex(power[k - 1 : k + 2])))


def without_disturbances(samples: Samples, lines: tuple[Line, ...], period: int | None = None) -> Samples:
    """The record without the lines and without its mean."""
    stack = samples.rows - samples.rows.mean(axis=1, keepdims=True)
    if not lines:
        return replace(samples, rows=stack)
    n = samples.length
    waves = even_design(n, samples.rate, np.array([line.frequency for line in lines]))[:, : 2 * len(lines)]
    creep = np.polynomial.legendre.legvander(np.linspace(-1, 1, n), _CREEP)
    columns = (creep[:, :, None] * waves[:, None, :]).reshape(n, -1).T
    basis, target = (without_periodic(rows, period) for rows in (columns, stack))
    gram = basis @ basis.T + _NOTHING * n * np.eye(len(basis))
    return replace(samples, rows=stack - np.linalg.solve(gram, basis @ target.T).T @ columns)


def without_periodic(rows: FloatArray, period: int | None) -> FloatArray:
    """What changes (k, n) from period to period."""
    if period is None:
        return rows
    folded = rows.reshape(len(rows), -1, period)
    return (folded - folded.mean(axis=1, keepdims=True)).reshape(len(rows), -1)


def bins_taken(frequencies: np.ndarray, lines: tuple[Line, ...], seconds: float, width: float = LEFT_OUT) -> BoolArray:
    """Bins that a line may have spoiled, (n,)."""
    disturbed = np.zeros(len(frequencies), dtype=bool)
    for line in lines:
        disturbed |= np.abs(frequencies - line.frequency) <= max(width / seconds, line.wander)
    return disturbed
