"""TOML that is meant to hurt: deep nesting, huge keys and numbers, in every file that a stranger may have written."""

from __future__ import annotations

import time

import pytest

from model.bearing import BearingError
from model.bearing_file import load_bearing, parse_bearing
from model.effects import EffectError, load_effects
from model.pivots import load_pivots
from model.toml_text import MAX_DEPTH, parse_toml
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError
from rigdata.units import UnitError, parse_quantity
from tpjb_ident.cli.inputs import parse_values
from tpjb_ident.errors import BadInputError

BOMBS = {
    "dotted key": "a." * 16_000 + "a = 1",
    "dotted key in an inline table": "x = {" + "a." * 16_000 + "a = 1}",
    "dotted table name": "[" + "a." * 16_000 + "a]",
    "quoted dotted key": '"a".' * 10_000 + "a = 1",
    "nested arrays": "x = " + "[" * 20_000,
    "nested inline tables": "x = " + "{a=" * 20_000,
    "digits": "x = " + "9" * 5000,
    "one huge key": "k" * 500_000 + " = 1",
    "thousands of keys": "\n".join(f"k{i} = 1" for i in range(20_000)),
}


#: Name of a file -> what is written above a bomb, what reads the file, and what it may raise.
FILES = {
    "campaign.toml": ("", lambda path: parse_manifest(path.read_text()), RigDataError),
    "b.toml": ("", lambda path: parse_bearing(path.read_text(), "b.toml"), BearingError),
    "p.toml": ("", load_pivots, BearingError),
    "e.toml": ('schema = "tpjb-effects/2"\n', load_effects, EffectError),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
@pytest.mark.parametrize("file", FILES)
def test_a_bomb_is_refused_at_once(file, name, tmp_path):
    head, read, error = FILES[file]
    (tmp_path / file).write_text(head + BOMBS[name])
    began = time.process_time()
    with pytest.raises(error) as caught:
        read(tmp_path / file)
    # the dotted keys took more than four seconds each, and their square at twice the length
    assert time.process_time() - began < 2.0
    assert str(caught.value).count("\n") < 2000


def test_the_line_of_a_deep_key_is_named():
    with pytest.raises(ValueError, match="line 3 nests far too deeply"):
        parse_toml("a = 1\nb = 2\n" + "x." * (MAX_DEPTH + 1) + "y = 3\n")


@pytest.mark.parametrize(
    "text",
    [
        "x." * MAX_DEPTH + "y = 3",
        "# " + "." * 500,
        "force_N = [" + ", ".join(["0.5"] * 500) + "]",
        'description = "' + "a. b, " * 100 + '"',
    ],
)
def test_what_only_looks_deep_is_taken(text):
    assert isinstance(parse_toml(text), dict)


def test_numbers_beyond_floats_are_named(rocker_file, tmp_path):
    huge = "9" * 400
    text = rocker_file.read_text("utf-8")
    with pytest.raises(ValueError, match="hundreds of digits"):
        load_bearing(text.replace("poissons_ratio = ", f"poissons_ratio = {huge} #", 1))
    (tmp_path / "e.toml").write_text(f'[[effects]]\nname = "soft_pivot"\npad = 5\nstiffness_factor = {huge}\n')
    with pytest.raises(EffectError, match="outside any physical range"):
        load_effects(tmp_path / "e.toml")
    for key in ("force_N", "deflection_m", "valid_to_N"):
        pad = {"force_N": "[0.0, 1.0, 2.0]", "deflection_m": "[0.0, 1e-6, 2e-6]", "valid_to_N": "2.0"}
        pad[key] = pad[key].replace("2.0", huge).replace("2e-6", huge)
        lines = "\n".join(f"{k} = {v}" for k, v in pad.items())
        (tmp_path / "p.toml").write_text(f'schema = "tpjb-pivots/1"\n[[pads]]\npad = 1\n{lines}\n')
        with pytest.raises(BearingError, match="pad 1"):
            load_pivots(tmp_path / "p.toml")


def test_what_long_fuzzing_found_is_refused_in_words(rocker_file, tmp_path):
    """A list of lists of angles; a sensitivity below the smallest float; a pivot curve with slopes beyond floats."""
    text = rocker_file.read_text("utf-8")
    with pytest.raises(BearingError, match="got an array"):
        parse_bearing(text.replace("pivot_angles = [", 'pivot_angles = [["1 deg"], ', 1), "b.toml")
    channel = '[channels.A]\nquantity = "displacement"\naxis = "0 deg"\nunit = "V"\nsensitivity = "1e-320 uV/Mm"\n'
    with pytest.raises(RigDataError, match="must be above zero"):
        parse_manifest('schema = "tpjb-rig/1"\nid = "x"\nbearing = "b.toml"\n' + channel)
    for loads, points in (("0.0, 1e-310, 2.0", "0.0, 1.0, 2.0"), ("0.0, 1.0, 2.0", "0.0, 1e-320, 1e-6")):
        curve = f"force_N = [{loads}]\ndeflection_m = [{points}]\n"
        (tmp_path / "p.toml").write_text(f'schema = "tpjb-pivots/1"\n[[pads]]\npad = 1\n{curve}')
        with pytest.raises(BearingError, match="slopes that are numbers"):
            load_pivots(tmp_path / "p.toml")


def test_a_number_of_thousands_of_digits_costs_no_time():
    began = time.process_time()
    with pytest.raises(UnitError, match="delay: a text of 60000 characters is not a quantity"):
        parse_quantity("9" * 60_000, "time", "delay")
    with pytest.raises(BadInputError, match="--load: '999"):
        parse_values("9" * 60_000 + " kN", "force", "--load")
    # the search for the end of the number took seconds, with the square of the digits
    assert time.process_time() - began < 1.0
