"""Effects and verdicts in an engineer's words and units."""

import math
from types import SimpleNamespace

import pytest

from model.effects import kind_of, known_effects
from tpjb_ident.compare.effect_words import Estimate, amount, finding, label_in_words, words_of
from tpjb_ident.diagnosis.verdict.verdict import Assumption, FoundEffect, RankedCandidate, Remainder, Verdict
from tpjb_ident.report.diagnosis_page import (
    _evidence_sections,
    _other_explanations,
    _row,
    in_words,
    place,
    verdict_sentences,
)
from tpjb_ident.rounding import signed


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
        ("clearance_scatter", 2e-6, [6.6e-07, -1.2e-06], "m", "default", 3.4),
        ("film_heat", 0.07, -0.0357, "1", "default"),
        ("supply_temperature", 0.5, -0.39, "K", "default", -0.78),
    )]  # fmt: skip
    assert rows == [
        ["clearance scatter", "2 µm", "default", "+0.7, −1.2 µm", "+3.4"],
        ["film heat", "7 %", "default", "−3.6 %", ""],
        ["supply temperature", "0.5 K", "default", "−0.4 K", "−0.8"],
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


def oil(factor):
    return {"oil_viscosity": {"factor": {"value": factor, "lo": factor - 0.02, "hi": factor + 0.02, "unit": "1"}}}


GROWTH = {"thermal_growth": {"clearance_change": {"value": 9e-6, "lo": 8.8e-6, "hi": 9.2e-6, "unit": "m"}}}


@pytest.mark.parametrize(
    ("alone", "both", "says"),
    [
        (0.264, 0.736, "It may also be that the running clearance is 9.00 ± 0.20 µm larger than cold and the oil is "
                       "12.0 ± 2.0 % thinner than stated: probability 0.74, that of what is named 0.26."),
        (0.90, 0.05, "probability 0.05, that of what is named 0.90."),
        (0.96, 0.04, "No other explanation that was fitted comes within odds of 1 to 19 of it."),
        (0.0, 0.9, "probability 0.90, that of what is named 0.00."),
    ],
)  # fmt: skip
def test_a_rival_that_the_data_do_not_rule_out_stands_beside_the_name(alone, both, says):
    named = RankedCandidate("thermal_growth", 40.0, 0.3, GROWTH, alone)
    rival = RankedCandidate("thermal_growth + oil_viscosity", 43.0, 0.2, GROWTH | oil(0.88), both)
    found = FoundEffect("thermal_growth", {"clearance_change": Estimate(9e-6, 8.8e-6, 9.2e-6, "m")})
    verdict = Verdict("named", (found,), (), (), "", (rival, named), (), {}, {}, Remainder(0.2, 0.0, "kyy", 0.5))
    section = _other_explanations(verdict)
    assert len(section.notes) == 1
    assert section.notes[0].endswith(says)


def test_a_tolerance_beyond_three_deviations_is_said_with_its_size():
    assumptions = tuple(Assumption(name, 0.05, -0.1, "1", "default", far) for name, far in (
        ("viscosity", -3.2), ("film_heat", 2.9), ("probe_gain", 0.0),
    ))  # fmt: skip
    left = Remainder(0.2, 0.0, "kyy", 0.5)
    verdict = Verdict("consistent", (), (), (), "", (), (), {}, {}, left, assumptions=assumptions)
    section = _evidence_sections(verdict)[-1]
    beyond = [sentence for sentence in verdict_sentences("rig", verdict) if "without a name" in sentence]
    size = signed(-10.0)
    assert beyond == [f"Beyond what is stated, without a name: viscosity {size} %, 3.2 standard deviations."]
    assert [row[-1] for row in section.tables[0].rows] == ["−3.2", "+2.9", ""]
