"""The whole record in one fit: its phasors, and what the lines leave of it as a spectrum.

Windows tell outliers from the rest; only the whole record tells lines one resolution cell apart, and how large the
noise is in the cells around a line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.run import Run
from tpjb_ident.phasors.channel_times import ChannelReader, Samples
from tpjb_ident.phasors.frequency import exact_frequencies
from tpjb_ident.phasors.line_fit import LineFitter, WindowFit
from tpjb_ident.phasors.lines import LineSet
from tpjb_ident.phasors.run_data import RunPhasors

#: Noise of a line is looked at in the bins so far from it [1 / record length],
_BESIDE = (3, 14)
#: and farther than this from all other lines.
_CLEAR_OF = 1.2
#: Order of the polynomial that takes slow movements of the shaft along: a window has 1.
_DRIFT_ORDER = 3


@dataclass(frozen=True)
class WholeRecord:
    """One device's record, fitted as one window."""

    lines: LineSet
    fit: WindowFit  #: of one window
    residual: FloatArray  #: (n_channels, n), SI: bad samples are zero
    rate: float
    start: float

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.residual.shape[1] / self.rate

    @cached_property
    def spectrum(self) -> ComplexArray:
        """Amplitudes of the residual with phases from t = 0, (n_bins, n_channels), a bin every 1 / duration."""
        used = self.residual.shape[1] * (1 - self.fit.lost[0])
        bins = np.fft.rfft(self.residual, axis=1).T * (2 / np.where(used > 0, used, np.nan))
        turn = np.exp(-2j * np.pi * np.arange(len(bins)) * self.start / self.duration) if self.start else 1.0
        return np.asarray(bins * np.reshape(turn, (-1, 1)))

    def beside(self, driven: int) -> ComplexArray:
        """Residual (n_bins, n_channels) in the bins around an excitation line, those of other lines left out."""
        frequencies = np.array([line.frequency for line in self.lines.whole])
        center = round(frequencies[driven] * self.duration)
        offsets = np.arange(_BESIDE[0], _BESIDE[1] + 1)
        bins = np.concatenate([center - offsets[::-1], center + offsets])
        bins = bins[(bins > 0) & (bins < len(self.spectrum))]
        others = np.delete(frequencies, driven) * self.duration
        free = np.abs(bins[:, None] - others).min(axis=1, initial=np.inf) > _CLEAR_OF
        return self.spectrum[bins[free]]


def whole_record(run: Run, result: RunPhasors) -> WholeRecord:
    """Fit a run in one, with its lines where the phases of its windows show them."""
    reader = ChannelReader(run)
    (device,) = reader.devices
    samples = reader.read(device, 0, device.length)
    return fitted_whole(samples, device.rate, result.lines, exact_frequencies(result, device.rate))


def fitted_whole(samples: Samples, rate: float, lines: LineSet, frequencies: FloatArray) -> WholeRecord:
    """Fit all samples of a device in one; times that stray from an even grid are taken for even."""
    fitter = LineFitter(samples.rows.shape[1], rate, frequencies, _DRIFT_ORDER)
    time = samples.time
    start = 0.0 if time is None or not np.isfinite(time[0]) else float(time[0])
    fit, residual = fitter.fit_with_residual(samples.rows[:, None], np.array([start]))
    return WholeRecord(lines, fit, residual[:, 0], rate, start)
