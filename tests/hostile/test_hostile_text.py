"""Text that is meant to hurt: TOML of deep nesting and huge numbers, cases of the fuzzer (tests/studies/fuzz.py)."""

import contextlib
import logging
import random
import time

import pytest

from model.bearing import BearingError
from model.bearing_file import parse_bearing
from model.effects import EffectError, load_effects
from model.pivots import load_pivots
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import MAX_DEPTH, RigDataError, parse_toml
from rigdata.survey.draft import column_names, updated_manifest
from rigdata.units import UnitError, parse_quantity
from tests.hostile.fuzz_mutations import mutated
from tests.hostile.fuzz_targets import make_target
from tests.manifests import PROBE, SWEEP, manifest
from tests.seeds import first_quick
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


HUGE = "9" * 400
PIVOTS = 'schema = "tpjb-pivots/1"\n[[pads]]\npad = 1\nforce_N = [{}]\ndeflection_m = [{}]\nvalid_to_N = {}\n'


@pytest.mark.parametrize(
    ("loads", "points", "end", "says"),
    [
        (f"0.0, 1.0, {HUGE}", "0.0, 1e-6, 2e-6", "2.0", "pad 1"),
        ("0.0, 1.0, 2.0", f"0.0, 1e-6, {HUGE}", "2.0", "pad 1"),
        ("0.0, 1.0, 2.0", "0.0, 1e-6, 2e-6", HUGE, "pad 1"),
        ("0.0, 1e-310, 2.0", "0.0, 1.0, 2.0", "2.0", "slopes that are numbers"),  # found by long fuzzing
        ("0.0, 1.0, 2.0", "0.0, 1e-320, 1e-6", "2.0", "slopes that are numbers"),
    ],
)
def test_curves_beyond_floats_are_named(tmp_path, loads, points, end, says):
    (tmp_path / "p.toml").write_text(PIVOTS.format(loads, points, end))
    with pytest.raises(BearingError, match=says):
        load_pivots(tmp_path / "p.toml")


def test_numbers_beyond_floats_and_what_long_fuzzing_found_are_refused_in_words(rocker_file, tmp_path):
    text = rocker_file.read_text("utf-8")
    for old, new, says in (
        ("poissons_ratio = ", f"poissons_ratio = {HUGE} #", "hundreds of digits"),
        ("pivot_angles = [", 'pivot_angles = [["1 deg"], ', "got an array"),
    ):
        with pytest.raises(BearingError, match=says):
            parse_bearing(text.replace(old, new, 1), "b.toml")
    (tmp_path / "e.toml").write_text(f'[[effects]]\nname = "soft_pivot"\npad = 5\nstiffness_factor = {HUGE}\n')
    with pytest.raises(EffectError, match="outside any physical range"):
        load_effects(tmp_path / "e.toml")
    channel = PROBE | {"unit": "V", "sensitivity": "1e-320 uV/Mm"}
    with pytest.raises(RigDataError, match="must be above zero"):
        parse_manifest(manifest({"A": channel}, SWEEP))


def test_a_number_of_thousands_of_digits_costs_no_time():
    began = time.process_time()
    with pytest.raises(UnitError, match="delay: a text of 60000 characters is not a quantity"):
        parse_quantity("9" * 60_000, "time", "delay")
    with pytest.raises(BadInputError, match="--load: '999"):
        parse_values("9" * 60_000 + " kN", "force", "--load")
    # the search for the end of the number took seconds, with the square of the digits
    assert time.process_time() - began < 1.0


@pytest.mark.parametrize("name", BOMBS)
def test_a_manifest_that_is_carried_on_is_refused_likewise(name):
    began = time.process_time()
    with contextlib.suppress(RigDataError):  # those that are only large are taken
        updated_manifest(BOMBS[name], [])
    assert column_names(BOMBS[name]) == ()
    assert time.process_time() - began < 2.0


CASES = {
    "manifest": 100, "bearing": 100, "pivots": 150, "effects": 150, "csv": 40, "hdf5": 40, "table": 200, "record": 200,
    "mat": 150, "parquet": 60, "tdms": 60, "uff": 60, "mat73": 60, "asc": 60, "mf4": 5,
}  # fmt: skip


@pytest.fixture
def quiet_libraries():
    """What nptdms tells its log of broken files is not a test's business."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.usefixtures("quiet_libraries")
@pytest.mark.parametrize("name", first_quick(*CASES))
def test_spoilt_files_end_in_data_or_documented_errors(name, tmp_path):
    target = make_target(name, tmp_path)
    target.feed(target.seeds[0])  # the good file itself is read
    refused, incomplete = 0, []
    for number in range(CASES[name]):
        data = mutated(target.seeds, random.Random(f"short-{name}-{number}"))
        try:
            target.feed(data)
        except target.documented as error:
            refused += 1
            problems = error.problems if isinstance(error, RigDataError) else ()
            incomplete += [p for p in problems if not (p.what and p.cure and p.file)]
    assert incomplete == []
    assert refused > 0


def test_a_table_of_names_alone_is_refused_in_words(tmp_path):
    target = make_target("table", tmp_path)
    with pytest.raises(target.documented):
        target.feed(target.seeds[0].partition(b"\n")[0] + b"\n")
