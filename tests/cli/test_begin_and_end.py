"""How a command begins and ends: Ctrl-C is heard, the verdict comes first, the next command last.

Every end is a result, one message, or a named bug.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from rigdata.problem import Problem, RigDataError
from tests.command_line import ended, tpjb
from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.commands.app import app
from tpjb_ident.cli.options import ROCKER
from tpjb_ident.errors import BadInputError, NotTrustedError


def run(error):
    program = typer.Typer()

    @program.command()
    @command()
    def fail(c: Command) -> None:
        raise error

    return CliRunner().invoke(program, [])


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (BadInputError("--load: is empty."), 2, "error: --load: is empty."),
        (NotTrustedError("the mesh"), 3, "not to be trusted: the mesh"),
        (RigDataError(Problem("error", "a.csv", "line 7", "is short", "Cut it")), 2, "a.csv, line 7: is short. Cut it"),
        (FileNotFoundError(2, "No such file or directory", "x.toml"), 2, "x.toml: No such file or directory"),
        (PermissionError(13, "Permission denied", "/root/x"), 2, "/root/x: Permission denied"),
        (OSError(28, "No space left on device"), 2, "No space left on device"),
        (MemoryError(), 2, "not enough memory"),
        (ImportError("another package named 'model' hides"), 2, "named 'model'"),
        (KeyboardInterrupt(), 130, "no results were written"),
    ],
)
def test_codes_and_messages(error, code, says):
    result = run(error)
    assert result.exit_code == code
    assert says in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.parametrize("error", [ZeroDivisionError("x"), ValueError("plain"), KeyError("k"), OSError("odd")])
def test_a_bug_says_so_and_where_the_traceback_lies(error):
    result = run(error)
    assert result.exit_code == 1
    assert "a fault of tpjb-ident" in result.stderr
    assert "Traceback" not in result.output
    file = Path(re.search(r"traceback in (\S+)", result.stderr)[1])
    assert type(error).__name__ in file.read_text(encoding="utf-8")
    file.unlink()


def test_control_characters_are_not_passed_on_and_markup_is_text():
    errors = run(BadInputError("[red]run[/red] \x1b]0;owned\x07 \x9b31m \u202e")).stderr
    assert "[red]run[/red]" in errors
    assert not {"\x1b", "\x07", "\x9b", "\u202e"} & set(errors)


SCRIPT = """
import os, signal, sys, time, weakref
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background of a shell has interrupts ignored
signal.signal(signal.SIGALRM, signal.SIG_IGN)  # as some parents leave it
from tpjb_ident.runtime import interrupts

class Lock:
    "Stands in for a lock of the import machinery, whose end calls back."

def signalled(_):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)

def in_a_callback():
    lock = Lock()
    watched = weakref.ref(lock, signalled)
    del lock

def swallowed():
    try:
        signalled(None)
    except BaseException:
        pass

interrupts.listen()
try:
    PLACE()
    print("dropped", flush=True)
    time.sleep(50)
    print("not delivered")
except KeyboardInterrupt:
    time.sleep(1)  # what is being cleared away is not interrupted again
    interrupts.heard()
    print("heard", flush=True)
time.sleep(0.5)
print("once")
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("place", [pytest.param("in_a_callback", marks=pytest.mark.slow), "swallowed"])
def test_an_interrupt_that_is_dropped_is_delivered_again(place):
    script = SCRIPT.replace("PLACE", place)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.split("\n")[:3] == ["dropped", "heard", "once"]
    assert done.stderr == ""


def test_other_lost_exceptions_are_still_shown():
    script = SCRIPT.replace("os.kill(os.getpid(), signal.SIGINT)", "raise ValueError('shown')")
    script = script.replace("PLACE", "in_a_callback").replace("time.sleep(50)", "")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True)
    assert "ValueError: shown" in done.stderr


CODE = """import os
from tpjb_ident import cli
cli._one_thread_for_small_matrices()
print(os.environ["OMP_NUM_THREADS"])"""


@pytest.mark.parametrize(("given", "used"), [(None, "1"), ("4", "4")])
def test_one_thread_unless_told(given, used):
    kept = {k: v for k, v in os.environ.items() if k != "OMP_NUM_THREADS"}
    env = kept if given is None else {**kept, "OMP_NUM_THREADS": given}
    done = subprocess.run([sys.executable, "-c", CODE], env=env, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == used


ROOT = Path(__file__).parents[2]
LINES = re.findall(r"^tpjb .*", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
#: Commands of the README that others run: the demo from the wheel, the recovery tests, the plan of a thin campaign.
RUN_ELSEWHERE = ("compare", "diagnose", "view", "plan")
#: What the first line says.
VERDICTS = {
    "check": "errors",
    "show": "channels, none dead",
    "pivot": "pads with dry tests have a pivot curve",
    "locus": "is measured",
    "identify": "to be trusted",
    "predict": "all converged",
}


@pytest.mark.slow
def test_the_readme_s_commands_run_and_say_first_the_verdict_and_last_the_next_command(desk, monkeypatch):
    monkeypatch.chdir(desk)
    lines = [shlex.split(line, comments=True)[1:] for line in LINES]
    run = [words for words in lines if words and words[0] not in RUN_ELSEWHERE]
    assert {words[0] for words in run} >= set(VERDICTS)
    for words in run:
        result = ended(0, *words)
        if words[0] in VERDICTS:
            first, *_, last = result.stdout.strip().splitlines()
            assert VERDICTS[words[0]] in first
            program, command, *arguments = shlex.split(last.removeprefix("Next: "))
            assert (program, command in {c.name for c in app.registered_commands}) == ("tpjb", True)
            assert words[1] in arguments or f"tpjb-{words[0]}-out" in arguments


@pytest.mark.slow
def test_of_a_watch_and_of_a_page_as_well(tmp_path):
    folder = tmp_path / "here"
    ended(0, "simulate", ROCKER, "--plan", "short", "--load", "5 kN", "--format", "csv", "--out", folder)
    campaign = folder / "campaign"
    watched = tpjb("watch", campaign, "--once", "--settle", "0 s", "--out", tmp_path / "o").stdout.strip().splitlines()
    assert watched[0] == "virtual: 22 of 22 runs landed, 0 to be repeated, 0 to look at."
    assert watched[-1] == f"Next: tpjb check {campaign}"
    shown = tpjb("view", tmp_path / "o", "--no-browser", "--seconds", "0.2").stdout.strip().splitlines()
    assert shown[-1] == f"Next: tpjb verify {tmp_path / 'o'}"


@pytest.mark.slow
def test_after_a_prediction_without_answer_comes_one_that_may_have_it(tmp_path):
    result = ended(3, "predict", ROCKER, "--load", "500 kN", "--out", tmp_path / "o")
    expected = ["Next:", "tpjb", "predict", ROCKER, "--load", "500 kN", "--speed", "22 Hz"]
    assert shlex.split(result.stdout.strip().splitlines()[-1]) == [
        *expected, "--pivots", "rigid", "--thermal", "isothermal",
    ]  # fmt: skip
