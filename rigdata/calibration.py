"""How one channel's reading becomes an SI value, and what its electronics do to a sine.

A phasor that was recorded through a filter and late by a delay is divided by `ChannelResponse.at` of its frequency.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.units import (
    ZERO_CELSIUS,
    UnitError,
    is_bridge_ratio,
    is_signal,
    parse_quantity,
    parse_unit,
    sensitivity_gain,
    split_quantity,
    temperature_offset,
    unit_factor,
)

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


#: Dimension (key of `rigdata.units.SI_UNITS`) of what each quantity of a manifest measures.
DIMENSIONS = {
    "displacement": "length",
    "force": "force",
    "acceleration": "acceleration",
    "temperature": "temperature difference",
    "pressure": "pressure",
    "speed": "speed",
    "time": "time",
}
#: Quantities of which only the course counts, not the size: their readings stay as they are.
UNCALIBRATED = ("command", "keyphasor")
#: Quantities with a direction in the bearing's plane.
VECTOR_QUANTITIES = ("displacement", "force", "acceleration")
#: Loggers write readings of this size and more for an overflow.
OVERFLOW = 1e30


@dataclass(frozen=True)
class Channel:
    """One column or dataset: what it measures, in which direction, and its calibration.

    ``value = polarity * gain * reading + zero`` with the reading in the unit that the file holds.

    Attributes
    ----------
    name : str
        Column or dataset name, key of the manifest.
    quantity : str
        ``"displacement"``, ``"force"``, ``"acceleration"``, ``"temperature"``, ``"pressure"``,
        ``"speed"``, ``"time"``, ``"command"``, ``"keyphasor"`` or ``"ignore"``.
    unit : str
        Unit of the reading, as the manifest gives it.
    gain : float
        SI value per unit of reading, positive.
    zero : float
        SI value at reading zero.
    polarity : int
        -1 where the reading falls when the quantity grows.
    axis : float or None
        Direction of the positive quantity [rad, counter-clockwise from +X].
    uncertainty : float or None
        Relative calibration uncertainty, one standard deviation.
    pad : int or None
        Pad number from 1, for temperatures and pressures.
    position : float or None
        Fraction of the pad's arc from its leading edge.
    axis_uncertainty : float
        Of `axis`, one standard deviation [rad].
    response : ChannelResponse
        Filter and delay, which are taken out of the phasors.
    delay_uncertainty : float
        One standard deviation [s].
    zero_uncertainty : float
        Of `zero`, one standard deviation, SI.
    clock : str
        Channels of one clock share a letter; "" where the manifest says nothing.
    sample_rate : float or None
        Of a device without times of its own [Hz].
    plane : float
        Axial position from the film's mid-plane [m].
    temperature_coefficient, temperature_coefficient_uncertainty : float
        Relative change of the gain per kelvin away from `temperature_reference`, and one standard deviation of it.
    temperature_reference : float or None
        [K]; None: mean over the campaign's runs.

    Examples
    --------
    >>> Channel("L1H", "force", unit="V", gain=2000.0, zero=50.0).to_si(np.array([0.0, 1.0]))
    array([  50., 2050.])
    """

    name: str
    quantity: str
    unit: str = ""
    gain: float = 1.0
    zero: float = 0.0
    polarity: int = 1
    axis: float | None = None
    uncertainty: float | None = None
    pad: int | None = None
    position: float | None = None
    axis_uncertainty: float = 0.0
    response: ChannelResponse = NO_RESPONSE
    delay_uncertainty: float = 0.0
    zero_uncertainty: float = 0.0
    clock: str = ""
    sample_rate: float | None = None
    plane: float = 0.0
    temperature_coefficient: float = 0.0
    temperature_coefficient_uncertainty: float = 0.0
    temperature_reference: float | None = None

    @property
    def calibration(self) -> Hashable:
        """What channels share that share one error of the gain: the sensor, its sensitivity and its uncertainty."""
        signal = parse_unit(self.unit, DIMENSIONS[self.quantity]).factor if self.quantity in DIMENSIONS else 1.0
        return self.name, float(f"{self.gain / signal:.9g}"), self.uncertainty

    @property
    def slope(self) -> float:
        """Signed SI value per unit of reading."""
        return self.polarity * self.gain

    def to_si(self, reading: NDArray[Any]) -> FloatArray:
        """Calibrate readings.

        Parameters
        ----------
        reading : (n,) ndarray
            In the unit that the file holds.

        Returns
        -------
        (n,) ndarray of float64
            SI values; what is not a finite number becomes NaN, and so do the magnitudes of 1e30 and
            more that loggers write for an overflow.
        """
        values = np.array(reading, dtype=np.float64)
        with np.errstate(invalid="ignore"):  # a NaN compared is what "no value" looks like
            values[~(np.abs(values) < OVERFLOW)] = np.nan
        values *= self.slope
        values += self.zero
        return values


def reading_gain(
    quantity: str, unit: str, sensitivity: object, full_scale: object = None, excitation: object = None
) -> float:
    """SI value per unit of reading."""
    dimension = DIMENSIONS[quantity]
    if not is_signal(unit):
        return unit_factor(unit, dimension)
    if sensitivity is None:
        raise UnitError(f"a reading in {unit} needs a sensitivity")
    if isinstance(sensitivity, str) and is_bridge_ratio(split_quantity(sensitivity, "ratio")[1]):
        return _bridge_gain(dimension, unit, sensitivity, full_scale, excitation)
    return sensitivity_gain(sensitivity, unit, dimension)


def _bridge_gain(dimension: str, unit: str, sensitivity: str, full_scale: object, excitation: object) -> float:
    ratio = parse_quantity(sensitivity, "ratio")
    if full_scale is None:
        raise UnitError(f"a sensitivity in V/V ({sensitivity!r}) needs full_scale")
    scale = parse_quantity(full_scale, dimension)
    if ratio <= 0 or scale <= 0:
        raise UnitError("sensitivity and full_scale must be above zero; a falling reading is polarity = -1")
    if is_bridge_ratio(unit):
        return parse_unit(unit).factor / ratio * scale
    if excitation is None:
        raise UnitError(f"a sensitivity in V/V ({sensitivity!r}) needs excitation, the bridge supply")
    supply = parse_quantity(excitation, "voltage")
    if supply <= 0:
        raise UnitError(f"excitation {excitation!r} must be above zero")
    return unit_factor(unit, "voltage") / (ratio * supply) * scale


def reading_zero(quantity: str, unit: str, zero: object) -> float:
    """SI value at reading zero."""
    if quantity != "temperature":
        return 0.0 if zero is None else parse_quantity(zero, DIMENSIONS[quantity])
    if zero is not None:
        return parse_quantity(zero, "temperature")
    return ZERO_CELSIUS if is_signal(unit) else temperature_offset(unit)
