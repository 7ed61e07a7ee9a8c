"""What a person gives as an option or in the bearing file.

Lists and ranges with units, the sense of rotation, one value per pad.
"""

import csv
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.command_line import ended
from tpjb_ident.cli.inputs import parse_value, parse_values
from tpjb_ident.errors import BadInputError


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("5 kN", "force", [5000.0]),
        ("5kN", "force", [5000.0]),
        ("2.5 kN, 5 kN", "force", [2500.0, 5000.0]),
        ("2.5, 5, 7.5 kN", "force", [2500.0, 5000.0, 7500.0]),
        ("2500 N; 5 kN", "force", [2500.0, 5000.0]),
        ("2.5..8.75:1.25 kN", "force", [2500.0, 3750.0, 5000.0, 6250.0, 7500.0, 8750.0]),
        ("2.5 kN..5000 N:1250 N", "force", [2500.0, 3750.0, 5000.0]),
        ("1 kN, 2..4:1 kN", "force", [1000.0, 2000.0, 3000.0, 4000.0]),
        ("3..1:-1 kN", "force", [3000.0, 2000.0, 1000.0]),
        ("1..2:0.7 kN", "force", [1000.0, 1700.0]),
        ("22 Hz", "speed", [2 * math.pi * 22]),
        ("1320 rpm", "speed", [2 * math.pi * 22]),
        ("-90 deg, 0 deg", "angle", [-math.pi / 2, 0.0]),
        ("-90..90:90 deg", "angle", [-math.pi / 2, 0.0, math.pi / 2]),
        ("1e3 N", "force", [1000.0]),
        (" 5 kN , ", "force", [5000.0]),
    ],
)
def test_what_is_understood(text, dimension, expected):
    assert parse_values(text, dimension, "--x") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (" , ", "is empty"),
        ("5", "has no unit"),
        ("2,5 kN", "comma between digits"),
        ("5 Hz", "not one of force"),
        ("5 kNx", "is not known"),
        ("five kN", "not a number with a unit"),
        ("kN", "not a number with a unit"),
        ("1..5 kN", "has no step"),
        ("1..5:0 kN", "never reaches its end"),
        ("1..5:-1 kN", "never reaches its end"),
        ("1..5:1e-9 kN", "more than 10000 values"),
        ("1e999 kN", "finite|number"),
        ("nan kN", "not a number with a unit"),
        ("1..2..3:1 kN", "not a number with a unit"),
        ("5 kN\x1b[31m", "--x"),
    ],
)
def test_what_is_refused_says_why(text, says):
    with pytest.raises(BadInputError, match=says) as caught:
        parse_values(text, "force", "--x")
    assert str(caught.value).startswith("--x")


def test_one_value_means_one():
    assert parse_value("5e8 N/m", "stiffness", "--pivots") == pytest.approx(5e8)
    with pytest.raises(BadInputError, match="takes one value, got 2"):
        parse_value("1 kN, 2 kN", "force", "--load")


@given(
    start=st.integers(-50, 50), step=st.integers(1, 9), count=st.integers(1, 40), scale=st.sampled_from([1, 10, 1000])
)
def test_a_range_holds_its_end_when_the_steps_reach_it(start, step, count, scale):
    first, pace, last = start / scale, step / scale, (start + step * (count - 1)) / scale
    values = parse_values(f"{first:.3f}..{last:.3f}:{pace:.3f} kN", "force", "--load")
    assert len(values) == count
    assert values[-1] == pytest.approx(1e3 * last, abs=1e-6)


POINT = ("--load", "5 kN", "--speed", "22 Hz", "--excitation", "25 Hz")
FILM = ("--pivots", "rigid", "--thermal", "isothermal")
#: Entry of the rocker's bearing file, its section, and one value of it.
PER_PAD = [
    ("bearing", "assembled_clearance", '"0.080 mm"'),
    ("bearing", "pad_clearance", '"0.130 mm"'),
    ("pads", "arc", '"63.5 deg"'),
    ("pads", "pivot_offset", "0.5"),
    ("pads", "thickness", '"16 mm"'),
    ("pads", "babbitt_thickness", '"3 mm"'),
    ("pads", "mass", '"0.540 kg"'),
    ("pads", "moment_of_inertia", '"0.256e-3 kg m^2"'),
    ("pivot", "contact_length", '"39.6 mm"'),
    ("pivot", "housing_diameter", '"132.0 mm"'),
    ("pivot", "pivot_diameter", '"119.6 mm"'),
]


def predicted(bearing, out, *options, direction="-60 deg"):
    ended(0, "predict", bearing, *POINT, *FILM, "--load-direction", direction, *options, "--out", out)
    (row,) = csv.DictReader((out / "prediction.csv").read_text("utf-8").splitlines())
    return row


def test_predict_turns_the_shaft_the_way_that_is_asked_for_or_that_the_bearing_states(rocker_file, tmp_path):
    drawing = tmp_path / "b.toml"
    text = rocker_file.read_text("utf-8").replace("pivot_offset = 0.5", "pivot_offset = 0.6")
    drawing.write_text(text, "utf-8")
    usual = predicted(drawing, tmp_path / "usual")
    asked = predicted(drawing, tmp_path / "asked", "--rotation", "clockwise", direction="-120 deg")
    assert (usual["rotation"], asked["rotation"]) == ("counter-clockwise", "clockwise")
    for name, sign in (("kxx", 1), ("kxy", -1), ("kyx", -1), ("kyy", 1)):
        column = f"{name}_N_per_m"
        assert float(asked[column]) == pytest.approx(sign * float(usual[column]), rel=1e-6)
    drawing.write_text(text.replace("[bearing]", '[bearing]\nrotation = "clockwise"'), "utf-8")
    stated = predicted(drawing, tmp_path / "stated", direction="-120 deg")
    # where arrays lie in memory chooses a loop's vector or plain form: equal to rounding
    other = {name: cell for name, cell in stated.items() if name != "status" and cell != asked[name]}
    assert {name: float(cell) for name, cell in other.items()} == pytest.approx(
        {name: float(asked[name]) for name in other}, rel=1e-9
    )
    against = predicted(drawing, tmp_path / "against", "--rotation", "counter-clockwise")
    assert against["rotation"] == "counter-clockwise"
    assert float(against["kxx_N_per_m"]) < 0.6 * float(usual["kxx_N_per_m"])


@pytest.mark.parametrize("name", ["predict", "plan", "simulate"])
def test_a_sense_that_there_is_not_is_refused_with_the_nearest(name, rocker_file, tmp_path):
    options = () if name == "simulate" else POINT
    result = ended(2, name, rocker_file, *options, "--rotation", "clokwise", "--out", tmp_path / "out")
    assert "--rotation" in result.stderr
    assert "Did you mean 'clockwise'?" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("section", "entry", "value"), PER_PAD, ids=[entry for _, entry, _ in PER_PAD])
def test_a_list_of_another_length_than_pads_is_refused(section, entry, value, rocker_file, tmp_path):
    drawing = tmp_path / "b.toml"
    text, changed = re.subn(rf"^{entry} = \S.*?(?=\s+#|$)", f"{entry} = [{value}, {value}]",
                            rocker_file.read_text("utf-8"), flags=re.MULTILINE)  # fmt: skip
    assert changed == 1
    drawing.write_text(text, "utf-8")
    result = ended(2, "predict", drawing, *POINT, "--out", tmp_path / "out")
    assert f"b.toml, [{section}] {entry}: 2 values for 5 pads. Give one each, or one for all." in result.stderr
    drawing.write_text(text.replace(f"[{value}, {value}]", f"[{', '.join(5 * [value])}]"), "utf-8")
    assert predicted(drawing, tmp_path / "five")["converged"] == "True"
