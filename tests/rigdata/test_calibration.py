"""Readings into SI values, to the letter of the export format."""

from __future__ import annotations

import numpy as np
import pytest

from rigdata.calibration import Channel, reading_gain, reading_zero
from rigdata.units import UnitError


@pytest.mark.parametrize(
    ("arguments", "gain"),
    [
        (("displacement", "V", "7.78 mV/um"), 1e-3 / 7.78),  # eddy-current probe
        (("force", "mV", "2.0 mV/V", "20 kN", "5 V"), 2000.0),  # reading / (sensitivity * excitation) * full scale
        (("force", "mV/V", "2.0 mV/V", "20 kN"), 10_000.0),  # a bridge amplifier that needs no supply
        (("acceleration", "V", "10 mV/g"), 980.665),  # g is standard gravity
        (("displacement", "um", "7.78 mV/um"), 1e-6),  # an engineering unit is already converted
        (("speed", "rpm", None), 2 * np.pi / 60),
    ],
)
def test_gain_of_a_chain(arguments, gain):
    assert reading_gain(*arguments) == pytest.approx(gain)


def test_polarity_and_zero():
    channel = Channel("L", "force", "V", gain=100.0, zero=reading_zero("force", "V", "50 N"), polarity=-1)
    assert channel.to_si(np.array([0.0, 1.0])) == pytest.approx([50.0, -50.0])


def test_thermometer():
    gain = reading_gain("temperature", "V", "15 K/V")
    channel = Channel("T1", "temperature", "V", gain=gain, zero=reading_zero("temperature", "V", "0 degC"))
    assert channel.to_si(np.array([2.0])) == pytest.approx([303.15])


@pytest.mark.parametrize(
    ("unit", "zero", "kelvin"),
    [("degC", None, 293.15), ("K", None, 20.0), ("degF", None, 266.483333), ("V", None, 293.15)],
)
def test_temperature_of_reading_twenty(unit, zero, kelvin):
    gain = reading_gain("temperature", unit, "1 K/V")
    channel = Channel("T1", "temperature", unit, gain=gain, zero=reading_zero("temperature", unit, zero))
    assert channel.to_si(np.array([20.0])) == pytest.approx([kelvin])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("force", "mV", None), "needs a sensitivity"),
        (("force", "mV", "2 mV/V"), "needs full_scale"),
        (("force", "mV", "2 mV/V", "20 kN"), "needs excitation"),
        (("force", "mV", "2 mV/V", "20 um", "5 V"), "not one of force"),
        (("force", "mV", "2 mV/V", "20 kN", "0 V"), "above zero"),
        (("force", "mV", "0 mV/V", "20 kN", "5 V"), "above zero"),
        (("displacement", "N", None), "not one of length"),
    ],
)
def test_incomplete_chains_are_refused(arguments, says):
    with pytest.raises(UnitError, match=says):
        reading_gain(*arguments)


def test_overflow_marks_are_missing():
    values = Channel("X", "displacement", "V").to_si(np.array([1.0, 1e99, -9.9e37, np.inf, np.nan]))
    assert np.array_equal(np.isnan(values), [False, True, True, True, True])


def test_readings_are_not_changed():
    readings = np.array([1.0, 2.0], dtype=np.float32)
    Channel("X", "displacement", "V", gain=2.0).to_si(readings)
    assert readings.tolist() == [1.0, 2.0]
