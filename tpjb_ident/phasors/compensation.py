"""What the channels' electronics did to the phasors, taken out: filters, delays, warmth, slower sampling.

A channel sampled at f_s and written at a higher rate (filled up by a logger program) holds an image of all that it
shows at f, noise too, at f_s - f and f_s + f, of size (f / (f_s -+ f))^n: n = 1 where values are held, 2 along straight
lines, 4 along cubic splines. A line itself comes out smaller (and late, where values are held) by a factor that the
rates alone determine. Images give the rate away: the phases of the spectrum at f and f_s - f add up to the same angle
at all f, which those of a record at its own rate do at no sum of two frequencies, but one: what a film that is not
linear makes of the shaft's own motion stands at X - f and 2X - f, and is no image.

A low-pass that nobody stated shows in the noise: flat up to its corner, then falling steeply, in all channels of a
quantity alike, while all others by the same device stay flat. Coloured noise has no flat part below its fall, or rises
before it; where a housing on soft cells is shaken, accelerometers show it as well. Where others are not flat, forces
all around move the rig: a mass answers them with 12 dB an octave less motion at the most, and what falls by more beside
the other quantities is behind a filter, also a single channel.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.campaign import Campaign
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.conditions import Condition, Conditions, holding, merged
from tpjb_ident.phasors.lines import SPEED_DRIFT
from tpjb_ident.phasors.run_data import RunPhasors, device_readers
from tpjb_ident.phasors.whole_record import local_maxima, vertex

#: Seconds from the start that are looked at, and powers of two of samples, at least and at most.
_LOOK, _LEAST_POWER, _MOST_POWER = 2.0, 13, 15
#: A reading so many times farther from its neighbours' mean than all but a hundredth is a glitch.
_GLITCH = 4.0
#: Pairs of bins that tell whether their phases agree, at least; bins that a slow movement may fill.
_LEAST_PAIRS, _SLOW = 30, 3
#: Exponent of chance below which phases agree: those of 80 plain records came to 18, of filled ones to 40 and more.
_CLEAR = 25.0
#: Sums of frequencies to either side [bins], above whose usual agreement a rate stands so many times (blows agree at
#: many of them, and come to 5; filled channels to 12 and more), and the least of a rate: what is folded back has less.
_BESIDE, _ABOVE, _AGREEMENT = 40, 6.0, 0.35
#: So far from multiples of a rate, over it and folded back, other sums agree by that much less: what a converter's few
#: steps make of lines agrees at many.
_NO_MULTIPLE, _RIVALS = 0.1, 1.8
#: Multiples of a rate that tell it more sharply.
_MULTIPLES = 4
#: Part of f_s in which images tell the order of filling, and how far from it they may be, relative.
_TOLD_BY, _AGREE = (0.2, 0.45), 0.35
#: Orders of filling.
_ORDERS = {1: "held", 2: "interpolated", 4: "interpolated (splines)"}
#: Rates that divide the export's rate to this share do so exactly.
_EVEN = 3e-4
#: Images to either side of a line that a spline's own factor is summed over.
_IMAGES = 20
#: Share of the rate that a filter before the converter leaves alone; octaves below it whose noise is asked, at least,
#: at most, and bins of the lowest.
_UNFILTERED, _LEAST_OCTAVES, _OCTAVES, _LEAST_BINS = 0.45, 5, 8, 20
#: Noise behind a filter [dB]: fall up to the highest octave (none in 270 good campaigns beside channels that are flat;
#: rounding ends it at 15 to 21), the steepest fall from one to the next (1/f noise: 3), change of what is flat; the
#: steepest beyond that of other quantities that a mass makes (7 in 350 good campaigns).
_FALL, _STEEP, _FLAT, _INERTIA = 10.0, 7.0, 3.0, 12.0
#: Excitation over the corner, below which a filter turns it by less than a degree.
_NEAR_CORNER = 0.01


#: Of any run.
Phasors = TypeVar("Phasors", bound=RunPhasors)


@dataclass(frozen=True)
class SlowerChannel:
    """How a channel was filled up."""

    rate: float
    export_rate: float
    order: int

    @property
    def steps(self) -> int:
        """Samples of the export a reading where that is a whole number, else zero."""
        ratio = self.export_rate / self.rate
        return round(ratio) if abs(ratio - round(ratio)) < _EVEN * ratio else 0

    def at(self, frequency: FloatArray) -> ComplexArray | FloatArray:
        """What the filling does to a sine of `frequency` (n,) [Hz]: sinc^2 for lines, sinc and half a step for steps.

        Where the rates divide evenly the sums over the samples of a period take the place of the integrals.
        """
        f = np.asarray(frequency, dtype=float)
        if self.order == 4:
            k = np.arange(1, _IMAGES)[:, None] * self.rate
            return 1 / (1 + ((f / (k - f)) ** 4 + (f / (k + f)) ** 4).sum(axis=0))
        small = np.sin(np.pi * f / self.export_rate) * self.steps if self.steps else np.pi * f / self.rate
        gain = np.sin(np.pi * f / self.rate) / small
        if self.order == 2:
            return gain**2
        late = 0.5 / self.rate - (0.5 / self.export_rate if self.steps else 0.0)
        return gain * np.exp(-2j * np.pi * f * late)

    def images(self, frequencies: FloatArray) -> FloatArray:
        """Frequencies at which images of some lines stand in the export."""
        k = np.arange(1, 4)[:, None] * self.rate
        places = np.concatenate([k - frequencies, k + frequencies]).ravel()
        return np.abs((places + 0.5 * self.export_rate) % self.export_rate - 0.5 * self.export_rate)


def filled_channels(run: Run) -> dict[str, SlowerChannel]:
    """Channels that were sampled slower than they were written, by name."""
    slower = {}
    for reader in device_readers(run):
        power = np.clip(np.log2(_LOOK * reader.rate) + 1, _LEAST_POWER, _MOST_POWER)
        _, rows = reader.read(0, min(reader.length, 2 ** int(power) - 2))
        for channel, values in zip(reader.channels, rows):
            filling = slower_channel(values, reader.rate, run.point.shaft_speed_hz)
            if filling is not None:
                slower[channel.name] = filling
    return slower


def slower_channel(values: FloatArray, export_rate: float, speed: float = 0.0) -> SlowerChannel | None:
    """How a channel was filled up, told from the beginning of its readings (n,); None where it was not.

    Phases agree at twice the rate as well, where the export reaches so far; those of blows do not. `speed` of the
    shaft [Hz].
    """
    clean = _clean_stretch(values)
    n = len(clean)
    if n < 8 * _LEAST_PAIRS:
        return None
    spectrum = np.fft.rfft((clean - clean.mean()) * np.hanning(n))
    size, agreement, chance = np.abs(spectrum), *_pair_agreement(spectrum)
    peaks = local_maxima(agreement)
    # the shaft's own motion makes such sums of any other
    step, orders = export_rate / n, np.array([1.0, 2.0])
    near_shaft = np.abs(peaks[:, None] * step - orders * speed) < orders * (SPEED_DRIFT + 2 * step)
    peaks = peaks[~near_shaft.any(axis=1)]
    clear = peaks[chance[peaks] > _CLEAR]
    for k in clear.tolist():
        ratio = np.array([clear, n - clear, 2 * n - clear]) / k
        others = clear[np.all(np.abs(ratio - np.round(ratio)) > _NO_MULTIPLE, axis=0)]
        order = _filling_order(size, k)
        nearby = np.median(agreement[max(k - _BESIDE, 0) : k + _BESIDE + 1])
        again = agreement[2 * k - 2 : 2 * k + 3]
        is_repeated = len(again) < 5 or again.max() >= 0.5 * agreement[k]
        least = max(_ABOVE * nearby, _RIVALS * agreement[others].max(initial=0.0), _AGREEMENT)
        if agreement[k] > least and is_repeated and order is not None:
            slower = SlowerChannel(_sharpened(agreement, chance, k) * export_rate / n, export_rate, order)
            return replace(slower, rate=export_rate / slower.steps) if slower.steps else slower
    return None


def _clean_stretch(values: FloatArray) -> FloatArray:
    """Longest stretch of readings (n,) without missing ones and glitches, whose phases agree everywhere."""
    bad = ~np.isfinite(values)
    bend = np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))
    usual = np.quantile(bend[np.isfinite(bend)], 0.99) if np.isfinite(bend).any() else 0.0
    bad[1:-1] |= bend > _GLITCH * usual
    edges = np.concatenate([[-1], np.flatnonzero(bad), [len(values)]])
    longest = np.argmax(np.diff(edges))
    return values[edges[longest] + 1 : edges[longest + 1]]


def _pair_agreement(spectrum: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """How well phases at f and k - f agree over all f, from 0 to 1 for every k in bins, and minus its log chance."""
    m = len(spectrum)
    phases = spectrum / np.maximum(np.abs(spectrum), np.finfo(float).tiny)
    phases[:_SLOW] = 0.0
    wave = np.fft.ifft(phases, 1 << (2 * m - 1).bit_length())
    sums = np.abs(np.fft.fft(wave**2))[: 2 * m - 1] * len(wave)
    pairs = np.minimum(np.arange(2 * m - 1), np.arange(2 * m - 2, -1, -1))
    agreement = sums / np.maximum(pairs, 1)
    # every pair is there twice, and the window makes neighbours alike
    return agreement, np.where(pairs > _LEAST_PAIRS, agreement**2 * pairs / 3, 0.0)


def _sharpened(agreement: FloatArray, chance: FloatArray, k: int) -> float:
    """Rate near `k` [bins] by the highest of its multiples that stands out."""
    rate = k + vertex(agreement[k - 1 : k + 2])
    for multiple in range(2, _MULTIPLES + 1):
        near = min(round(multiple * rate) - 2, len(agreement) - 5)
        near += int(np.argmax(agreement[near : near + 5]))
        if near + 1 < len(agreement) and chance[near] > _CLEAR:
            rate = (near + vertex(agreement[near - 1 : near + 2])) / multiple
    return rate


def _filling_order(size: FloatArray, k: int) -> int | None:
    """Order of filling by the images about f_s, bin `k`, of a spectrum (n_bins,); None where they tell none."""
    f = np.arange(int(_TOLD_BY[0] * k), int(_TOLD_BY[1] * k))
    f = f[k - f < len(size) - 1]
    if not len(f):
        return None
    shown = np.median(np.log(size[k - f] / size[f]) / np.log(f / (k - f)))
    order = min(_ORDERS, key=lambda n: abs(n - shown))
    return order if abs(shown - order) < _AGREE * order else None


def with_references(campaign: Campaign) -> Campaign:
    """Temperature coefficients without a stated reference count from the mean of the dynamic runs."""
    drifts = any(channel.temperature_coefficient for channel in campaign.channels.values())
    shown = [run.mean_temperature() for run in campaign.of_kind("dynamic") if drifts]
    measured = list(filter(None, shown))
    if not measured:
        return campaign
    mean, runs = float(np.mean(measured)), []
    for run in campaign.runs:
        channels = {
            n: replace(c, temperature_reference=c.temperature_reference or mean) for n, c in run.channels.items()
        }
        runs.append(replace(run, channels=channels))
    return replace(campaign, runs=tuple(runs))


def compensated(result: Phasors, run: Run, slower: Mapping[str, SlowerChannel], delays: Mapping[str, float]) -> Phasors:
    """The run's phasors as channels without filters, filling, delays and warmth would have given them.

    `delays` [s]: of whole quantities.
    """
    frequencies = result.lines.whole_frequencies
    columns = []
    for channel in result.channels:
        gain = np.exp(-2j * np.pi * frequencies * delays.get(channel.quantity, 0.0))
        if channel.response:
            response = channel.response.at(frequencies)
            unknown = ~np.isfinite(response) | (np.abs(response) <= 1e-6)
            if unknown[: len(result.lines.excitation)].any():
                text = f"its response at the excitation of {frequencies[unknown][0]:g} Hz is not known"
                cure = "Extend filter_table, or check filter"
                raise refuse(run.file, f"channel {channel.name}", f"{text}, or nothing comes through", cure, run.id)
            gain *= np.where(unknown, 1.0, response)  # 1 at disturbing lines that a table does not reach
        if channel.temperature_reference is not None:
            warmer = np.nan_to_num(result.temperature - channel.temperature_reference)
            gain *= 1 + channel.temperature_coefficient * warmer
        if channel.name in slower:
            gain *= slower[channel.name].at(frequencies)
        columns.append(gain)
    rates = ", ".join(f"{name} {_ORDERS[s.order]} from {s.rate:.4g} Hz" for name, s in slower.items())
    filled = holding((slower, "slower-channels", f"{rates}; what that does to a sine was taken out"))
    gains = np.stack(columns, axis=1)
    return replace(
        result,
        z=result.z / gains[: result.z.shape[1]],
        record=result.record / gains[: len(result.record)],
        residual=tuple(bins / gain for bins, gain in zip(result.residual, gains)),
        conditions=merged(result.conditions, filled),
    )


def unstated_filters(
    channels: Sequence[Channel], noise: ComplexArray, duration: float, band: tuple[float, float]
) -> Conditions:
    """Say which of m channels seem to be behind a low-pass that the manifest does not state.

    `noise` (n_bins, m): spectrum of what no line explains, every 1 / `duration` [Hz]; `band`: from where on it is noise
    [Hz], zero where it is everywhere, and up to where the excitation goes.
    """
    octaves = _UNFILTERED * 2 * (len(noise) - 1) / duration * 2.0 ** -np.arange(_OCTAVES, -1, -1)
    octaves = octaves[(octaves * duration > _LEAST_BINS) & (octaves >= band[0])]
    if len(octaves) <= (_LEAST_OCTAVES if not band[0] else 2):
        return ()
    parts = np.split(noise, np.round(octaves * duration).astype(int))[1:-1]
    level = 20 * np.log10([np.median(np.maximum(np.abs(part), np.finfo(float).tiny), axis=0) for part in parts])
    falls = level[: 1 if band[0] else 2].mean(axis=0) - level
    steps, corner = np.diff(falls, axis=0), len(falls) - np.argmax(falls[::-1] <= _FLAT, axis=0)
    steepest, quantity = steps.max(axis=0), np.array([channel.quantity for channel in channels])
    falling = (falls[-1] > _FALL) & (falls.min(axis=0) > -_FLAT)
    beyond = [steepest[k] - steepest[quantity != quantity[k]].max(initial=0.0) for k in range(len(channels))]
    filtered = falling & (steepest > _STEEP) & (corner > 1) & (np.abs(steps[0]) < _FLAT)
    flat = np.abs(falls).max(axis=0) < _FLAT
    if flat.any() and (flat | filtered).all():
        suspect = filtered & ~np.isin(quantity, quantity[~filtered])
    else:
        suspect = falling & (np.array(beyond) > _INERTIA)
    suspects = [k for k in np.flatnonzero(suspect).tolist() if not channels[k].response]
    # what probes and cells show alike is the shaft's vibration, or a filter that both have
    if not suspects or {"displacement", "force"} <= set(quantity[suspects]):
        return ()
    edge, names = octaves[corner[suspects].max()], ", ".join(channels[k].name for k in suspects)
    name = "filter-unstated" if band[1] > _NEAR_CORNER * edge else "filter-above-excitation"
    return (Condition(name, f"the noise of {names} falls from about {edge:.0f} Hz on"),)
