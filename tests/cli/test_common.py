"""What all commands share: --json, --quiet, examples, completion, hints; and the commands init and show."""

import json
import os
import shlex
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from rigdata.operating_point import ROTATIONS
from tests.cli.test_init import record
from tests.command_line import ended, tpjb
from tpjb_ident.cli.commands.app import app
from tpjb_ident.cli.commands.show import BARS, sparkline
from tpjb_ident.cli.options import choices
from tpjb_ident.estimators.estimate import METHODS, NORMS
from tpjb_ident.exports.formats import FORMATS

#: Every command, with its examples.
EXAMPLES = {info.name: info.callback.examples for info in app.registered_commands}


def test_json_is_one_document_with_the_results_in_it(small_campaign, tmp_path):
    def refuse(constant):  # NaN is no JSON
        raise AssertionError(constant)

    result = ended(0, "locus", small_campaign, "--out", tmp_path / "o", "--json")
    document = json.loads(result.stdout, parse_constant=refuse)
    assert document["schema"] == "tpjb-command/1"
    assert (document["command"], document["exit_code"]) == ("locus", 0)
    assert "locus.csv" in document["outputs"]
    rows = document["data"]["locus"]
    assert len(rows) == 3
    assert abs(rows[0]["x_m"]) < 1e-3
    assert document["tables"]
    assert document["said"]


def test_json_of_a_failure_names_it_and_keeps_the_exit_code(tmp_path):
    result = ended(2, "identify", tmp_path / "nothing.h5", "--json")
    document = json.loads(result.stdout)
    assert document["exit_code"] == 2
    assert document["remarks"][-1]["kind"] == "error"
    assert "no such file" in document["remarks"][-1]["text"]
    assert "no such file" in result.stderr


@pytest.mark.slow
def test_quiet_says_nothing_when_all_is_well_and_errors_when_not(small_campaign, tmp_path):
    result = ended(0, "locus", small_campaign, "--out", tmp_path / "o", "--quiet")
    assert result.stdout == ""
    assert "doing" not in result.stderr
    assert (tmp_path / "o" / "locus.csv").exists()
    assert "no such file" in tpjb("locus", tmp_path / "x.h5", "-q").stderr


@pytest.mark.parametrize("command", sorted(EXAMPLES))
def test_every_command_takes_the_common_options_and_shows_examples_with_options_that_exist(command):
    text = ended(0, command, "--help").stdout
    for option in ("--json", "--quiet", "--out"):
        assert option in text
    assert EXAMPLES[command]
    for line in EXAMPLES[command]:
        assert line in text.replace("\n    ", "\n")
        first, second, *rest = shlex.split(line.partition(" > ")[0])
        assert (first, second) == ("tpjb", command)
        assert [word for word in rest if word.startswith("--") and word not in text] == []


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("identfy", "identify"),
        ("digagnose", "diagnose"),
        ("compear", "compare"),
        ("shwo", "show"),
        ("predct", "predict"),
        ("identify x.h5 --metod ols", "--method"),
        ("predict x.toml --lod 1kN", "--load"),
    ],
)
def test_a_mistyped_command_or_option_is_answered_with_the_nearest(typed, meant):
    result = ended(2, *typed.split())
    assert meant in result.stderr


@pytest.mark.parametrize(
    ("typed", "fault"),
    [
        ("predict x.toml --lood 4", "--lood"),
        ("simulate x.toml --seed -1", "'--seed'"),
        ("plan x.toml --locus 2.5", "'--locus'"),
        ("predict x.toml --load 1kN --load 2kN", "--load: 2 times. Give it once"),
    ],
)
def test_words_that_cannot_be_read_end_as_other_errors_do(typed, fault):
    result = ended(2, *typed.split(), "--json")
    document = json.loads(result.stdout)
    (remark,) = document["remarks"]
    assert (document["command"], document["exit_code"]) == (typed.split()[0], 2)
    assert fault in remark["text"]
    assert f"`tpjb {document['command']} -h` tells" in remark["text"]
    assert f"tpjb: error: {remark['text']}" in result.stderr


def test_a_flag_twice_and_a_repeatable_option_are_no_mistake():
    words = ("--fault", "dead channel=X1A", "--fault", "dead channel=Y1A", "-q", "-q")
    assert "no such file" in ended(2, "simulate", "x.toml", *words).stderr


def asked_by_shell(what: str, **environment: str) -> str:
    """What the program says to a shell that asks for completion, in this process."""
    result = CliRunner().invoke(app, [], env={"_TPJB_COMPLETE": what, **environment}, prog_name="tpjb")
    return result.stdout


def words_typed(words: str) -> dict[str, str]:
    return {"COMP_WORDS": words, "COMP_CWORD": str(len(words.split(" ")) - 1)}


def complete(words: str) -> list[str]:
    return asked_by_shell("complete_bash", **words_typed(words)).split()


@pytest.mark.slow
def test_the_shell_completes_commands_options_and_values():
    # once as the shell itself does it
    environment = {**os.environ, "_TPJB_COMPLETE": "complete_bash", **words_typed("tpjb iden")}
    code = "from tpjb_ident.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.stdout.split() == complete("tpjb iden") == ["identify"]
    assert "--method" in complete("tpjb identify --me")
    assert complete("tpjb identify --method mm") == ["mm-eiv", "mm"]
    assert complete("tpjb predict --thermal te") == ["tehd"]


@pytest.mark.parametrize(
    ("option", "known"), [("method", METHODS), ("norm", NORMS), ("rotation", ROTATIONS), ("to", FORMATS)]
)
def test_the_table_of_options_completes_what_is_known(option, known):
    assert choices(option)
    assert set(choices(option)) <= set(known)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_can_be_shown(shell):
    assert "_TPJB_COMPLETE" in asked_by_shell(f"source_{shell}")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a").mkdir()
    record(tmp_path / "a" / "test-5kN.csv")
    return tmp_path / "a"


def test_init_never_replaces_a_manifest(folder):
    (folder / "campaign.toml").write_text("mine", encoding="utf-8")
    result = ended(2, "init", folder)
    assert "stays as it is" in result.stderr
    assert (folder / "campaign.toml").read_text(encoding="utf-8") == "mine"


def test_init_with_out_leaves_the_records_folder_alone(folder, tmp_path):
    before = sorted(p.name for p in folder.iterdir())
    assert tpjb("init", folder, "--out", tmp_path / "draft").exit_code == 0
    assert sorted(p.name for p in folder.iterdir()) == before
    assert (tmp_path / "draft" / "campaign.toml").exists()


def test_init_leaves_out_what_it_cannot_read_and_says_so(folder):
    (folder / "letter.txt").write_text("Dear Sir,\n", encoding="utf-8")
    result = ended(0, "init", folder)
    assert "letter.txt" in result.stderr


def test_init_of_nothing(tmp_path):
    assert "holds no records" in tpjb("init", tmp_path).stderr
    assert "is no folder" in tpjb("init", tmp_path / "x").stderr


@pytest.mark.slow
def test_show_lists_runs_and_channels(small_campaign):
    lines = tpjb("show", small_campaign).stdout.strip().splitlines()
    assert "runs" in lines[0]
    assert lines[-1] == f"Next: tpjb check {small_campaign}"
    (line,) = (line for line in lines[:-1] if "d-02500-25-01" in line)
    assert line.split()[-2:] == ["-", "counter-clockwise"]
    shown = tpjb("show", small_campaign, "--run", "d-02500-25-01").stdout
    assert "X1A" in shown
    assert "25" in shown
    assert any(bar in shown for bar in BARS[1:])


def test_show_answers_a_wrong_run_with_the_nearest(small_campaign):
    result = ended(2, "show", small_campaign, "--run", "d-2500-25-01")
    assert "Did you mean 'd-02500-25-01'" in result.stderr


@pytest.mark.slow
def test_show_of_a_lone_file_draws_a_picture(folder, tmp_path):
    ended(0, "show", folder / "test-5kN.csv", "--picture", "--out", tmp_path / "o")
    assert (tmp_path / "o" / "figures" / "quick-look.png").stat().st_size > 5000
    assert (tmp_path / "o" / "channels.csv").exists()


def test_show_writes_nothing_unless_asked(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert tpjb("show", folder / "test-5kN.csv").exit_code == 0
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("values", [[], [0.0, 0.0], [float("nan")], [1.0], [1.0, 1e-9, float("inf")]])
def test_a_sparkline_of_anything(values):
    assert len(sparkline(values)) == len(values)


def test_a_sparkline_keeps_peaks_when_cells_are_few():
    values = [1.0] * 500
    values[250] = 1000.0
    drawn = sparkline(values, width=10)
    assert drawn.index("█") == 5
