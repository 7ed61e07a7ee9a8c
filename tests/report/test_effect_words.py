"""Effects and verdicts in an engineer's words and units."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from model.effects import kind_of, known_effects
from tpjb_ident.effect_words import WORDS, amount, finding
from tpjb_ident.report.diagnosis_words import in_words, place


def found(value, half, unit):
    return SimpleNamespace(value=value, lo=value - half, hi=value + half, unit=unit)


def test_every_effect_of_the_library_has_its_words():
    assert set(known_effects()) <= set(WORDS)


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
