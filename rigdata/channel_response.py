"""What a channel's electronics do to a sine: the filter before it, and how late it is recorded.

A phasor that was recorded through a filter and late by a delay is divided by `ChannelResponse.at` of its frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.units import UnitError, parse_quantity

_FAMILIES = ("bessel", "butterworth")
_SIDES = ("low", "high")
_MAX_ORDER = 12
_SAY = 'Write for instance "bessel 4 low 800 Hz": bessel or butterworth, order, low or high, corner frequency'


@dataclass(frozen=True)
class AnalogFilter:
    """An analogue filter by its data sheet."""

    family: str
    order: int
    side: str
    corner: float

    def at(self, frequency: FloatArray) -> ComplexArray:
        """Complex gain at `frequency` (n,) [Hz]."""
        from scipy.signal import freqs_zpk, iirfilter

        family = "bessel_mag" if self.family == "bessel" else self.family
        corner = 2 * math.pi * self.corner
        zpk = iirfilter(self.order, corner, btype=self.side, analog=True, ftype=family, output="zpk")
        return np.asarray(freqs_zpk(*zpk, worN=2 * math.pi * np.asarray(frequency, dtype=float))[1])


def parse_filter(text: str) -> AnalogFilter:
    """Read ``"bessel 4 low 800 Hz"``."""
    parts = text.split(None, 3)
    if len(parts) != 4 or parts[0].lower() not in _FAMILIES or parts[2].lower() not in _SIDES:
        raise UnitError(f"{text[:60]!r} is no filter. {_SAY}")
    if not (parts[1].isdecimal() and 1 <= int(parts[1]) <= _MAX_ORDER):
        raise UnitError(f"order {parts[1][:20]!r} is not a whole number from 1 to {_MAX_ORDER}. {_SAY}")
    corner = parse_quantity(parts[3], "frequency")
    if not 0 < corner < 1e12:
        raise UnitError(f"corner frequency {parts[3][:20]!r} must be above zero. {_SAY}")
    return AnalogFilter(parts[0].lower(), int(parts[1]), parts[2].lower(), corner)


@dataclass(frozen=True)
class ResponseTable:
    """A measured frequency response."""

    frequency: tuple[float, ...]
    gain: tuple[float, ...]
    phase: tuple[float, ...]

    def at(self, frequency: FloatArray) -> ComplexArray:
        """Complex gain at `frequency` (n,) [Hz], linear between the lines of the table, NaN outside it."""
        f = np.asarray(frequency, dtype=float)
        gain = np.interp(f, self.frequency, self.gain, left=np.nan, right=np.nan)
        phase = np.interp(f, self.frequency, self.phase)
        return np.asarray(gain * np.exp(1j * phase))


def parse_response_table(text: str) -> ResponseTable:
    """Read a table of frequency_Hz, gain, phase_deg, one line each, separated by commas or semicolons."""
    rows: list[tuple[float, float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = [c.strip() for c in line.replace(";", ",").split(",")]
        if not line.strip() or line.lstrip().startswith("#") or (not rows and cells[0].lower().startswith("freq")):
            continue
        try:
            frequency, gain, phase = (float(c) for c in cells[:3])
        except ValueError:
            raise UnitError(f"line {number} does not hold frequency_Hz, gain, phase_deg: {line[:60]!r}") from None
        if not (math.isfinite(frequency + phase) and 0 < gain < math.inf):
            raise UnitError(f"line {number}: frequency and phase must be finite, the gain above zero: {line[:60]!r}")
        if rows and frequency <= rows[-1][0]:
            raise UnitError(f"line {number}: frequencies must rise, {frequency:g} Hz follows {rows[-1][0]:g} Hz")
        rows.append((frequency, gain, phase))
    if len(rows) < 2:
        raise UnitError("the table holds fewer than two lines of frequency_Hz, gain, phase_deg")
    columns = np.array(rows).T
    phase = np.unwrap(np.radians(columns[2]))
    return ResponseTable(tuple(columns[0].tolist()), tuple(columns[1].tolist()), tuple(phase.tolist()))


@dataclass(frozen=True)
class ChannelResponse:
    """Filter, measured response and delay of one channel."""

    filters: tuple[AnalogFilter | ResponseTable, ...] = ()
    delay: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.filters) or self.delay != 0.0

    def at(self, frequency: FloatArray) -> ComplexArray:
        """What a phasor at `frequency` (n,) [Hz] was multiplied by."""
        f = np.asarray(frequency, dtype=float)
        total = np.exp(-2j * math.pi * f * self.delay)
        for each in self.filters:
            total = total * each.at(f)
        return np.asarray(total)


#: Of a channel that records as it is.
NO_RESPONSE = ChannelResponse()
