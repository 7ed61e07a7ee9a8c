"""`tpjb verify` and `tpjb rerun`: what run.json says of results. Unchanged, changed, missing, moved: each has its words
and its exit code; the same is computed again with the recorded options and inputs, what differs is named by its place.
"""

import json
import shutil

import pytest

from tests.command_line import ended, tpjb
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.commands.verify import files_of
from tpjb_ident.runtime.differences import compared
from tpjb_ident.runtime.output_folder import READY

HEAD = "static_load_N,kxx_N_per_m,kxx_N_per_m_lo,kxx_N_per_m_hi,quality"


@pytest.fixture(scope="module")
def original(small_campaign, tmp_path_factory):
    """Results of two commands in one folder, their campaign beside it."""
    folder = tmp_path_factory.mktemp("original")
    (folder / "data").mkdir()
    campaign = shutil.copy(small_campaign, folder / "data" / "campaign.h5")
    campaign.chmod(0o644)
    for command in ("locus", "check"):
        ended(0, command, campaign, "--out", folder / "out", "-q")
    return folder


@pytest.fixture
def place(original, tmp_path):
    """A copy to spoil."""
    return shutil.copytree(original, tmp_path / "here")


@pytest.fixture
def results(place):
    return place / "out"


def edited(results, change):
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    change(record)
    (results / "run.json").write_text(json.dumps(record), encoding="utf-8")


def plain(result) -> str:
    return " ".join(result.output.split())


def changed_table(place):
    table = place / "out" / "locus.csv"
    table.write_text(table.read_text().replace("0.", "1.", 1))


def changed_records(place):
    with (place / "data" / "campaign.h5").open("ab") as file:
        file.write(b"x")


@pytest.mark.parametrize(
    ("spoil", "code", "says"),
    [
        (lambda place: None, 0, "all results and inputs are the same bytes"),
        (changed_table, 3, "locus.csv is not what it was"),
        (lambda place: (place / "out" / "clearance.parquet").unlink(), 3, "clearance.parquet is missing"),
        (changed_records, 3, "input campaign.h5 is not what it was"),
        (lambda place: (place / "out" / READY).mkdir(), 3, "a command was killed"),
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
    for given in (place / "elsewhere", place / "elsewhere" / "campaign.h5"):
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
    strange = {"inputs_sha256": {"../../../../../../etc/passwd": "0" * 64}, "outputs": ["/etc/passwd"]}
    strange["outputs_sha256"] = {"/etc/passwd": "0" * 64}

    def change(record):
        record["commands"]["locus"] |= strange
        record["commands"]["x"] = {"outputs": 5, "inputs_sha256": [1], "inputs_at": {"a": 7}, "versions": "no"}

    edited(place / "out", change)
    result = ended(3, "verify", place / "out")
    assert "/etc/passwd is missing" in result.stdout
    assert "input ../../../../../../etc/passwd is missing" in result.stdout


def test_another_version_is_a_note_and_the_answer_can_be_written(place, tmp_path):
    edited(place / "out", lambda record: record["commands"]["locus"]["versions"].update(numpy="1.0"))
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


@pytest.mark.slow
def test_the_same_comes_out_again_and_nothing_is_written_beside_it(results, tmp_path):
    before = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    result = ended(0, "rerun", results / "run.json", "--out", tmp_path / "again")
    assert "nothing differs by more than 1e-06" in plain(result)
    listed = json.loads((tmp_path / "again" / "rerun.json").read_text(encoding="utf-8"))
    assert listed["schema"] == "tpjb-rerun/1"
    assert {file["state"] for file in listed["files"]} == {"same"}
    assert {path: path.read_bytes() for path in results.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_a_number_that_does_not_come_out_again_is_named_with_its_place(results):
    path = results / "clearance.csv"
    head, first, *others = path.read_text(encoding="utf-8").splitlines()
    cells = first.split(",")
    column = head.split(",").index("clearance_m")
    cells[column] = str(float(cells[column]) * 1.001)
    path.write_text("\n".join([head, ",".join(cells), *others]) + "\n", encoding="utf-8")
    result = ended(3, "rerun", results)
    assert "clearance.csv differs row 1.clearance_m" in plain(result)
    assert "is not what was computed" in plain(result)
    assert tpjb("rerun", results, "--tolerance", "0.01").exit_code == 0


@pytest.mark.slow
def test_an_input_that_is_gone_or_changed_is_named(results):
    changed_records(results.parent)
    assert "campaign.h5 of locus is not what it was" in plain(ended(2, "rerun", results))
    (results.parent / "data" / "campaign.h5").unlink()
    assert "is missing" in plain(ended(2, "rerun", results))


@pytest.mark.slow
def test_a_record_of_the_first_version_is_repeated_by_its_settings(results):
    def to_first(record):
        record["schema"] = "tpjb-run/1"
        for entry in record["commands"].values():
            del entry["options"], entry["tables"]

    edited(results, to_first)
    assert tpjb("rerun", results).exit_code == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "exit_code", "message"),
    [
        ({"out": "/tpjb-elsewhere", "scheduler": "tcp://192.0.2.1:1", "workers": 99, "as_json": True}, 0, ""),
        ({"campaign": ["a", "b"]}, 0, ""),  # its place counts
        ({"no_such_option": 1}, 0, ""),
        ("none", 2, "names no options"),
    ],
)
def test_a_record_from_elsewhere_decides_neither_where_to_write_nor_whom_to_ask(results, options, exit_code, message):
    def change(record):
        del record["commands"]["check"]
        entry = record["commands"]["locus"]
        entry["options"] = {**entry["options"], **options} if isinstance(options, dict) else options

    edited(results, change)
    result = ended(exit_code, "rerun", results)
    assert message in plain(result)


@pytest.mark.parametrize("record", ["none.json", "coefficients.csv"])
def test_what_is_no_record_is_refused(tmp_path, record):
    ended(2, "rerun", tmp_path / record)
    (tmp_path / "run.json").write_text('{"schema": "tpjb-run/1", "commands": {"watch": {}}}', encoding="utf-8")
    assert "names no command that can be repeated" in plain(tpjb("rerun", tmp_path))


def pair(tmp_path, name, first, second):
    for folder, text in (("a", first), ("b", second)):
        (tmp_path / folder).mkdir(exist_ok=True)
        if text is not None:
            (tmp_path / folder / name).write_text(text, encoding="utf-8")
    return compared(tmp_path / "a", tmp_path / "b", name, 1e-6)


@pytest.mark.parametrize(
    ("name", "first", "second", "state"),
    [
        ("coefficients.csv", f"{HEAD}\n5,1e8,9e7,1.1e8,ok\n", f"{HEAD}\n5.0,1e8,9e7,1.1e8,ok\n", "numbers"),
        ("coefficients.csv", f"{HEAD}\n5,1e8,9e7,1.1e8,ok\n", f"{HEAD}\n5,100000001,9e7,1.1e8,ok\n", "numbers"),
        ("coefficients.csv", f"{HEAD}\n5,1e8,9e7,1.1e8,ok\n", f"{HEAD}\n5,1.0001e8,9e7,1.1e8,ok\n", "differs"),
        # a small number with a wide interval is held against the interval
        ("coefficients.csv", f"{HEAD}\n5,1,-1e8,1e8,ok\n", f"{HEAD}\n5,2,-1e8,1e8,ok\n", "numbers"),
        ("coefficients.csv", f"{HEAD}\n5,1,,,ok\n", f"{HEAD}\n5,2,,,ok\n", "differs"),
        ("coefficients.csv", f"{HEAD}\n5,,,,ok\n", f"{HEAD}\n5.0,,,,ok\n", "numbers"),
        ("coefficients.csv", f"{HEAD}\n5,1,,,ok\n", f"{HEAD}\n5,,,,ok\n", "differs"),
        ("coefficients.csv", f"{HEAD}\n5,1,,,ok\n", f"{HEAD}\n5,1,,,biased\n", "differs"),
        ("coefficients.csv", f"{HEAD}\n5,1,,,ok\n", f"{HEAD}\n", "differs"),
        ("check.json", '{"ok": true, "n": [1.0, 2]}', '{"n": [1.0000000001, 2], "ok": true}', "numbers"),
        ("check.json", '{"ok": true}', '{"ok": 1}', "differs"),
        ("check.json", '{"a": 1}', '{"b": 1}', "differs"),
        ("pivots.toml", "a = 1.0\n", "a  = 1.0\n", "numbers"),
        ("report.html", "<p>a", "<p>b", "not judged"),
        ("report.html", "<p>a", None, "missing"),
        ("report.html", None, "<p>a", "new"),
    ],
)
def test_numbers_are_compared_by_size_and_texts_as_texts(tmp_path, name, first, second, state):
    difference = pair(tmp_path, name, first, second)
    assert difference.state == state
    assert difference.matters == (state in ("differs", "missing", "new"))


def test_what_should_be_zero_differs_by_rounding(tmp_path):
    head = "static_load_N,x_m,y_m"
    rounded = pair(tmp_path, "locus.csv", f"{head}\n5000,6.4e-20,-4.2e-5\n", f"{head}\n5000,1.8e-19,-4.2e-5\n")
    assert rounded.state == "numbers"
    moved = pair(tmp_path, "locus.csv", f"{head}\n5000,6.4e-20,-4.2e-5\n", f"{head}\n5000,1e-9,-4.2e-5\n")
    assert moved.state == "differs"
    assert moved.where == "row 1.x_m: 6.4e-20, now 1e-09"
