"""Every command begins with its verdict and ends with the command that comes next, typed out with real paths."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.command_line import tpjb
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.commands.app import app
from tpjb_ident.cli.options import ROCKER
from tpjb_ident.cli.terminal import with_half
from tpjb_ident.errors import NotTrustedError

ROOT = Path(__file__).parents[2]
LINES = re.findall(r"^tpjb .*", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
#: Commands of the README that others run (the demo from the wheel, the recovery tests); `plan` is run more shortly.
RUN_ELSEWHERE = ("compare", "diagnose", "view")
SHORT = {"plan": ("plan", ROCKER, "--load", "5 kN", "--excitation", "25 Hz", "--locus", "0")}
#: What the first line says.
VERDICTS = {
    "check": "errors",
    "show": "channels, none dead",
    "pivot": "pads with dry tests have a pivot curve",
    "locus": "is measured",
    "identify": "to be trusted",
    "predict": "all converged",
    "plan": "would be seen",
}


@pytest.mark.slow
def test_the_readme_s_commands_run_and_say_first_the_verdict_and_last_the_next_command(desk, monkeypatch):
    monkeypatch.chdir(desk)
    lines = [shlex.split(line, comments=True)[1:] for line in LINES]
    run = [SHORT.get(words[0], words) for words in lines if words and words[0] not in RUN_ELSEWHERE]
    assert {words[0] for words in run} >= set(VERDICTS)
    for words in run:
        result = tpjb(*words)
        assert result.exit_code == 0, f"{words}\n{result.output}"
        if words[0] in VERDICTS:
            first, *_, last = result.stdout.strip().splitlines()
            assert VERDICTS[words[0]] in first
            program, command, *arguments = shlex.split(last.removeprefix("Next: "))
            assert (program, command in {c.name for c in app.registered_commands}) == ("tpjb", True)
            assert words[1] in arguments or f"tpjb-{words[0]}-out" in arguments


@pytest.mark.slow
def test_of_a_watch_and_of_a_page_as_well(tmp_path):
    folder = tmp_path / "here"
    result = tpjb("simulate", ROCKER, "--plan", "short", "--load", "5 kN", "--format", "csv", "--out", folder)
    assert result.exit_code == 0, result.output
    campaign = folder / "campaign"
    watched = tpjb("watch", campaign, "--once", "--settle", "0 s", "--out", tmp_path / "o").stdout.strip().splitlines()
    assert watched[0] == "virtual: 22 of 22 runs landed, 0 to be repeated, 0 to look at."
    assert watched[-1] == f"Next: tpjb check {campaign}"
    shown = tpjb("view", tmp_path / "o", "--no-browser", "--seconds", "0.2").stdout.strip().splitlines()
    assert shown[-1] == f"Next: tpjb verify {tmp_path / 'o'}"


@pytest.mark.slow
def test_after_a_prediction_without_answer_comes_one_that_may_have_it(tmp_path):
    result = tpjb("predict", ROCKER, "--load", "500 kN", "--out", tmp_path / "o")
    assert result.exit_code == 3
    expected = ["Next:", "tpjb", "predict", ROCKER, "--load", "500 kN", "--speed", "22 Hz"]
    assert shlex.split(result.stdout.strip().splitlines()[-1]) == [
        *expected, "--pivots", "rigid", "--thermal", "isothermal",
    ]  # fmt: skip


def test_after_a_result_that_is_not_to_be_trusted_the_records_are_checked(tmp_path, capsys):
    def untrusted(c):
        c.next("compare", "somewhere")
        c._sources.append(tmp_path)
        raise NotTrustedError("no run is usable")

    c = Command("identify", {})
    assert c.run(untrusted, {}) == 3
    assert capsys.readouterr().out.splitlines()[-1] == shlex.join(["Next:", "tpjb", "check", str(tmp_path)])


def test_no_answer_has_no_interval():
    assert with_half(float("nan"), 1.0) == "no answer"
    assert with_half(0.0, float("nan")) == "no answer"
    assert with_half(0.0, 1.0) == "0 ±1"
