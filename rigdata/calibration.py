"""How one channel's reading becomes an SI value."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import FloatArray
from rigdata.channel_response import NO_RESPONSE, ChannelResponse
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
