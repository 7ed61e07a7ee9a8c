"""What the channels' electronics did to the phasors, taken out: filters, delays, slower sampling.

A channel sampled at f_s and written at a higher rate (filled up by a logger program) holds an image of every line f at
f_s - f and f_s + f, of size (f / (f_s -+ f))^n: n = 1 where values are held, 2 along straight lines, 4 along cubic
splines. The line itself comes out smaller (and late, where values are held) by a factor that the rates alone determine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.channel_times import device_readers
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.whole_record import WholeRecord, hann_amplitude, noise_floor

#: Samples that are looked at.
_RHYTHM_LOOK = 2**13
#: Share of the samples that must be straight (or flat), at least.
_STRAIGHT = 0.15
#: A bend is none below this share of the usual one.
_NO_BEND = 0.01
#: How much of the bends must come in one rhythm, of what a strict one has,
_RHYTHM = 0.8
#: and how far their number may be off.
_COUNT_OFF = 0.25
#: An image stands this many times above the noise of its channel,
_CLEAR = 8.0
#: and has at least this share of its line.
_SHARE = 1e-4
#: Both images tell one order of filling, to this,
_AGREE = 0.15
#: which is one of these: held, straight lines, cubic splines.
_ORDERS = {1: "held", 2: "interpolated", 4: "interpolated (splines)"}
#: An image so near to a line of the record [1 / record length] may be what a drift leaves of that.
_NEAR = 8.0
#: An image of less than this share of what it would be is none.
_MISSING = 0.3
#: The largest peaks are tried as images, so many.
_TRIED = 24
#: Rates that divide the export's rate to this share do so exactly.
_EVEN = 3e-4
#: Images to either side of a line that a spline's own factor is summed over.
_IMAGES = 20


@dataclass(frozen=True)
class SlowerChannel:
    """How a channel was filled up."""

    rate: float
    export_rate: float
    order: int

    def at(self, frequency: FloatArray) -> ComplexArray:
        """What the filling does to a sine of `frequency` (n,) [Hz]: sinc^2 for lines, sinc and half a step for steps.

        Where the rates divide evenly the sums over the samples of a period take the place of the integrals.
        """
        f = np.asarray(frequency, dtype=float)
        if self.order == 4:
            k = np.arange(1, _IMAGES)[:, None] * self.rate
            return np.asarray(1 / (1 + ((f / (k - f)) ** 4 + (f / (k + f)) ** 4).sum(axis=0)), dtype=complex)
        ratio = self.export_rate / self.rate
        even = abs(ratio - round(ratio)) < _EVEN * ratio
        small = np.sin(np.pi * f / self.export_rate) * round(ratio) if even else np.pi * f / self.rate
        gain = np.where(f > 0, np.sin(np.pi * f / self.rate) / np.where(f > 0, small, 1.0), 1.0)
        if self.order == 2:
            return np.asarray(gain**2, dtype=complex)
        late = 0.5 / self.rate - (0.5 / self.export_rate if even else 0.0)
        return np.asarray(gain * np.exp(-2j * np.pi * f * late))

    def images(self, frequencies: FloatArray) -> FloatArray:
        """Frequencies at which images of some lines stand in the export."""
        k = np.arange(1, 4)[:, None] * self.rate
        places = np.concatenate([k - frequencies, k + frequencies]).ravel()
        return np.abs((places + 0.5 * self.export_rate) % self.export_rate - 0.5 * self.export_rate)


def filled_channels(records: tuple[WholeRecord, ...], result: RunPhasors) -> dict[str, SlowerChannel]:
    """Channels that were sampled slower than they were written, by name."""
    slower: dict[str, SlowerChannel] = {}
    for record in records:
        amplitude = hann_amplitude(record.spectrum)
        for column, place in enumerate(record.places):
            sizes = np.abs(np.nan_to_num(record.z[:, column]))
            floor = noise_floor(amplitude[:, column])
            for strong in np.argsort(-sizes)[:2]:
                found = _images_of(int(strong), sizes, amplitude[:, column], floor, record)
                if found is not None:
                    slower.setdefault(result.channels[place].name, found)
    return slower


def _images_of(
    strong: int, sizes: FloatArray, amplitude: FloatArray, floor: FloatArray, record: WholeRecord
) -> SlowerChannel | None:
    """Rate and order of filling by a pair of images of one line of the record; `sizes` (n_whole_lines,)."""
    line, size = record.lines.whole[strong], float(sizes[strong])
    frequency, first, driven = line.frequency, line.frequency / (line.order or 1), line.name == "excitation"
    least = np.maximum(_CLEAR * floor, _SHARE * size)
    if not np.isfinite(least).all() or size <= 0:
        return None
    peaks = find_peaks(amplitude)[0]
    peaks = peaks[(amplitude > least)[peaks] & (peaks > 1.2 * frequency * record.duration)]
    peaks = peaks[_is_free(peaks, record)]
    for low in peaks[np.argsort(-amplitude[peaks])][:_TRIED]:
        rate = low / record.duration + frequency
        mirror = record.rate - (rate + frequency) if rate + frequency > record.rate / 2 else rate + frequency
        around = np.round(mirror * record.duration).astype(int) + np.arange(-1, 2)
        if around.min() < 1 or around.max() >= len(amplitude) - 1 or not _is_free(around, record).all():
            continue
        # shaft and mains have orders of their own, beside one another
        if not driven and abs((rate + 0.5 * first) % first - 0.5 * first) * record.duration < _NEAR:
            continue
        high = int(around[np.argmax(amplitude[around])])
        orders = [
            np.log(_peak_size(amplitude, int(k)) / size) / np.log(frequency / abs(rate + sign * frequency))
            for k, sign in ((low, -1), (high, 1))
        ]
        order = min(_ORDERS, key=lambda n: abs(n - orders[0]))
        if amplitude[high] <= least[high] or max(abs(n - order) for n in orders) >= _AGREE:
            continue
        exact = (low + _peak_offset(amplitude, int(low))) / record.duration + frequency
        ratio = record.rate / exact
        exact = record.rate / round(ratio) if abs(ratio - round(ratio)) < _EVEN * ratio else exact
        slower = SlowerChannel(exact, record.rate, order)
        if not _is_missing(slower, sizes, amplitude, least, record):
            return slower
    return None


def _is_missing(
    slower: SlowerChannel, sizes: FloatArray, amplitude: FloatArray, least: FloatArray, record: WholeRecord
) -> bool:
    """Whether some line has no image where this filling would have left a clear one."""
    frequencies = record.lines.whole_frequencies
    for image in (slower.rate - frequencies, slower.rate + frequencies):
        expected = _MISSING * sizes * np.abs(frequencies / image) ** slower.order
        folded = np.abs((image + 0.5 * record.rate) % record.rate - 0.5 * record.rate)
        at = np.round(folded * record.duration).astype(int)
        seen = (at > _NEAR) & (at < len(amplitude) - 1) & _is_free(at, record)
        place = at[seen]
        found = np.maximum(amplitude[place], np.maximum(amplitude[place - 1], amplitude[place + 1]))
        if (expected[seen] > np.maximum(least[place], found)).any():
            return True
    return False


def _is_free(bins: IntArray, record: WholeRecord) -> BoolArray:
    """Whether bins (n,) are away from all lines of the record, (n,)."""
    lines = record.lines.whole_frequencies * record.duration
    return np.asarray(np.abs(bins[:, None] - lines).min(axis=1) > _NEAR)


def _peak_offset(amplitude: FloatArray, k: int) -> float:
    """Distance of a line from the bin with its largest amplitude, by Hann's window [bins]."""
    side = 1 if amplitude[k + 1] > amplitude[k - 1] else -1
    ratio = amplitude[k + side] / amplitude[k]
    return float(side * (2 * ratio - 1) / (1 + ratio))


def _peak_size(amplitude: FloatArray, k: int) -> float:
    """Amplitude of the line at a peak of a spectrum with Hann's window."""
    offset = _peak_offset(amplitude, k)
    return float(amplitude[k] / (np.sinc(offset) / (1 - offset**2)) if abs(offset) < 0.99 else amplitude[k])


def slower_condition(slower: Mapping[str, SlowerChannel]) -> tuple[Condition, ...]:
    """What to say of channels that were filled up."""
    if not slower:
        return ()
    rates = ", ".join(f"{name} {_ORDERS[s.order]} from {s.rate:.4g} Hz" for name, s in slower.items())
    return (Condition("slower-channels", f"{rates}; what that does to a sine was taken out"),)


def compensated(
    result: RunPhasors, run: Run, slower: Mapping[str, SlowerChannel], delays: Mapping[str, float]
) -> RunPhasors:
    """The run's phasors as channels without filters, filling and delays would have given them.

    `delays` [s]: of whole quantities.
    """
    frequencies = result.lines.whole_frequencies
    gains = np.ones((len(frequencies), len(result.channels)), dtype=complex)
    for k, channel in enumerate(result.channels):
        gains[:, k] = np.exp(-2j * np.pi * frequencies * delays.get(channel.quantity, 0.0))
        if channel.response:
            gain = channel.response.at(frequencies)
            gains[:, k] *= _reached(gain, frequencies, len(result.lines.excitation), run, channel.name)
        if channel.name in slower:
            gains[:, k] *= slower[channel.name].at(frequencies)
    return result if np.all(gains == 1.0) else result.divided(gains)


def _reached(gain: ComplexArray, frequencies: FloatArray, driven: int, run: Run, name: str) -> ComplexArray:
    """The gain, 1 at disturbing lines that a table does not reach."""
    valid = np.isfinite(gain) & (np.abs(gain) > 1e-6)
    if not valid[:driven].all():
        text = f"its response at the excitation of {frequencies[~valid][0]:g} Hz is not known, or nothing comes through"
        cure = "Extend filter_table, or check filter"
        raise refuse(run.file, f"channel {name}", text, cure, run.id)
    return np.where(valid, gain, 1.0)


def slower_channel(readings: FloatArray, export_rate: float) -> SlowerChannel | None:
    """Tell whether a channel was filled up, from the beginning of its readings; `readings` (n,).

    Logger programs write groups of different rates into one table by interpolation. What gives such a channel away is
    that its bends (or steps) come in a strict rhythm.
    """
    if len(readings) < 200 or not np.isfinite(readings).all():
        return None
    for held, changes in ((True, np.abs(np.diff(readings))), (False, np.abs(np.diff(readings, 2)))):
        usual = 2 * float(changes.mean())
        bent = changes > _NO_BEND * usual
        if not usual > 0 or bent.mean() > 1 - _STRAIGHT:
            continue
        rate = _rhythm(bent.astype(float), export_rate, held)
        if rate is not None:
            return SlowerChannel(rate, export_rate, 1 if held else 2)
    return None


def _rhythm(bent: FloatArray, export_rate: float, held: bool) -> float | None:
    """Rate at which the bends come [Hz]; None where they do not come in a rhythm."""
    n = len(bent)
    padded = 8 * n
    spectrum = np.abs(np.fft.rfft(bent - bent.mean(), padded))
    step = export_rate / padded
    low, top = int(8 * padded / n), int(0.505 * export_rate / step)
    peaks = spectrum[low : top + 1]
    if not len(peaks) or not peaks.max() > 0:
        return None
    # the first line of a rhythm is the rate, the others are its multiples
    peak = low + int(np.flatnonzero(peaks > 0.7 * peaks.max())[0])
    while peak + 1 < len(spectrum) and spectrum[peak + 1] > spectrum[peak]:
        peak += 1
    ratio = 1 / (peak * step / export_rate)
    # a corner between two samples of the export bends the line at both
    each = 1 if held or bent.mean() < 1.5 / ratio else 2
    expected = each / ratio
    strict = abs(bent.mean() / expected - 1) < _COUNT_OFF and spectrum[peak] > _RHYTHM * np.sinc(expected) * bent.sum()
    return _sharpened(bent, peak * step, export_rate) if strict and expected < 1 - _STRAIGHT else None


def _sharpened(bent: FloatArray, rate: float, export_rate: float) -> float:
    """The rate to a part in a million: the even ratio next to it, or the phase advance between the halves."""
    ratio = export_rate / rate
    n = len(bent)
    if abs(ratio - round(ratio)) * n / ratio**2 < 0.5:
        return export_rate / round(ratio)
    place = np.arange(n) * rate / export_rate
    wave = bent * np.exp(-2j * np.pi * place)
    turn = np.angle(wave[n // 2 :].sum() * wave[: n // 2].sum().conj()) / (2 * np.pi)
    return rate + turn * export_rate / (n / 2)


def inspect_readings(run: Run) -> tuple[dict[str, SlowerChannel], tuple[Condition, ...]]:
    """Channels that were sampled slower than the export, by name, and what to say of them."""
    slower: dict[str, SlowerChannel] = {}
    for reader in device_readers(run):
        rows = reader.read(0, min(reader.length, _RHYTHM_LOOK)).rows
        for channel, values in zip(reader.channels, rows):
            filling = slower_channel(values, run.sample_rate)
            if filling is not None:
                slower[channel.name] = filling
    return slower, slower_condition(slower)
