"""Effects and verdicts in an engineer's words and units."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from model.effects import kind_of, known_effects
from tpjb_ident.compare.effect_words import amount, finding, label_in_words, words_of
from tpjb_ident.diagnosis.verdict.verdict import Assumption
from tpjb_ident.report.diagnosis_page import _row
from tpjb_ident.report.diagnosis_words import in_words, place


def found(value, half, unit):
    return SimpleNamespace(value=value, lo=value - half, hi=value + half, unit=unit)


def test_every_effect_of_the_library_has_its_words():
    assert all(words_of(name) for name in known_effects())


@pytest.mark.parametrize(
    ("label", "says"),
    [
        ("soft_pivot pad 2", "soft pivot pad #2"),
        ("misalignment direction 0.785398", "misalignment at 45°"),
        ("structure_compliance direction -1.5708", "structure compliance at −90°"),
    ],
)
def test_labels_in_words(label, says):
    assert label_in_words(label) == says


def test_numbers_of_a_sentence_are_in_the_units_that_people_read():
    assert in_words("a stiffness of -3.61e+07 N/m, most in load_ratio at static_load_direction -72-72 deg") == (
        "a stiffness of −36.1 MN/m, most in the size of the measured load at load direction -72 to 72°"
    )


def test_tolerances_are_in_the_units_that_people_read():
    rows = [_row(Assumption(*one)) for one in (
        ("clearance_scatter", 2e-6, [6.6e-07, -1.2e-06], "m", "default"),
        ("film_heat", 0.07, -0.0357, "1", "default"),
        ("supply_temperature", 0.5, -0.39, "K", "default"),
    )]  # fmt: skip
    assert rows == [
        ["clearance scatter", "2 µm", "default", "+0.7, −1.2 µm"],
        ["film heat", "7 %", "default", "−3.6 %"],
        ["supply temperature", "0.5 K", "default", "−0.4 K"],
    ]


@pytest.mark.parametrize("name", sorted(known_effects()))
def test_a_finding_names_its_size_and_no_variable(name):
    parameters = {}
    for p in kind_of(name).parameters_of(5):
        value = 2.0 if p.unit == "pad" else p.options[0] if p.options else p.typical
        parameters[p.name] = found(value if math.isfinite(value) else 1e-6, 0.02 * abs(value), p.unit)
    said = finding(name, parameters)
    assert "_" not in said
    assert any(c.isdigit() for c in said)
    assert "e-0" not in said


@pytest.mark.parametrize(
    ("value", "half", "unit", "says"),
    [
        (12.0e-6, 0.2e-6, "m", "12.00 ± 0.20 µm"),
        (3.5e8, 1e7, "N/m", "350 ± 10 MN/m"),
        (0.346, 0.006, "1", "34.60 ± 0.60 %"),
        (0.0349, 0.0017, "rad", "2.000 ± 0.097°"),
    ],
)
def test_amounts_are_in_the_units_that_people_read(value, half, unit, says):
    assert amount(found(value, half, unit)) == says


def test_pad_and_direction_are_in_words():
    words = finding("pad_offset", {"pad": found(2, 0, "pad"), "radial_offset": found(-12e-6, 0.2e-6, "m")})
    assert words == "pad #2 stands 12.00 ± 0.20 µm too far in"


def test_places_have_kilonewtons_and_degrees():
    assert place("static_load 2500-5000 N") == "at static load 2.5 to 5 kN"
    assert place("static_load_direction -90-72 deg") == "at load direction -90 to 72°"
    assert place("pad 5") == "at pad #5"
    assert in_words("repeat dry_compliance at pad 2") == "repeat the dry pivot tests at pad #2"
