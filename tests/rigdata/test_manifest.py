"""The manifest: every problem at once, each with its line and a cure."""

import math
import tomllib

import pytest

from rigdata.calibration import DIMENSIONS
from rigdata.manifest.fields import ACQUISITION, CHANNEL, HOUSING, RUN, SHAFT
from rigdata.manifest.manifest import MAX_MANIFEST, parse_manifest
from rigdata.operating_point import ROTATIONS
from rigdata.problem import RigDataError
from rigdata.units import SI_UNITS, parse_quantity
from tests.manifests import PROBES, SWEEP, manifest
from tests.rigdata.manifest_tables import markdown

PROBE = {"quantity": "displacement", "axis": "45 deg", "unit": "V", "sensitivity": "7.78 mV/um", "polarity": -1}
BRIDGE = {"sensitivity": "2.0 mV/V", "full_scale": "20 kN", "excitation": "5 V"}
POINT = {"shaft_speed": "22 Hz", "static_load": "5 kN", "static_load_direction": "-90 deg"}
THERMOMETER = {"quantity": "temperature", "unit": "V", "sensitivity": "15 K/V", "zero": "0 degC"}
GOOD = manifest(
    {
        "X1A": PROBE | {"uncertainty": "1 %"},
        "L1H": {"quantity": "force", "axis": "0 deg", "unit": "mV", **BRIDGE},
        "T1": THERMOMETER | {"pad": 1, "position": 0.75},
    },
    {"id": "d-05000-25-03", "file": "runs/d-05000-25-03.csv", "kind": "dynamic", **POINT}
    | {"excitation_frequency": "25 Hz", "excitation_direction": "54 deg"},
    {"id": "p-1-up", "file": "runs/p-1-up.csv", "kind": "dry_pivot", "pad": 1, "static_load_direction": "-90 deg"}
    | {"branch": "up", "sample_rate": "500 Hz"},
    head={"id": "rocker-A", "bearing": "rocker.toml", "description": "free text"},
    acquisition={"sample_rate": "2 kHz"},
    csv={"delimiter": ";", "decimal": ",", "encoding": "cp1252", "header_line": 7, "units_line": 8},
)

#: Stands for the line on which the replacement was made.
LINE = "the line"


def problems_of(text: str) -> list[str]:
    with pytest.raises(RigDataError) as caught:
        parse_manifest(text)
    return [str(p) for p in caught.value.problems]


def test_the_example_of_the_format():
    manifest = parse_manifest(GOOD)
    assert (manifest.id, manifest.bearing_name) == ("rocker-A", "rocker.toml")
    assert (manifest.housing_mass, manifest.sample_rate) == (30.0, 2000.0)
    assert (manifest.csv.delimiter, manifest.csv.decimal, manifest.csv.header_line) == (";", ",", 7)
    probe = manifest.channels["X1A"]
    assert (probe.axis, probe.polarity, probe.uncertainty) == (pytest.approx(math.pi / 4), -1, pytest.approx(0.01))
    thermometer = manifest.channels["T1"]
    assert (thermometer.pad, thermometer.position, thermometer.zero) == (1, 0.75, pytest.approx(273.15))
    dynamic, dry = manifest.runs
    point = dynamic.point
    assert (point.static_load, point.shaft_speed_hz, point.excitation_hz) == (5000.0, 22.0, 25.0)
    assert dynamic.excitation_direction == pytest.approx(math.radians(54))
    assert (dry.pad, dry.branch, dry.sample_rate) == (1, "up", 500.0)
    assert manifest.notes == ()


def test_a_key_that_is_mistyped_in_many_runs_is_told_once():
    runs = [SWEEP | {"id": f"c-{i}", "brunch": "up"} for i in range(18)]
    with pytest.raises(RigDataError) as error:
        parse_manifest(manifest(PROBES, *runs))
    assert len(error.value.problems) == 18
    (line,) = str(error.value).splitlines()
    assert line.startswith("campaign.toml, line 18, [[runs]] no. 1 brunch: unknown key 'brunch' (the like 17 more")
    assert line.endswith("times, such as line 23, line 28, line 33). Did you mean 'branch'?")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('mass = "30 kg"', 'mas = "30 kg"', [LINE, "'mas'", "Did you mean 'mass'"]),
        ('axis = "45 deg"', 'axes = "45 deg"', [LINE, "'axes'", "Did you mean 'axis'"]),
        ("[housing]", "[housng]", [LINE, "'housng'", "Did you mean 'housing'"]),
        ('kind = "dynamic"', 'kind = "dynamik"', [LINE, "Did you mean 'dynamic'"]),
        ('quantity = "force"', 'quantity = "forse"', [LINE, "Did you mean 'force'"]),
        ('shaft_speed = "22 Hz"', 'shaft_sped = "22 Hz"', ["shaft_sped", "Did you mean 'shaft_speed'"]),
        ('delimiter = ";"', 'delimeter = ";"', ["Did you mean 'delimiter'"]),
        ('static_load = "5 kN"', 'static_load = "5 um"', [LINE, "static_load", "not one of force"]),
        ('static_load = "5 kN"', 'static_load = "-5 kN"', [LINE, "not below 0"]),
        ('static_load = "5 kN"', "static_load = 5000", [LINE, "no unit"]),
        ('static_load = "5 kN"', 'static_load = "1e400 N"', ["finite"]),
        ('static_load = "5 kN"', 'static_load = "nan N"', ["not a number"]),
        ('static_load = "5 kN"\n', "", ["static_load is missing"]),
        ('sample_rate = "2 kHz"', 'sample_rate = "0 Hz"', [LINE, "above 0"]),
        ('sample_rate = "2 kHz"', 'sample_rate = "-2 kHz"', [LINE, "above 0"]),
        ('sample_rate = "2 kHz"', 'sample_rate = "2 kg"', [LINE, "not one of frequency"]),
        ('sensitivity = "7.78 mV/um"', 'sensitivity = "0 mV/um"', [LINE, "above zero"]),
        ('sensitivity = "7.78 mV/um"', 'sensitivity = "-7.78 mV/um"', [LINE, "polarity"]),
        ('sensitivity = "7.78 mV/um"', 'sensitivity = "7,78 mV/um"', [LINE, "decimal point"]),
        ('sensitivity = "7.78 mV/um"', 'sensitivity = "7.78 mV/g"', [LINE, "does not lead"]),
        ('sensitivity = "7.78 mV/um"', 'sensitivity = "7.78 um"', [LINE, "does not lead"]),
        ('sensitivity = "7.78 mV/um"', "sensitivity = 7.78", [LINE, "no unit"]),
        ('sensitivity = "7.78 mV/um"\n', "", ["needs a sensitivity"]),
        ('unit = "V"\nsensitivity = "7.78 mV/um"', 'unit = "N"', ["not one of length"]),
        ('full_scale = "20 kN"', 'full_scale = "20 um"', ["[channels.L1H]", "not one of force"]),
        ('excitation = "5 V"', 'excitation = "0 V"', ["[channels.L1H]", "above zero"]),
        ('full_scale = "20 kN"\n', "", ["needs full_scale"]),
        ('excitation = "5 V"\n', "", ["needs excitation"]),
        ('axis = "45 deg"\n', "", ["[channels.X1A]", "axis is missing"]),
        ("polarity = -1", "polarity = 2", [LINE, "Give 1 or -1"]),
        ("polarity = -1", 'polarity = "-1"', [LINE, "without quotes"]),
        ("polarity = -1", "polarity = true", [LINE, "without quotes"]),
        ('uncertainty = "1 %"', 'uncertainty = "-1 %"', [LINE]),
        ('uncertainty = "1 %"', 'uncertainty = "150 %"', [LINE, "below 100 %"]),
        ('"1 %"', "1" + "0" * 400, ["finite"]),
        ("position = 0.75", "position = 1.75", ["0 to 1"]),
        ("pad = 1\nposition", "pad = 0\nposition", ["whole number from 1"]),
        ('id = "p-1-up"', 'id = "d-05000-25-03"', ["used twice", "run no. 1"]),
        ('id = "p-1-up"', 'id = "../p-1"', ["cannot be used"]),
        ('id = "p-1-up"', "id = 7", ["not text"]),
        ("header_line = 7", "header_line = 0", ["whole number from 1"]),
        ("units_line = 8", "units_line = 6", ["not below header_line"]),
        ('decimal = ","', 'decimal = ";"', ["decimal: ';' is unknown"]),
        ('encoding = "cp1252"', 'encoding = "klingon"', ["encoding", "cp1252"]),
        ('encoding = "cp1252"', 'encoding = "zip"', ["encoding"]),
        ('branch = "up"', 'branch = "upp"', ["Did you mean 'up'"]),
        ("tpjb-rig/1", "tpjb-rig/2", ["tpjb-rig/2"]),
        ('bearing = "rocker.toml"\n', "", ["bearing is missing"]),
        ('[housing]\nmass = "30 kg"\n', "", ["mass is missing"]),
        ('[housing]\nmass = "30 kg"\n', "housing = 3\n", ["not a table"]),
        ("[[runs]]", "[[ruuns]]", ["Did you mean 'runs'", "no runs are listed"]),
        ('unit = "mV"', 'unit = "mX"', ["mX"]),
    ],
)
def test_one_fault_is_named_with_its_place(old, new, says):
    assert old in GOOD
    text = "\n".join(problems_of(GOOD.replace(old, new)))
    line = f"line {GOOD[: GOOD.index(old)].count(chr(10)) + 1},"
    for part in says:
        assert (line if part is LINE else part) in text


def test_every_problem_at_once():
    text = (
        GOOD.replace('mass = "30 kg"', 'mas = "30 kg"')
        .replace("polarity = -1", "polarity = 3")
        .replace('kind = "dynamic"', 'kind = "dynamik"')
        .replace('sample_rate = "500 Hz"', 'sample_rate = "500"')
    )
    problems = problems_of(text)
    assert len(problems) >= 4
    for part in ("'mas'", "polarity: 3 is unknown", "dynamik", "has no unit"):
        assert part in "\n".join(problems)


def test_a_calibration_that_is_not_used_is_said():
    text = GOOD.replace('unit = "V"\nsensitivity = "7.78 mV/um"', 'unit = "um"\nsensitivity = "7.78 mV/um"')
    manifest = parse_manifest(text)
    assert manifest.channels["X1A"].gain == pytest.approx(1e-6)
    assert [(p.severity, "not used" in p.what) for p in manifest.notes] == [("warning", True)]


@pytest.mark.parametrize(
    "text",
    ["", "x =", "a = [" * 5000, "i = " + "9" * 10_000, "\0", "[runs]", 'runs = "x"', "channels = 3", "id = 1979-05-27"],
)
def test_broken_toml_is_a_problem_not_a_traceback(text):
    assert problems_of(text)


def test_huge_manifests_are_refused_unparsed_and_thousands_of_faults_stay_bounded():
    assert "larger than" in problems_of("#" * (MAX_MANIFEST + 1))[0]
    assert 900 < len(problems_of(GOOD + "".join(f"[channels.C{i}]\n" for i in range(1200)))) <= 1000


def test_every_key_is_in_the_docs(checkout):
    assert markdown() in (checkout / "docs" / "campaigns.md").read_text("utf-8")


def test_choices_of_the_table_are_those_of_the_code():
    choices = {field.key: tuple(field.choices) for field in (*SHAFT, *CHANNEL)}
    assert choices["rotation"] == ROTATIONS
    assert choices["quantity"] == (*DIMENSIONS, "command", "keyphasor", "ignore")


@pytest.mark.parametrize("field", [f for f in CHANNEL + RUN + HOUSING + ACQUISITION if f.kind in SI_UNITS])
def test_examples_of_quantities_can_be_read(field):
    assert field.holds(parse_quantity(tomllib.loads(f"x = {field.example}")["x"], field.kind))
