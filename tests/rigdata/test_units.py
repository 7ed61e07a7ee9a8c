"""Quantities of a rig manifest: strict grammar, SI values, clear refusals; units that a record states beside them."""

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata import load_campaign
from rigdata.calibration import Channel, reading_gain, reading_zero
from rigdata.readers.base import RunReader
from rigdata.units import (
    SI_UNITS,
    UnitError,
    common_units,
    from_pint,
    is_signal,
    parse_quantity,
    parse_unit,
    sensitivity_gain,
    to_si,
    unit_factor,
)
from tests.manifests import PROBES, SWEEP, manifest, write_files, write_hdf5
from tpjb_ident.check.campaign import check_campaign

TWO_PI = 2 * math.pi


#: Quantities by dimension, as text, with their value in SI.
VALUES = {
    "angle": {
        "54 deg": math.radians(54), "-90 deg": -math.pi / 2, "-90°": -math.pi / 2, "\u221290 deg": -math.pi / 2,
        "\u201390 deg": -math.pi / 2, "1.5 rad": 1.5, "0.2 mm/m": 2e-4,
    },
    "speed": {
        **dict.fromkeys(["22 Hz", "1320 rpm", "1320 1/min", "22 1/s"], 22 * TWO_PI), "138.23 rad/s": 138.23,
    },
    "frequency": {"2 kHz": 2000.0},
    "force": {"5 kN": 5000.0, "5e3 N": 5000.0},
    "mass": {"30 kg": 30.0},
    "temperature": dict.fromkeys(["40 degC", "40 °C", "313.15 K", "104 degF"], 313.15),
    "ratio": {"1 %": 0.01, 0.01: 0.01, "2.0 mV/V": 0.002},
    "acceleration": {"1 g": 9.80665, **dict.fromkeys(["9.8 m/s^2", "9.8 m/s²", "9.8 m/s2"], 9.8)},
    "length": {"80 µm": 80e-6, "80 μm": 80e-6},
    "pressure": {"3 bar": 3e5, "210 GPa": 2.1e11},
    "time": {"20 ms": 0.02},
    "voltage": {".5 V": 0.5, "5. V": 5.0},
    "per kelvin": {"12e-6 1/K": 12e-6},
    "moment of inertia": {"0.256e-3 kg m^2": 0.256e-3},
    "stiffness": {"5 N/um": 5e6},
    "damping": {"2 kN*s/m": 2e3, "2 N.s/m": 2.0},
    "viscosity": {"3 mPa s": 3e-3},
    "conductivity": {"50 W/m/K": 50.0},
    "rotational stiffness": {"1000 N*m": 1000.0, "1 kN*m": 1000.0, "1 N*mm": 1e-3, "1 N*m/deg": 180 / math.pi},
}  # fmt: skip


@pytest.mark.parametrize(("dimension", "text"), [(dimension, text) for dimension, of in VALUES.items() for text in of])
def test_values(dimension, text):
    assert parse_quantity(text, dimension) == pytest.approx(VALUES[dimension][text], rel=1e-12)


#: Unit names that bearing files and effects files have always been able to use, with their factors.
BEARING_UNITS = {
    "length": {"m": 1.0, "mm": 0.001, "um": 1e-06, "µm": 1e-06},
    "angle": {"rad": 1.0, "deg": 0.017453292519943295},
    "mass": {"kg": 1.0, "g": 0.001},
    "force": {"N": 1.0, "kN": 1000.0},
    "stiffness": {"N/m": 1.0, "N/um": 1000000.0, "MN/m": 1000000.0},
    "compliance": {"m/N": 1.0, "um/N": 1e-06},
    "damping": {"N*s/m": 1.0, "kN*s/m": 1000.0},
    "rotational stiffness": {"N*m/rad": 1.0, "N*m": 1.0, "N m": 1.0, "N m/rad": 1.0},
    "moment of inertia": {"kg*m^2": 1.0, "kg m^2": 1.0},
    "pressure": {"Pa": 1.0, "MPa": 1000000.0, "GPa": 1000000000.0},
    "viscosity": {"Pa*s": 1.0, "Pa s": 1.0, "mPa*s": 0.001},
    "density": {"kg/m^3": 1.0},
    "temperature": {"K": 1.0, "degC": 1.0, "°C": 1.0, "C": 1.0, "celsius": 1.0},
    "temperature difference": {"K": 1.0},
    "per kelvin": {"1/K": 1.0},
    "specific heat": {"J/kg/K": 1.0},
    "conductivity": {"W/m/K": 1.0},
    "heat transfer": {"W/m^2/K": 1.0},
    "speed": {"rad/s": 1.0, "Hz": TWO_PI, "1/s": TWO_PI, "rpm": TWO_PI / 60, "1/min": TWO_PI / 60},
    "time": {"s": 1.0, "ms": 0.001, "us": 1e-06},
    "ratio": {"percent": 0.01, "%": 0.01},
}


@pytest.mark.parametrize(
    ("dimension", "unit"), [(dimension, unit) for dimension, units in BEARING_UNITS.items() for unit in units]
)
def test_units_of_bearing_files(dimension, unit):
    factor = BEARING_UNITS[dimension][unit]
    assert unit_factor(unit, dimension) == pytest.approx(factor, rel=1e-15)


#: What is said, and of which texts and numbers that are to be forces, or another dimension.
REFUSALS = {
    "no unit": ["5", 5, (5.0, "angle"), 16**5000],
    "did you mean Hz?": [("25 hz", "speed")],
    "did you mean degC?": [("40 DegC", "temperature")],
    "times the density is one": [("39.6 cSt", "viscosity"), ("46 mm^2/s", "viscosity")],
    "times 9.81 m/s.2 is one": ["500 kg"],
    'as in "500 N/m"': [("500", "stiffness"), (500, "stiffness")],
    "expected a number": [(True, "ratio"), None, [1]],
    "decimal point": ["7,78 kN"],
    "not a number": ["kN", "nan N", "inf N", "٣ N"],
    "not a number with a unit": [("five mm", "length")],
    "not one of force": ["5 kN/m", "5 N*m"],
    "not one of angle": [("5 Hz", "angle"), ("54 %", "angle"), ("5 mm/s", "angle")],
    "not one of ratio": [("54 deg", "ratio")],
    "not one of rotational stiffness": [("5 N/m", "rotational stiffness")],
    "not known": ["5 flurb"],
    "finite": ["1e400 N", (float("nan"), "ratio")],
    "cannot be read": ["0x10 N", "5 N**99999999", "5 __import__('os')", ("5 mm; import os", "length")],
    "cannot be read|not known": ["1_000 N"],
    "ends": ["5 N/"],
    "where a unit name": ["5 /N"],
    "parenthesis": ["5 (N", "5 N)"],
    "too long": ["5 " + "N*" * 30 + "N"],
    "a text of 203 characters": ["5 " + "N*" * 100 + "N"],
    "302 characters": ["9" * 300 + " N"],
}


@pytest.mark.parametrize("says", REFUSALS)
def test_refusals(says):
    for case in REFUSALS[says]:
        text, dimension = case if isinstance(case, tuple) else (case, "force")
        with pytest.raises(UnitError, match=f"^gap: .*({says})"):
            parse_quantity(text, dimension, "gap")


@pytest.mark.parametrize(
    ("sensitivity", "signal", "dimension", "gain"),
    [
        ("7.78 mV/um", "V", "length", 1 / 7780.0),
        ("200 mV/mil", "V", "length", 25.4e-6 / 0.2),
        ("10 mV/g", "V", "acceleration", 9.80665 / 0.010),
        ("10 mV/(m/s^2)", "mV", "acceleration", 0.1),
        ("15 K/V", "V", "temperature difference", 15.0),
        ("15 degC/V", "mV", "temperature difference", 0.015),
        ("100 mV/Hz", "V", "speed", TWO_PI / 0.1),
        ("1 V/rpm", "V", "speed", TWO_PI / 60),
        ("2 mV/(rad/s)", "mV", "speed", 0.5),
        ("1.6 mA/mm", "mA", "length", 1e-3 / 1.6),
        ("0.5 V/bar", "V", "pressure", 2e5),
        ("2 N/mV", "V", "force", 2000.0),
        ("25.5 count/um", "count", "length", 1e-6 / 25.5),
        ("1.6 counts/N", "LSB", "force", 1 / 1.6),
    ],
)
def test_sensitivities(sensitivity, signal, dimension, gain):
    assert is_signal(signal)
    assert sensitivity_gain(sensitivity, signal, dimension) == pytest.approx(gain, rel=1e-12)


@pytest.mark.slow
@given(st.text(max_size=60), st.sampled_from(sorted(SI_UNITS)))
@settings(max_examples=80, deadline=None)
def test_any_text_gives_a_finite_number_or_a_unit_error(text, dimension):
    try:
        value = parse_quantity(text, dimension)
    except UnitError:
        return
    assert math.isfinite(value)


UNITS = st.sampled_from(["m", "V", "mV", "um", "s", "g", "Hz", "K", "kN", "%", "rad", "V/m", "m^2", "1"])


@given(UNITS, UNITS, UNITS, st.integers(-6, 6).filter(bool))
@settings(max_examples=60, deadline=None)
def test_quotients_and_powers_follow_algebra(a, b, c, power):
    one, two, three = parse_unit(a), parse_unit(b), parse_unit(c)
    assert parse_unit(f"({a})/({b})*({c})").powers == (one * two**-1 * three).powers
    assert parse_unit(f"({a})/({b})*({c})").factor == pytest.approx((one * two**-1 * three).factor, rel=1e-12)
    assert parse_unit(f"{a.split('/')[0].rstrip('^2')}").factor > 0
    assert parse_unit(f"kN^{power}").factor == pytest.approx(1000.0**power, rel=1e-12)


def test_si_units_are_their_own_unit():
    for dimension, unit in SI_UNITS.items():
        if unit and dimension not in {"frequency"}:
            assert unit_factor(unit, dimension) == pytest.approx(1.0)


@pytest.mark.parametrize("name", common_units())
def test_units_of_the_table_are_those_of_pint(name):
    assert common_units()[name] == from_pint(name)


def test_pint_quantities():
    import pint

    u = pint.UnitRegistry(cache_folder=None)
    assert to_si(5 * u.kN, "force", "load") == pytest.approx(5000.0)
    assert to_si(22 * u.hertz, "speed", "speed") == pytest.approx(22 * TWO_PI)
    assert to_si(1320 * u.rpm, "speed", "speed") == pytest.approx(22 * TWO_PI)
    assert to_si([1.0, 2.0] * u.rad / u.s, "speed", "excitation") == pytest.approx([1.0, 2.0])
    with pytest.raises(UnitError, match="load"):
        to_si(5 * u.mm, "force", "load")
    assert to_si("5 kN", "force", "load") == pytest.approx(5000.0)


@pytest.mark.parametrize(
    ("arguments", "gain"),
    [
        (("force", "mV", "2.0 mV/V", "20 kN", "5 V"), 2000.0),  # reading / (sensitivity * excitation) * full scale
        (("force", "mV/V", "2.0 mV/V", "20 kN"), 10_000.0),  # a bridge amplifier that needs no supply
        (("displacement", "um", "7.78 mV/um"), 1e-6),  # an engineering unit is already converted
        (("speed", "rpm", None), 2 * np.pi / 60),
    ],
)
def test_gain_of_a_chain(arguments, gain):
    assert reading_gain(*arguments) == pytest.approx(gain)


def test_polarity_and_zero():
    channel = Channel("L", "force", "V", gain=100.0, zero=reading_zero("force", "V", "50 N"), polarity=-1)
    assert channel.to_si(np.array([0.0, 1.0])) == pytest.approx([50.0, -50.0])


@pytest.mark.parametrize(
    ("unit", "zero", "kelvin"),
    [
        ("degC", None, 293.15),
        ("K", None, 20.0),
        ("degF", None, 266.483333),
        ("V", None, 293.15),
        ("V", "0 degC", 293.15),
    ],
)
def test_temperature_of_reading_twenty(unit, zero, kelvin):
    gain = reading_gain("temperature", unit, "1 K/V")
    channel = Channel("T1", "temperature", unit, gain=gain, zero=reading_zero("temperature", unit, zero))
    assert channel.to_si(np.array([20.0])) == pytest.approx([kelvin])


TIMED = PROBES | {"Zeit": {"quantity": "time", "unit": "s"}}
OTHER = """
    displacement V mV, displacement um mm, displacement V um, force mV mV/V, force N kN, acceleration m/s^2 g,
    temperature degC K, temperature degC degF, time s ms, speed rpm Hz
"""
#: Another spelling, or what is no unit.
SAME = (
    ("displacement", "V", " V "), ("displacement", "um", "µm"), ("displacement", "um", "micron"),
    ("displacement", "V", ""), ("displacement", "V", "raw"), ("displacement", "V", "X1A of the new amplifier"),
    ("acceleration", "m/s^2", "m/s²"), ("temperature", "degC", "°C"), ("speed", "rpm", "1/min"), ("time", "s", "sec"),
    ("command", "V", "mV"),
)  # fmt: skip


@pytest.mark.parametrize(("quantity", "unit", "text"), [*(case.split() for case in OTHER.split(",")), *SAME])
def test_another_unit_is_an_error_and_another_spelling_nothing(quantity, unit, text):
    reader = RunReader(Path("c.csv"), "c.csv", "c-1", {"C": Channel("C", quantity, unit=unit)})
    problems = reader.unit_problems({"C": text})
    assert all(p.severity == "error" and p.place == "channel C" for p in problems)
    says = [] if (quantity, unit, text) in SAME else [f"the file states {text!r}, the manifest unit = {unit!r}"]
    assert [p.what for p in problems] == says


@pytest.mark.parametrize("spec", [{}, {"units_line": 3}])
def test_the_units_row_of_a_text_file(tmp_path, spec):
    head = ["X1A;X1B;Zeit", *(["of;the;logger"] if spec else []), "um;mm;ms"]
    samples = [f"{np.sin(i):.5f};{np.cos(i):.5f};{0.1 * i:.1f}" for i in range(40)]
    text = manifest(TIMED, SWEEP, **({"csv": spec} if spec else {}))
    write_files(tmp_path, text, {"runs/c-1.csv": "\n".join([*head, *samples]) + "\n"})
    errors = " ".join(str(p) for p in check_campaign(tmp_path) if p.severity == "error")
    assert "channel X1B: the file states 'mm'" in errors
    assert "channel Zeit: the file states 'ms'" in errors
    assert "channel X1A" not in errors


@pytest.mark.parametrize("kind", [str, np.bytes_])
def test_the_unit_of_a_dataset(tmp_path, kind):
    text = manifest(PROBES, SWEEP, acquisition={"sample_rate": "10 Hz"})
    path = write_hdf5(tmp_path / "c.h5", text, dict.fromkeys(PROBES, np.arange(40.0)))
    with h5py.File(path, "r+") as file:
        for name, unit in (("X1A", "um"), ("X1B", "mm")):
            file[f"runs/c-1/{name}"].attrs.update({"units": kind(unit), "comment": 3.0})
    (problem,) = load_campaign(path).run("c-1").reader.problems()
    assert str(problem).startswith("c.h5:/runs/c-1, channel X1B: the file states 'mm', the manifest unit = 'um'")
