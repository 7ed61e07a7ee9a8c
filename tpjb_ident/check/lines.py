"""What a record shows of its excitation: by the phasors of identification; strong lines of a band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.run import Run
from tpjb_ident.phasors.bad_samples import window_median
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.run_data import RunPhasors

#: Lines of a band that are looked at, the strongest of as many parts of it.
_BAND_LINES = 8
#: Bins to either side of a disturbing line that are left alone.
_CLEAR_OF = 5
#: Noise is looked at from this many times the band's top on.
_ABOVE = 1.3
#: A part of the 1X force counts from this many standard errors of its windows.
_CLEAR = 8.0


@dataclass(frozen=True)
class RecordLines:
    """What a run's m channels show; NaN where they do not."""

    mean: FloatArray  #: (m,)
    floor: FloatArray  #: (m,): amplitude that noise alone makes of a line
    scatter: FloatArray  #: (m,): standard deviation of what is left
    omega: FloatArray = field(default_factory=lambda: np.empty(0))  #: (k,), rad/s: lines of the excitation
    rows: ComplexArray = field(default_factory=lambda: np.empty((0, 0), complex))  #: (k, m): phasors there

    @staticmethod
    def none(channels: int) -> RecordLines:
        """Of channels that show nothing."""
        return RecordLines(*np.full((3, channels), np.nan))

    @property
    def phasor(self) -> ComplexArray:
        """The first line, (m,)."""
        return self.rows[0] if len(self.rows) else np.full(len(self.mean), np.nan + 0j)


def excitation_line(phasors: RunPhasors, line: int, channels: Sequence[Channel]) -> RecordLines:
    """One excitation line as identification has it."""
    values = phasors.mean, np.abs(phasors.residual[line]), phasors.scale
    mean, floor, scatter = (_by_channel(window_median(rows), phasors, channels) for rows in values)
    row = _by_channel(phasors.record[line], phasors, channels)
    omega = 2 * np.pi * phasors.lines.excitation[line].frequency
    return RecordLines(mean, floor, scatter, np.array([omega]), row[None])


def shaft_line(phasors: RunPhasors, channels: Sequence[Channel]) -> FloatArray:
    """Size of what turns with the shaft in every channel (m,); NaN where it is not told from the excitation."""
    place = phasors.lines.place("1X")
    if place is None:
        return np.full(len(channels), np.nan)
    return _by_channel(window_median(np.abs(phasors.z[:, place])), phasors, channels)


def shaft_force(phasors: RunPhasors) -> float:
    """Logarithm of the 1X force's counter-clockwise part over its clockwise one; NaN where neither is clear.

    What is out of balance turns with the shaft, and so does the force that the film passes on. The cells are asked,
    not the probes: run-out, which differs from probe to probe, can turn an orbit of a micrometre round.
    """
    place = phasors.lines.place("1X")
    if place is None:
        return math.nan
    force = phasors.plane("force", phasors.z[:, place])
    force = force[np.isfinite(force).all(axis=1)]
    if len(force) < 2:
        return math.nan
    parts = np.abs(force[:, :1] + np.array([1j, -1j]) * force[:, 1:])
    forward, backward = parts.mean(axis=0)
    if not max(forward, backward) > _CLEAR * parts.std(axis=0).max() / math.sqrt(len(force)):
        return math.nan
    return math.log(forward / max(backward, 1e-3 * forward))


def _by_channel(values: np.ndarray, phasors: RunPhasors, channels: Sequence[Channel]) -> np.ndarray:
    """Values of a run's phasors by channel, of the channels asked for; NaN of those that it has not."""
    names = [channel.name for channel in phasors.channels]
    places = np.array([names.index(c.name) if c.name in names else -1 for c in channels], dtype=int)
    return np.append(values, np.nan)[places]


def steady_level(values: FloatArray, rate: float, frequencies: Sequence[float]) -> RecordLines:
    """Mean and scatter of a run without an excitation line, others taken off; `values` (n, m)."""
    positive = np.array([f for f in frequencies if f > 0])
    fit = LineFitter(len(values), rate, positive).fit(np.ascontiguousarray(values.T)[:, None], np.zeros(1))
    return RecordLines(fit.mean[0], np.full(values.shape[1], np.nan), fit.scale[0])


def band_lines(run: Run, level: RecordLines, values: FloatArray, force: Sequence[int]) -> RecordLines:
    """The level of a run with strong lines of its excitation over a band, and what noise makes of a line.

    What channels owe one another (two planes of probes, cells and accelerometers) holds at every line, so a few that
    stand clear of the noise, away from shaft and mains, serve the checks as the one line of a sine does.

    `values` (n, m), `force`: places of the cells.
    """
    finite = np.isfinite(values)
    if run.band is None or not len(force) or not finite.any(axis=0).all():
        return level
    window = np.hanning(len(values))
    centred = np.where(finite, values - np.nanmedian(values, axis=0), 0.0)
    spectrum = np.fft.rfft(centred * window[:, None], axis=0) * (2 / window.sum())
    frequency = np.fft.rfftfreq(len(values), 1 / run.sample_rate)
    free = np.ones(len(frequency), dtype=bool)
    for line in filter(None, (run.point.shaft_speed_hz, *MAINS_FREQUENCIES)):
        nearest = line * np.maximum(np.round(frequency / line), 1)
        free &= np.abs(frequency - nearest) > _CLEAR_OF * frequency[1]
    inside = np.flatnonzero(free & (frequency >= run.band[0]) & (frequency <= run.band[1]))
    above = free & (frequency > _ABOVE * run.band[1]) & (frequency < 0.45 * run.sample_rate)
    if len(inside) < _BAND_LINES or above.sum() < _BAND_LINES:
        return level
    power = np.sum(np.abs(spectrum[:, force]) ** 2, axis=1)
    chosen = [part[np.argmax(power[part])] for part in np.array_split(inside, _BAND_LINES)]
    floor = np.median(np.abs(spectrum[above]), axis=0)
    omega = np.asarray(2 * np.pi * frequency[chosen], dtype=float)
    return RecordLines(level.mean, floor, level.scatter, omega, spectrum[chosen])
