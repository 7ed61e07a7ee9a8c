"""Tables on disk: whole or not at all, no formula for a spreadsheet, intervals by their limits; old files are read.

Files in `older` never change. Where a version is added, a file of the one before it stays, and its reader with it.
"""

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
from tpjb_ident.runtime.output_folder import contradiction, former_runs
from tpjb_ident.runtime.provenance import read_document, schema
from tpjb_ident.runtime.table_reader import column_of, read_table
from tpjb_ident.runtime.tables import printable, write_atomic, write_table


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


def test_a_folder_of_the_first_version_is_still_one(tmp_path):
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
