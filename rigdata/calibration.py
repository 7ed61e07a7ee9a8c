"""How one channel's reading becomes an SI value, and what its electronics do to a sine.

A phasor that was recorded through a filter and late by a delay is divided by `ChannelResponse.at` of its frequency.
"""

import math
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.units import (
    LISTED,
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

_FILTER = re.compile(r"(bessel|butterworth)\s+([1-9]|1[0-2])\s+(low|high)\s+(.+)", re.IGNORECASE)
_SAY = (
    'Write for instance "bessel 4 low 800 Hz": bessel or butterworth, '
    "order as a whole number from 1 to 12, low or high, corner frequency"
)


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
        return freqs_zpk(*zpk, worN=2 * math.pi * frequency)[1]


def parse_filter(text: str) -> AnalogFilter:
    """Read ``"bessel 4 low 800 Hz"``."""
    parts = _FILTER.fullmatch(text.strip())
    if parts is None:
        raise UnitError(f"{text[:60]!r} is no filter. {_SAY}")
    corner = parse_quantity(parts[4], "frequency")
    if not 0 < corner < 1e12:
        raise UnitError(f"corner frequency {parts[4][:20]!r} must be above zero. {_SAY}")
    return AnalogFilter(parts[1].lower(), int(parts[2]), parts[3].lower(), corner)


@dataclass(frozen=True)
class ResponseTable:
    """A measured frequency response."""

    lines: tuple[tuple[float, float, float], ...]  #: frequency [Hz], gain, phase [rad]

    def at(self, frequency: FloatArray) -> ComplexArray:
        """Complex gain at `frequency` (n,) [Hz], linear between the lines of the table, NaN outside it."""
        frequencies, gains, phases = np.transpose(self.lines)
        gain = np.interp(frequency, frequencies, gains, left=np.nan, right=np.nan)
        return gain * np.exp(1j * np.interp(frequency, frequencies, phases))


def parse_response_table(text: str) -> ResponseTable:
    """Read a table of frequency_Hz, gain, phase_deg, one line each, separated by commas or semicolons."""
    lines = text.replace(";", ",").lower().splitlines()
    try:
        rows = np.loadtxt(lines, delimiter=",", comments=("#", "freq"), usecols=(0, 1, 2), ndmin=2)
    except ValueError as error:
        raise UnitError(f"the table does not hold frequency_Hz, gain, phase_deg in every line: {error}") from error
    frequency, gain, phase = rows.T
    if len(rows) < 2 or not np.isfinite(rows).all() or gain.min() <= 0 or np.diff(frequency).min() <= 0:
        raise UnitError("the table needs two lines and more, all finite, gains above zero, and frequencies that rise")
    rows[:, 2] = np.unwrap(np.radians(phase))
    return ResponseTable(tuple(map(tuple, rows.tolist())))


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
        for stage in self.filters:
            total = total * stage.at(f)
        return total


#: Of a channel that records as it is.
NO_RESPONSE = ChannelResponse()


#: Dimension (key of `rigdata.units.SI_UNITS`) of what each quantity of a manifest measures.
DIMENSIONS: dict[str, str] = LISTED["quantities"]
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


#: Channels by name.
Channels = Mapping[str, Channel]
#: Stands for a column that nobody describes.
UNDESCRIBED = Channel("", "ignore")


def reading_gain(
    quantity: str, unit: str, sensitivity: object, full_scale: object = None, excitation: object = None
) -> float:
    """SI value per unit of reading; of a bridge, full scale over sensitivity and supply."""
    dimension = DIMENSIONS[quantity]
    if not is_signal(unit):
        return unit_factor(unit, dimension)
    if sensitivity is None:
        raise UnitError(f"a reading in {unit} needs a sensitivity")
    if not (isinstance(sensitivity, str) and is_bridge_ratio(split_quantity(sensitivity, "ratio")[1])):
        return sensitivity_gain(sensitivity, unit, dimension)
    ratio, supply, signal = parse_quantity(sensitivity, "ratio"), 1.0, "ratio"
    if full_scale is None:
        raise UnitError(f"a sensitivity in V/V ({sensitivity!r}) needs full_scale")
    scale = parse_quantity(full_scale, dimension)
    if not is_bridge_ratio(unit):
        if excitation is None:
            raise UnitError(f"a sensitivity in V/V ({sensitivity!r}) needs excitation, the bridge supply")
        supply, signal = parse_quantity(excitation, "voltage"), "voltage"
    if min(ratio, scale, supply) <= 0:
        raise UnitError("sensitivity, full_scale and excitation must be above zero; a falling reading is polarity = -1")
    return unit_factor(unit, signal) / (ratio * supply) * scale


def reading_zero(quantity: str, unit: str, zero: object) -> float:
    """SI value at reading zero."""
    if zero is not None:
        return parse_quantity(zero, quantity if quantity == "temperature" else DIMENSIONS[quantity])
    if quantity != "temperature":
        return 0.0
    return ZERO_CELSIUS if is_signal(unit) else temperature_offset(unit)
