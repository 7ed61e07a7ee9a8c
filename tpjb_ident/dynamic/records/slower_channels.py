"""Channels that were sampled slower than the export and filled up: straight lines, or steps, between the samples.

Logger programs write groups of different rates into one table by interpolation. A sine comes out of that smaller (and
late, where values are held), by a factor that the two rates alone determine: it is taken out of the phasors as a
filter is. What gives such a channel away is that its bends (or steps) come in a strict rhythm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray

#: Samples that are looked at.
LOOK = 2**13
#: Share of the samples that must be straight (or flat), at least.
STRAIGHT = 0.15
#: A bend is none below this share of the usual one.
NO_BEND = 0.01
#: How much of the bends must come in one rhythm, of what a strict one has,
RHYTHM = 0.8
#: and how far their number may be off.
COUNT_OFF = 0.25


@dataclass(frozen=True)
class SlowerChannel:
    """How a channel was filled up.

    Attributes
    ----------
    rate : float
        At which it was sampled [Hz].
    export_rate : float
        At which it was written [Hz].
    held : bool
        Steps in place of straight lines.
    """

    rate: float
    export_rate: float
    held: bool

    def at(self, frequency: FloatArray) -> ComplexArray:
        """What the filling does to a sine of `frequency` (n,) [Hz]: sinc^2 for lines, sinc and half a step for steps.

        Where the rates divide evenly the sums over the samples of a period take the place of the integrals.

        Parameters
        ----------
        frequency : float
            [rad/s]
        """
        f = np.asarray(frequency, dtype=float)
        ratio = self.export_rate / self.rate
        even = abs(ratio - round(ratio)) < 1e-6 * ratio
        small = np.sin(np.pi * f / self.export_rate) * ratio if even else np.pi * f / self.rate
        one = np.where(f > 0, np.sin(np.pi * f / self.rate) / np.where(f > 0, small, 1.0), 1.0)
        if not self.held:
            return np.asarray(one**2, dtype=complex)
        late = 0.5 / self.rate - (0.5 / self.export_rate if even else 0.0)
        return np.asarray(one * np.exp(-2j * np.pi * f * late))


def slower_channel(readings: FloatArray, export_rate: float) -> SlowerChannel | None:
    """Tell whether a channel was filled up, from the beginning of its readings.

    Parameters
    ----------
    readings : (n,) ndarray
        As the file holds them.
    export_rate : float
        [Hz]
    """
    values = readings[:LOOK]
    if len(values) < 200 or not np.isfinite(values).all():
        return None
    for held, changes in ((True, np.abs(np.diff(values))), (False, np.abs(np.diff(values, 2)))):
        usual = 2 * float(changes.mean())
        bent = changes > NO_BEND * usual
        if not usual > 0 or bent.mean() > 1 - STRAIGHT:
            continue
        rate = _rhythm(bent.astype(float), export_rate, held)
        if rate is not None:
            return SlowerChannel(rate, export_rate, held)
    return None


def _rhythm(bent: FloatArray, export_rate: float, held: bool) -> float | None:
    """Rate at which the bends come [Hz]; None where they do not come in a rhythm."""
    n = len(bent)
    padded = 8 * n
    spectrum = np.abs(np.fft.rfft(bent - bent.mean(), padded))
    step = export_rate / padded
    low, top = int(8 * padded / n), int(0.505 * export_rate / step)
    found = spectrum[low : top + 1]
    if not len(found) or not found.max() > 0:
        return None
    # the first line of a rhythm is the rate, the others are its multiples
    peak = low + int(np.flatnonzero(found > 0.7 * found.max())[0])
    while peak + 1 < len(spectrum) and spectrum[peak + 1] > spectrum[peak]:
        peak += 1
    ratio = 1 / (peak * step / export_rate)
    # a corner between two samples of the export bends the line at both
    each = 1 if held or bent.mean() < 1.5 / ratio else 2
    expected = each / ratio
    strict = abs(bent.mean() / expected - 1) < COUNT_OFF and spectrum[peak] > RHYTHM * np.sinc(expected) * bent.sum()
    return _sharpened(bent, peak * step, export_rate) if strict and expected < 1 - STRAIGHT else None


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
