"""Bearing files: what they mean, and what is said about every key that is missing, unknown, wrong or impossible."""

import math
import re

import pytest

import rigdata.units
from model.bearing import BABBITT, STEEL, BearingError
from model.bearing_file import load_bearing

SECTIONS = {
    "journal": ["diameter"],
    "bearing": ["length", "assembled_clearance", "pad_clearance"],
    "pads": ["pivot_angles", "arc", "thickness", "mass", "moment_of_inertia"],
    "pads.backing": ["youngs_modulus", "poissons_ratio", "thermal_expansion", "conductivity"],
    "pads.babbitt": ["youngs_modulus", "poissons_ratio", "thermal_expansion", "conductivity"],
    "pivot": ["kind", "contact_length", "housing_diameter", "pivot_diameter"],
    "oil": [
        "supply_temperature", "viscosity_40C", "viscosity_exponent", "density_40C", "thermal_expansion",
        "specific_heat", "conductivity",
    ],
}  # fmt: skip
KEYS = [(section, key) for section, keys in SECTIONS.items() for key in keys]


@pytest.fixture(scope="module")
def text(rocker_file) -> str:
    return rocker_file.read_text(encoding="utf-8")


def edit(text: str, section: str, key: str, line: str | None) -> str:
    """Replace one key's line (or drop it)."""
    head, body = text.split(f"[{section}]\n", 1)
    pattern = re.compile(rf"^{key}\s*=.*$", re.MULTILINE)
    assert pattern.search(body)
    return head + f"[{section}]\n" + pattern.sub(line if line is not None else "", body, count=1)


def refused(text: str, *words: str) -> None:
    with pytest.raises(BearingError) as caught:
        load_bearing(text)
    for word in ("bearing", *words):
        assert word in str(caught.value), str(caught.value)


def test_bundled_rocker_is_the_papers(rocker_file):
    b = load_bearing(rocker_file)
    assert b.name == "Rocker-backed five-pad bearing"
    assert b.journal_radius == pytest.approx(0.04993)
    assert b.length == pytest.approx(0.0696)
    assert [math.degrees(p.pivot_angle) for p in b.pads] == pytest.approx([-90, -18, 54, 126, 198])
    pad = b.pads[0]
    assert pad.pad_clearance == pytest.approx(130e-6)
    assert pad.assembled_clearance == pytest.approx(80e-6)
    assert pad.preload == pytest.approx(1 - 80 / 130)
    assert math.degrees(pad.arc) == pytest.approx(63.5)
    assert pad.leading_edge == pytest.approx(-0.5 * pad.arc)
    assert b.pivot_radius(pad) == pytest.approx(0.04993 + 130e-6 + 0.016)  # docs/theory.md: R_P
    assert pad.elastic_thickness == pad.thickness
    assert (pad.backing, pad.babbitt) == (STEEL, BABBITT)
    assert b.oil.viscosity(40.0) == pytest.approx(0.0396)
    assert b.oil.viscosity(50.0) == pytest.approx(0.0396 * math.exp(-0.34))
    assert b.oil.density(50.0) == pytest.approx(860 * (1 - 7e-3))
    assert b.pivot.kind == "rocker"


@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_bundled_files_are_the_shared_ones(rocker_file, name):
    shared = rocker_file.parents[2].parent / "shared" / "bearings" / f"{name}.toml"
    if not shared.exists():
        pytest.skip("needs ../shared/bearings")
    assert load_bearing(rocker_file.with_name(f"{name}.toml")).pads == load_bearing(shared).pads


@pytest.mark.parametrize(("section", "key"), KEYS)
def test_missing_keys_are_named(text, section, key):
    if section == "pivot" and key != "kind":
        refused(edit(text, section, key, None), "[pivot]", key, "a rocker pivot needs it")
    else:
        refused(edit(text, section, key, None), f"[{section}] {key}", "missing", "Add it")


@pytest.mark.parametrize(("section", "key"), KEYS)
def test_misspelt_keys_get_a_hint(text, section, key):
    wrong = key[:-1] + "q"
    refused(
        edit(text, section, key, f'{wrong} = "1 mm"'), f"[{section}] {wrong}", "unknown key", f"Did you mean '{key}'"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("section", "key"), [k for k in KEYS if k[1] != "kind"])
@pytest.mark.parametrize("value", ['"3 parsnips"', '"1 s^7"', "true", '"1e999 mm"', '"nan mm"', '""', "{}"])
def test_wrong_units_and_values_are_named(text, section, key, value):
    if key == "poissons_ratio" and value == '"1e999 mm"':
        pytest.skip("covered by the others")
    refused(edit(text, section, key, f"{key} = {value}"), f"[{section}] {key}")


@pytest.mark.parametrize(
    ("section", "key"),
    [k for k in KEYS if k[1] not in {"kind", "supply_temperature", "pivot_angles", "poissons_ratio"}],
)
def test_negative_values_are_named(text, section, key):
    unit = re.search(rf'\[{re.escape(section)}\]\n(?:.*\n)*?{key}\s*=\s*"[\d.e+-]+ ([^"]+)"', text)
    assert unit
    refused(edit(text, section, key, f'{key} = "-1 {unit[1]}"'), f"[{section}] {key}", "must be positive")


@pytest.mark.parametrize("section", [s for s in SECTIONS if "." not in s])
def test_missing_sections_are_named(text, section):
    refused(text.replace(f"[{section}]", "[elsewhere]", 1), ", [elsewhere]: unknown key")
    start = text.index(f"[{section}]\n")
    following = text.find("\n[", start + 1)
    while section == "pads" and text[following + 2 :].startswith("pads."):
        following = text.find("\n[", following + 1)
    refused(text[:start] + (text[following + 1 :] if following > 0 else ""), f"section [{section}] is missing")


@pytest.mark.parametrize(
    ("section", "key", "line", "words"),
    [
        ("pads", "pivot_angles", "pivot_angles = []", ("pivot_angles", "1 to 40")),
        ("pads", "pivot_angles", 'pivot_angles = "12 deg"', ("pivot_angles", "must be a list")),
        ("pads", "pivot_angles", 'pivot_angles = ["0 deg", "30 deg"]', ("overlaps", "of arc", "of room")),
        ("pads", "arc", 'arc = "80 deg"', ("overlaps",)),
        ("bearing", "assembled_clearance", 'assembled_clearance = "0.080 um"', ("(1.4979e-06 to 0.0014979 m)", "unit")),
        ("bearing", "pad_clearance", 'pad_clearance = "13 mm"', ("pad_clearance is 0.013", "unit")),
        ("oil", "viscosity_40C", 'viscosity_40C = "39.6 Pa s"', ("viscosity_40 is 39.6", "5e-06 to 5 Pa s", "unit")),
        ("pads", "pivot_offset", "pivot_offset = 1.2", ("pivot_offset", "0.001 to 0.999 of the arc")),
        ("pads", "babbitt_thickness", 'babbitt_thickness = "20 mm"', ("babbitt_thickness < elastic_thickness",)),
        ("pivot", "kind", 'kind = "roker"', ("kind", "Did you mean 'rocker'")),
        ("pivot", "kind", "kind = 3", ("kind", "must be text")),
        ("pivot", "pivot_diameter", 'pivot_diameter = "140 mm"', ("pivot_diameter must be smaller",)),
        ("oil", "supply_temperature", 'supply_temperature = "40 K/s"', ("supply_temperature", "one of temperature")),
    ],
)  # fmt: skip
def test_impossible_geometry_is_explained(text, section, key, line, words):
    refused(edit(text, section, key, line), *words)


def test_units_do_not_matter(text):
    b = load_bearing(edit(text, "journal", "diameter", 'diameter = "3.93149606299 inch"'))
    assert b.journal_diameter == pytest.approx(99.86e-3, rel=1e-9)
    k = load_bearing(edit(text, "oil", "supply_temperature", 'supply_temperature = "313.15 K"'))
    assert k.oil.supply_temperature == pytest.approx(40.0)


def test_other_schema_not_toml_too_large_and_no_file_are_refused_and_a_byte_order_mark_is_taken(text, tmp_path):
    refused(text.replace("tpjb-bearing/1", "tpjb-bearing/2"), "schema", "tpjb-bearing/1")
    refused(text + "\n= 3\n", "not valid TOML")
    with pytest.raises(BearingError, match="no such file"):
        load_bearing(tmp_path / "none.toml")
    for folder in (tmp_path, ""):
        with pytest.raises(BearingError, match=r"is a folder\. Give the path of a tpjb-bearing/1"):
            load_bearing(folder)
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * 1_000_001)
    with pytest.raises(BearingError, match="larger than 1 MB"):
        load_bearing(large)
    latin = tmp_path / "latin.toml"
    latin.write_bytes("name = 'Lager für Öl'\n".encode("cp1252"))
    with pytest.raises(BearingError, match="UTF-8"):
        load_bearing(latin)
    latin.write_text(text, encoding="utf-8-sig")
    assert len(load_bearing(latin).pads) == 5


@pytest.mark.parametrize("value", ["0x" + "f" * 5000, "[[0x" + "f" * 5000 + "]]", "9" * 5000])
def test_whole_numbers_of_thousands_of_digits_are_named(text, value):
    refused(edit(text, "pads", "pivot_angles", f"pivot_angles = {value}"), "not valid TOML", "a whole number")


def test_bundled_bearings_do_without_pint(rocker_file, monkeypatch):
    def forbidden(name: str) -> float:
        raise AssertionError(f"{name} is not among the common units")

    monkeypatch.setattr(rigdata.units, "from_pint", forbidden)
    rigdata.units._base.cache_clear()
    rigdata.units.parse_unit.cache_clear()
    for name in ("rocker.toml", "spherical.toml"):
        assert load_bearing(rocker_file.with_name(name)).pads
