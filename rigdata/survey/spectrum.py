"""Amplitude spectrum of one channel and its lines, for a first look."""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray

#: A line must exceed by this factor the median of its neighbourhood to be named.
_STANDS_OUT = 8.0
_NEIGHBOURS = 25


@dataclass(frozen=True)
class SpectralPeak:
    """A spectral line: frequency [Hz] and peak amplitude, in the unit of the signal."""

    frequency: float
    amplitude: float


#: Lines of a spectrum, strongest first.
Peaks = tuple[SpectralPeak, ...]
#: Frequencies (m,) [Hz] and peak amplitudes (m,).
Spectrum = tuple[FloatArray, FloatArray]


def amplitude_spectrum(values: FloatArray, rate: float) -> Spectrum:
    """Peak amplitudes (m,) over frequency (m,) [Hz] of values (n,), Hann window, no trend; empty if there are too few.

    Gaps are filled in between, which is good enough for a look and for nothing else.
    """
    good = np.isfinite(values)
    n = len(values)
    if not rate > 0 or good.sum() < 32:
        return np.empty(0), np.empty(0)
    filled = values if good.all() else np.interp(np.arange(n), np.flatnonzero(good), values[good])
    place = np.linspace(-1.0, 1.0, n)
    centred = filled - filled.mean()
    centred = centred - place * (centred @ place) / (place @ place)
    window = np.hanning(n)
    return np.asarray(np.fft.rfftfreq(n, 1.0 / rate)), 2.0 * np.abs(np.fft.rfft(centred * window)) / window.sum()


def strongest(frequency: FloatArray, amplitude: FloatArray, most: int) -> Peaks:
    """The strongest peaks well above their neighbourhood; slow drift below four bins is no line."""
    peaks: list[SpectralPeak] = []
    if len(amplitude) < 16:
        return ()
    remaining = amplitude.copy()
    remaining[:4] = 0.0
    for _ in range(4 * most):
        i = np.argmax(remaining)
        if remaining[i] <= 0.0 or len(peaks) == most:
            break
        around = amplitude[max(4, i - _NEIGHBOURS) : i + _NEIGHBOURS + 1]
        if amplitude[i] > _STANDS_OUT * np.median(around) and i + 1 < len(amplitude):
            # between the bins by a parabola through the logarithms
            a, b, c = np.log(np.maximum(amplitude[i - 1 : i + 2], 1e-300))
            curve = a - 2 * b + c
            shift = np.clip(0.5 * (a - c) / curve, -0.5, 0.5) if curve < 0 else 0.0
            peaks.append(SpectralPeak(float(frequency[i] + frequency[1] * shift), float(amplitude[i])))
        remaining[max(0, i - 2) : i + 3] = 0.0  # the window's main lobe
    return tuple(peaks)
