"""Channels that a logger program filled up to a faster export, told by the images of their lines.

A channel sampled at f_s and written at a higher rate holds an image of every line f at f_s - f and f_s + f, of size
(f / (f_s -+ f))^n: n = 1 where values are held, 2 along straight lines, 4 along cubic splines. The line itself comes
out smaller (and late, where values are held) by a factor that the rates alone determine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.whole_record import WholeRecord, hann_amplitude, noise_floor

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
                line = record.lines.whole[strong].frequency, float(sizes[strong])
                found = _images_of(line, amplitude[:, column], floor, record)
                if found is not None:
                    slower.setdefault(result.channels[place].name, found)
    return slower


def _images_of(
    line: tuple[float, float], amplitude: FloatArray, floor: FloatArray, record: WholeRecord
) -> SlowerChannel | None:
    """Rate and order of filling by a pair of images of one line (frequency [Hz], size)."""
    frequency, size = line
    least = np.maximum(_CLEAR * floor, _SHARE * size)
    if not np.isfinite(least).all() or size <= 0:
        return None
    inside = amplitude[1:-1]
    top = (inside > least[1:-1]) & (inside >= amplitude[:-2]) & (inside > amplitude[2:])
    peaks = np.flatnonzero(top) + 1
    peaks = peaks[(peaks > 1.2 * frequency * record.duration) & _is_free(peaks, record)]
    for low in peaks[np.argsort(-amplitude[peaks])][:8]:
        rate = low / record.duration + frequency
        mirror = record.rate - (rate + frequency) if rate + frequency > record.rate / 2 else rate + frequency
        around = np.round(mirror * record.duration).astype(int) + np.arange(-1, 2)
        if around.min() < 1 or around.max() >= len(amplitude) - 1 or not _is_free(around, record).all():
            continue
        high = int(around[np.argmax(amplitude[around])])
        orders = [
            np.log(_peak_size(amplitude, int(k)) / size) / np.log(frequency / abs(rate + sign * frequency))
            for k, sign in ((low, -1), (high, 1))
        ]
        order = min(_ORDERS, key=lambda n: abs(n - orders[0]))
        if amplitude[high] > least[high] and max(abs(n - order) for n in orders) < _AGREE:
            offset = _peak_offset(amplitude, int(low))
            exact = (low + offset) / record.duration + frequency
            ratio = record.rate / exact
            exact = record.rate / round(ratio) if abs(ratio - round(ratio)) < _EVEN * ratio else exact
            return SlowerChannel(exact, record.rate, order)
    return None


def _is_free(bins: IntArray, record: WholeRecord) -> BoolArray:
    """Whether bins (n,) are away from all lines of the record, (n,)."""
    lines = np.array([line.frequency for line in record.lines.whole]) * record.duration
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
