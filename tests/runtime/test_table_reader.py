"""Tables on disk: written whole or not at all, without formulas, intervals by their limits; what comes back is held to
the schema, cell by cell, and what run.json contradicts is named or refused.

Files in `older` never change. Where a version is added, a file of the one before it stays, and its reader with it.
"""

import json
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from model.bearing_file import load_bearing
from model.effects import load_effects
from model.pivots import load_pivots
from rigdata.manifest.manifest import parse_manifest
from tests.command_line import ended, tpjb
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandRig, band_plans
from tpjb_ident.errors import BadInputError
from tpjb_ident.exports.formats import ExportError
from tpjb_ident.exports.write import export
from tpjb_ident.runtime.output_folder import contradiction, former_runs, record_text
from tpjb_ident.runtime.provenance import read_document, schema, sha256
from tpjb_ident.runtime.table_reader import column_of, read_table
from tpjb_ident.runtime.tables import printable, write_atomic, write_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_COLUMNS

HEAD = "static_load_N,shaft_speed_Hz,kxx_N_per_m,kxx_N_per_m_lo,kxx_N_per_m_hi,kxx_N_per_m_se,quality,condition_number"
GOOD = "5000,22,2e8,1.9e8,2.1e8,4e6,ok,1.5"


def saved(tmp_path, *lines, head=HEAD, name="coefficients.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(("\n".join([head, *lines]) + "\n").encode(encoding))
    return path


def coefficients(tmp_path, folder="out"):
    """A folder of results with its run.json."""
    out = tmp_path / folder
    out.mkdir()
    row = dict.fromkeys(POINT_COLUMNS, 20.0) | dict.fromkeys(COEFFICIENT_COLUMNS, 1e8) | {"quality": "ok"}
    write_table(out, "coefficients", pd.DataFrame([row]))
    paths = sorted(out.iterdir())
    entry = {"outputs": [p.name for p in paths], "outputs_sha256": {p.name: sha256(p) for p in paths}}
    (out / "run.json").write_text(record_text({"identify": entry}), encoding="utf-8")
    return out / "coefficients.csv"


def test_numbers_texts_and_gaps_are_read_with_their_lines(tmp_path):
    frame = read_table(saved(tmp_path, "# read off figure 3", "", GOOD, "5000,22,,,,,,inf"))
    assert frame.attrs["lines"] == [4, 5]
    assert frame["kxx_N_per_m"][0] == 2e8
    assert math.isnan(frame["kxx_N_per_m"][1])
    assert frame["quality"].tolist() == ["ok", ""]
    assert frame["condition_number"][1] == math.inf


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_the_delimiter_is_that_of_the_names(tmp_path, delimiter):
    path = saved(tmp_path, GOOD.replace(",", delimiter), head=HEAD.replace(",", delimiter))
    assert read_table(path)["static_load_N"].tolist() == [5000.0]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (f"{GOOD},", "line 2: has 9 cells, the names are 8"),
        (GOOD.removesuffix(",1.5"), "has 7 cells"),
        (GOOD.replace("22", "22 Hz"), "line 2, shaft_speed_Hz: '22 Hz' is no number"),
        (GOOD.replace("22", "1_000"), "is no number"),
        (GOOD.replace("22", "٢٢"), "is no number"),
        (GOOD.replace("22", '"22,5"'), "'22,5' is no number. Write a decimal point"),
        (GOOD.replace("5000", "inf"), "'inf' is no number"),
        (GOOD.replace("5000", "1e999"), "is no number"),
        (GOOD.replace("5000", "-5000"), "static_load_N: -5000 is below 0"),
        (GOOD.replace("22", "-22"), "shaft_speed_Hz: -22 is below 0"),
        (GOOD.replace("4e6", "-4e6"), "kxx_N_per_m_se: -4e6 is below 0"),
        (GOOD.replace("2e8", "2.2e8"), "kxx_N_per_m: 2.2e.08 is not within 1.9e.08 to 2.1e.08"),
        (GOOD.replace("2e8", ""), None),
        ("5000,22,,2.1e8,1.9e8,,ok,1", "is not within 2.1e.08 to 1.9e.08"),
        ('5000,22,"2e8', "cannot be read as a table"),
    ],
)
def test_a_line_that_does_not_hold_to_the_schema_is_refused_at_its_place(tmp_path, line, message):
    path = saved(tmp_path, line)
    if message is None:
        assert len(read_table(path)) == 1
        return
    with pytest.raises(BadInputError, match=f"coefficients.csv.*{message}"):
        read_table(path)


@pytest.mark.parametrize("rotation", ["sideways", "Clockwise", "cw", "nan"])
def test_the_sense_of_turning_is_one_of_two_words(tmp_path, rotation):
    """Whatever is not counter-clockwise would be mirrored by the exports, without a word."""
    head = "static_load_N,rotation"
    assert read_table(saved(tmp_path, "5000,", "5000,clockwise", head=head))["rotation"].tolist() == [
        "counter-clockwise", "clockwise",
    ]  # fmt: skip
    with pytest.raises(BadInputError, match=r"line 2, rotation: '.*' is not known\. Write counter-clockwise or clock"):
        read_table(saved(tmp_path, f"5000,{rotation}", head=head))


@pytest.mark.parametrize(
    ("end", "limit", "is_within"), [("lo", 9e7, 1), ("lo", 2e8, 0), ("hi", 2e8, 1), ("hi", 9e7, 0)]
)
def test_one_end_of_an_interval_is_held_against_the_value(tmp_path, end, limit, is_within):
    path = saved(tmp_path, f"5000,1e8,{limit}", head=f"static_load_N,kxx_N_per_m,kxx_N_per_m_{end}")
    if is_within:
        assert len(read_table(path)) == 1
    else:
        with pytest.raises(BadInputError, match=r"line 2, kxx_N_per_m: 1e.08 is not within"):
            read_table(path)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (f"{HEAD},", "column 9 has no name"),
        (f"{HEAD},kxx_N_per_m", "'kxx_N_per_m' is there twice"),
        (f"{HEAD},  quality ", "'quality' is there twice"),
    ],
)
def test_one_column_one_name(tmp_path, head, message):
    with pytest.raises(BadInputError, match=f"line 1: column .*{message.removeprefix('column ')}"):
        read_table(saved(tmp_path, f"{GOOD},", head=head))


@pytest.mark.parametrize(
    ("line", "changes", "message"),
    [
        (GOOD, {"needed": ("excitation_Hz",)}, "column excitation_Hz is missing"),
        (GOOD.replace("ok", "Öl"), {"encoding": "cp1252"}, "utf-8"),
        ("", {"head": ""}, "is empty"),
        (None, {}, "No such file"),
    ],
)
def test_missing_names_other_encodings_and_nothing_at_all_are_refused(tmp_path, line, changes, message):
    needed = changes.pop("needed", ())
    path = tmp_path / "none.csv" if line is None else saved(tmp_path, line, **changes)
    with pytest.raises(BadInputError, match=message):
        read_table(path, needed)


def test_a_column_is_found_with_its_ending_in_its_table_first():
    assert column_of("kyx_N_per_m_se_systematic")[1] == "_se_systematic"
    column, ending = column_of("model", "frf_models")
    assert column is not None
    assert (column.quantity, ending) == ("text", "")
    assert column_of("not_ours") == (None, "")


def test_what_was_written_is_read_back(tmp_path):
    path = coefficients(tmp_path)
    frame = read_table(path)
    pd.testing.assert_frame_equal(frame, pd.read_csv(path), check_dtype=False)


def rewrite(path, old="20.0", new="21.0"):
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")


DAMAGES = {
    "changed": rewrite,
    "unread": lambda path: (path.parent / "run.json").write_text("{", encoding="utf-8"),
    "newer": lambda path: rewrite(path.parent / "run.json", schema("tpjb-run"), "tpjb-run/99"),
    "half moved": lambda path: (path.parent / ".tpjb-moving-in").mkdir(),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_what_the_record_contradicts_is_not_exported(tmp_path, damage):
    path = coefficients(tmp_path)
    assert contradiction(path) == ""
    assert tpjb("export", path.parent, "--to", "csv", "--out", tmp_path / "before").exit_code == 0
    damage(path)
    result = ended(2, "export", path.parent, "--to", "csv", "--out", tmp_path / "o")
    assert contradiction(path).split()[0] in result.output
    assert not (tmp_path / "o").exists()
    with pytest.raises(ExportError, match="Run the command again"):
        export(path, "csv", tmp_path / "o")


@pytest.mark.slow
def test_others_name_it_and_go_on_and_a_table_alone_has_no_record_to_contradict(tmp_path, rocker_file):
    path = coefficients(tmp_path)
    rewrite(path)
    result = tpjb("compare", "--coefficients", path, "--bearing", rocker_file, "--out", tmp_path / "o")
    assert "is not what was computed" in " ".join(result.output.split())
    (path.parent / "run.json").unlink()
    assert contradiction(path) == ""


@pytest.mark.parametrize(
    "text", ["", "{", "[" * 100_000, "[]", '"text"', '{"schema": "tpjb-check/2"}', '{"schema": 1}', "\x00"]
)
def test_documents_that_are_none_are_refused(tmp_path, text):
    path = tmp_path / "check.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInputError, match=r"check\.json"):
        read_document(path, "tpjb-check")


@pytest.mark.parametrize(
    ("version", "entry"),
    [
        ("tpjb-run/1", {"settings": {"a": 1, "bearing": "b.toml"}, "inputs_at": {}}),
        ("tpjb-run/2", {"settings": {}, "options": {"a": 1}}),
    ],
)
def test_every_version_so_far_is_read(tmp_path, version, entry):
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"schema": version, "commands": {"locus": entry}}), encoding="utf-8")
    assert read_document(path, "tpjb-run")["commands"]["locus"]["options"] == {"a": 1}


def test_csv_and_parquet_hold_the_same_numbers_to_the_last_bit(tmp_path):
    frame = pd.DataFrame(
        {"a_m": [1 / 3, 1e-9, float("nan")], "n": [1, 2, 3], "ok": [True, False, True], "s": list("xyz")}
    )
    write_table(tmp_path, "t", frame)
    csv, parquet = tmp_path / "t.csv", tmp_path / "t.parquet"
    pd.testing.assert_frame_equal(pd.read_csv(csv), frame, check_exact=True, check_dtype=False)
    pd.testing.assert_frame_equal(pd.read_parquet(parquet), frame, check_exact=True, check_dtype=False)
    assert b"\r" not in csv.read_bytes()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_atomic(path, fail)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_printable_keeps_words_and_drops_what_steers():
    assert printable("µm ± °C 日本") == "µm ± °C 日本"
    assert printable("a\x1b[2Jb\u202ec\x00") == "a\ufffd[2Jb\ufffdc\ufffd"


OLDER = Path(__file__).with_name("older")
READERS = {
    "run.json": lambda path: read_document(path, "tpjb-run")["commands"]["locus"]["options"] == {"campaign": "demo.h5"},
    "check.json": lambda path: read_document(path, "tpjb-check")["counts"]["error"] == 1,
    "clearance.csv": lambda path: len(read_table(path)) == 5 and contradiction(path) == "",
    "pivots.toml": lambda path: load_pivots(path)[0].deflection(1000.0) == pytest.approx(4e-6),
    "updated.effects.toml": lambda path: load_effects(path)[0].name == "soft_pivot",
    "bearing.toml": lambda path: len(load_bearing(path).pads) == 5,
    "campaign.toml": lambda path: parse_manifest(path.read_text(encoding="utf-8")).id == "t",
}


@pytest.mark.parametrize("name", sorted(READERS))
def test_each_is_read(name):
    assert READERS[name](OLDER / name)


def test_each_states_its_version_and_none_is_forgotten():
    assert {path.name for path in OLDER.iterdir()} == set(READERS)
    for path in OLDER.iterdir():
        if path.suffix != ".csv":  # tables state theirs in run.json and in their Parquet twins
            assert re.search(r'"?schema"?\s*[:=]\s*"tpjb-[a-z]+/[0-9]+"', path.read_text(encoding="utf-8")), path.name


def test_a_folder_of_the_first_version_is_still_one():
    assert set(former_runs(OLDER)) == {"locus"}
    assert schema("tpjb-run") == "tpjb-run/2"
    result = ended(2, "verify", OLDER)
    assert "the results are unchanged" in " ".join(result.output.split())


#: Tables whose intervals are a half width to either side of the value.
SYMMETRIC = ("coefficients", "estimators", "frf", "frf_estimators", "frf_models", "frequency_fits")


def check_limits(folder) -> dict[str, int]:
    """Limits of every interval in a folder's tables, by table; the reader refuses a value outside its own."""
    counts = {}
    for path in sorted(folder.glob("*.csv")):
        frame = read_table(path)
        counts[path.stem] = 0
        for name in [name.removesuffix("_lo") for name in frame if name.endswith("_lo")]:
            assert column_of(name, path.stem)[0] is not None, name
            rows = np.isfinite(frame[[name, f"{name}_lo", f"{name}_hi"]]).all(axis=1)
            rows &= frame[f"{name}_lo"] != frame[f"{name}_hi"]  # the mass of a model without one
            value, low, high = (frame.loc[rows, name + end].to_numpy() for end in ("", "_lo", "_hi"))
            assert (low < value).all(), (path.name, name)
            assert (value < high).all(), (path.name, name)
            if path.stem in SYMMETRIC:
                assert np.allclose(value - low, high - value, rtol=1e-6, atol=1e-9 * np.abs(value).max(initial=1.0))
                standard = frame.loc[rows, f"{name}_se"].to_numpy()
                assert (high - value > standard).all(), (path.name, name)
            counts[path.stem] += int(rows.sum())
    return counts


@pytest.mark.slow
def test_limits_of_points(identified):
    counts = check_limits(identified)
    assert counts["coefficients"] == 8 * 2
    assert counts["estimators"] >= 8 * 2


@pytest.mark.slow
def test_limits_of_bands(tmp_path):
    rig = BandRig(kind="multisine")
    path = tmp_path / "band.h5"
    write_band_campaign(path, rig, band_plans(), 3)
    assert tpjb("identify", path, "--out", tmp_path / "o", "-q").exit_code in (0, 3)
    counts = check_limits(tmp_path / "o")
    assert counts["frf"] >= 8 * 20
    assert counts["frf_models"] >= 16
