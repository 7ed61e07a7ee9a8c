"""`tpjb verify`: unchanged, changed, missing, moved: each has its words and its exit code."""

from __future__ import annotations

import json
import shutil

import pytest

from tests.command_line import tpjb
from tpjb_ident.runtime.output_folder import READY


@pytest.fixture(scope="module")
def located(tmp_path_factory, small_campaign):
    """Campaign and the results of `tpjb locus` on it."""
    folder = tmp_path_factory.mktemp("verify")
    campaign = folder / "data" / "small.h5"
    campaign.parent.mkdir()
    shutil.copy(small_campaign, campaign)
    result = tpjb("locus", campaign, "--out", folder / "out")
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture
def place(located, tmp_path):
    """A copy to spoil."""
    shutil.copytree(located, tmp_path / "here")
    return tmp_path / "here"


def test_unchanged_results_and_inputs(place):
    result = tpjb("verify", place / "out")
    assert result.exit_code == 0, result.output
    assert "All results and inputs are the same bytes" in result.stdout


def test_a_changed_table_is_named(place):
    table = place / "out" / "locus.csv"
    table.write_text(table.read_text().replace("0.", "1.", 1))
    result = tpjb("verify", place / "out")
    assert result.exit_code == 3
    assert "locus.csv is not what it was" in result.stdout
    assert "locus.csv" in result.stderr


def test_a_missing_table_is_named(place):
    (place / "out" / "clearance.parquet").unlink()
    result = tpjb("verify", place / "out")
    assert result.exit_code == 3
    assert "clearance.parquet is missing" in result.stdout


def test_changed_raw_data_are_named(place):
    with (place / "data" / "small.h5").open("ab") as file:
        file.write(b"x")
    result = tpjb("verify", place / "out")
    assert result.exit_code == 3
    assert "input small.h5 is not what it was" in result.stdout


def test_moved_inputs_are_found_where_they_are_said_to_be(place):
    (place / "data").rename(place / "elsewhere")
    result = tpjb("verify", place / "out")
    assert result.exit_code == 2
    assert "--input" in result.stderr
    for given in (place / "elsewhere", place / "elsewhere" / "small.h5"):
        assert tpjb("verify", place / "out", "--input", given).exit_code == 0


def test_results_and_inputs_moved_together_are_found(place, tmp_path):
    place.rename(tmp_path / "there")
    assert tpjb("verify", tmp_path / "there" / "out").exit_code == 0


@pytest.mark.parametrize("text", ["", "{}", "[" * 5000, '{"schema": "tpjb-run/1", "commands": []}'])
def test_without_a_record_nothing_can_be_said(place, text):
    (place / "out" / "run.json").write_text(text)
    result = tpjb("verify", place / "out")
    assert result.exit_code == 2
    assert "run.json" in result.stderr


def test_a_folder_that_a_kill_left_half_moved(place):
    (place / "out" / READY).mkdir()
    result = tpjb("verify", place / "out")
    assert result.exit_code == 3
    assert "killed" in result.stderr


def test_a_record_of_a_stranger_cannot_send_us_out_of_the_folder(place):
    record = json.loads((place / "out" / "run.json").read_text())
    record["commands"]["locus"]["inputs_sha256"] = {"../../../../../../etc/passwd": "0" * 64}
    record["commands"]["locus"]["outputs"] = ["/etc/passwd"]
    record["commands"]["locus"]["outputs_sha256"] = {"/etc/passwd": "0" * 64}
    record["commands"]["x"] = {"outputs": 5, "inputs_sha256": [1], "inputs_at": {"a": 7}, "versions": "no"}
    (place / "out" / "run.json").write_text(json.dumps(record))
    result = tpjb("verify", place / "out")
    assert result.exit_code == 3
    assert "/etc/passwd is missing" in result.stdout
    assert "etc/passwd is not where it was" in result.stdout


def test_another_version_is_a_note_and_the_answer_can_be_written(place, tmp_path):
    record = json.loads((place / "out" / "run.json").read_text())
    record["commands"]["locus"]["versions"]["numpy"] = "1.0"
    (place / "out" / "run.json").write_text(json.dumps(record))
    result = tpjb("verify", place / "out", "--out", tmp_path / "answer")
    assert result.exit_code == 0
    assert "computed with numpy 1.0" in result.stderr
    answer = json.loads((tmp_path / "answer" / "verify.json").read_text())
    assert {f["state"] for f in answer["files"]} == {"same"}
    assert {f["role"] for f in answer["files"]} == {"result", "input"}
