"""`tpjb verify`: unchanged, changed, missing, moved: each has its words and its exit code."""

import json
import shutil

import pytest

from tests.command_line import ended, tpjb
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.commands.verify import files_of
from tpjb_ident.runtime.output_folder import READY


@pytest.fixture(scope="module")
def located(tmp_path_factory, small_campaign):
    """Campaign and the results of `tpjb locus` on it."""
    folder = tmp_path_factory.mktemp("verify")
    campaign = folder / "data" / "small.h5"
    campaign.parent.mkdir()
    shutil.copy(small_campaign, campaign)
    ended(0, "locus", campaign, "--out", folder / "out")
    return folder


@pytest.fixture
def place(located, tmp_path):
    """A copy to spoil."""
    shutil.copytree(located, tmp_path / "here")
    return tmp_path / "here"


def changed_table(place):
    table = place / "out" / "locus.csv"
    table.write_text(table.read_text().replace("0.", "1.", 1))


def missing_table(place):
    (place / "out" / "clearance.parquet").unlink()


def changed_records(place):
    with (place / "data" / "small.h5").open("ab") as file:
        file.write(b"x")


def half_moved(place):
    (place / "out" / READY).mkdir()


@pytest.mark.parametrize(
    ("spoil", "code", "says"),
    [
        (lambda place: None, 0, "all results and inputs are the same bytes"),
        (changed_table, 3, "locus.csv is not what it was"),
        (missing_table, 3, "clearance.parquet is missing"),
        (changed_records, 3, "input small.h5 is not what it was"),
        (half_moved, 3, "a command was killed"),
    ],
)
def test_each_state_has_its_words_and_its_exit_code(place, spoil, code, says):
    spoil(place)
    result = ended(code, "verify", place / "out")
    assert says in result.output
    if spoil is changed_table:
        assert "locus.csv" in result.stderr


def test_moved_inputs_are_found_where_they_are_said_to_be(place):
    (place / "data").rename(place / "elsewhere")
    result = ended(2, "verify", place / "out")
    assert "--input" in result.stderr
    for given in (place / "elsewhere", place / "elsewhere" / "small.h5"):
        assert tpjb("verify", place / "out", "--input", given).exit_code == 0


def test_results_and_inputs_moved_together_are_found(place, tmp_path):
    place.rename(tmp_path / "there")
    assert tpjb("verify", tmp_path / "there" / "out").exit_code == 0


NOTHING = '{"schema": "tpjb-run/2", "commands": {"locus": {"outputs": []}}}'


@pytest.mark.parametrize("text", ["", "{}", "[" * 5000, '{"schema": "tpjb-run/1", "commands": []}', NOTHING])
def test_without_a_record_nothing_can_be_said(place, text):
    (place / "out" / "run.json").write_text(text)
    result = ended(2, "verify", place / "out")
    assert "run.json" in result.stderr


def test_a_record_of_a_stranger_cannot_send_us_out_of_the_folder(place):
    record = json.loads((place / "out" / "run.json").read_text())
    record["commands"]["locus"]["inputs_sha256"] = {"../../../../../../etc/passwd": "0" * 64}
    record["commands"]["locus"]["outputs"] = ["/etc/passwd"]
    record["commands"]["locus"]["outputs_sha256"] = {"/etc/passwd": "0" * 64}
    record["commands"]["x"] = {"outputs": 5, "inputs_sha256": [1], "inputs_at": {"a": 7}, "versions": "no"}
    (place / "out" / "run.json").write_text(json.dumps(record))
    result = ended(3, "verify", place / "out")
    assert "/etc/passwd is missing" in result.stdout
    assert "input ../../../../../../etc/passwd is missing" in result.stdout


def test_another_version_is_a_note_and_the_answer_can_be_written(place, tmp_path):
    record = json.loads((place / "out" / "run.json").read_text())
    record["commands"]["locus"]["versions"]["numpy"] = "1.0"
    (place / "out" / "run.json").write_text(json.dumps(record))
    result = ended(0, "verify", place / "out", "--out", tmp_path / "answer")
    assert "computed with numpy 1.0" in result.stderr
    answer = json.loads((tmp_path / "answer" / "verify.json").read_text())
    assert {f["state"] for f in answer["files"]} == {"same"}
    assert {f["role"] for f in answer["files"]} == {"result", "input"}


def test_inputs_of_one_name_are_told_apart_by_their_folders(tmp_path):
    command = Command("compare", {}, tmp_path / "out")
    for folder in ("before", "after", "after/again"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "rig.toml").write_text(folder, encoding="utf-8")
        command.file(tmp_path / folder / "rig.toml")
    assert list(command.inputs) == ["rig.toml", "after/rig.toml", "again/rig.toml"]
    paths = {name: f"../{folder}/rig.toml" for name, folder in (("a", "before"), ("b", "after"), ("c", "after/again"))}
    entry = {"inputs_at": paths, "inputs_sha256": command.inputs}
    (tmp_path / "out").mkdir()

    def states():
        return [file["state"] for file in files_of(tmp_path / "out", "compare", entry, ())]

    assert states() == ["same", "same", "same"]
    (tmp_path / "after" / "rig.toml").write_text("changed", encoding="utf-8")
    assert states() == ["same", "differs", "same"]
    (tmp_path / "before" / "rig.toml").write_text("changed", encoding="utf-8")
    assert states() == ["differs", "differs", "same"]
