"""`tpjb rerun`: the same computed again with the options and inputs of run.json; what differs is named by its place."""

import json
import shutil

import pytest

from tests.command_line import ended, tpjb
from tpjb_ident.runtime.differences import compared

HEAD = "static_load_N,kxx_N_per_m,kxx_N_per_m_lo,kxx_N_per_m_hi,quality"


@pytest.fixture(scope="module")
def original(small_campaign, tmp_path_factory):
    """Results of two commands in one folder beside their campaign."""
    folder = tmp_path_factory.mktemp("rerun")
    campaign = shutil.copy(small_campaign, folder / "campaign.h5")
    campaign.chmod(0o644)
    for command in ("locus", "check"):
        assert tpjb(command, campaign, "--out", folder / "out", "-q").exit_code == 0
    return folder


@pytest.fixture
def results(original, tmp_path):
    shutil.copytree(original, tmp_path / "copy")
    return tmp_path / "copy" / "out"


def edited(results, change):
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    change(record)
    (results / "run.json").write_text(json.dumps(record), encoding="utf-8")


def plain(result) -> str:
    return " ".join(result.output.split())


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
    campaign = results.parent / "campaign.h5"
    with campaign.open("ab") as file:
        file.write(b"x")
    result = tpjb("rerun", results)
    assert (result.exit_code, "campaign.h5 of locus is not what it was" in plain(result)) == (2, True)
    campaign.unlink()
    result = tpjb("rerun", results)
    assert (result.exit_code, "is missing" in plain(result)) == (2, True)


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
