"""A file of every schema and version that was ever written, kept as it was: each is read to this day.

Files here never change. Where a version is added, a file of the one before it stays, and its reader with it.
"""

import re
from pathlib import Path

import pytest

from model.bearing_file import load_bearing
from model.effects import load_effects
from model.pivots import load_pivots
from rigdata.manifest.manifest import parse_manifest
from tests.command_line import ended
from tpjb_ident.runtime.output_folder import contradiction, former_runs
from tpjb_ident.runtime.provenance import read_document, schema
from tpjb_ident.runtime.table_reader import read_table

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
