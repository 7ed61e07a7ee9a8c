"""Every end of a command is a result, one message, or a named bug."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from rigdata.problem import Problem, RigDataError
from tpjb_ident.cli.command import Command, command
from tpjb_ident.errors import BadInputError, NotTrustedError


def run(error):
    @command()
    def fail(c: Command) -> None:
        raise error

    return result_of(fail)


def result_of(function):
    app = typer.Typer()
    app.command()(function)
    return CliRunner().invoke(app, [])


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
        (KeyboardInterrupt(), 130, "nothing was written"),
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


def test_terminal_control_characters_are_not_passed_on():
    result = run(BadInputError("run \x1b]0;owned\x07 \x9b31m \u202e"))
    assert "\x1b]" not in result.stderr
    assert "\x07" not in result.stderr
    assert "\u202e" not in result.stderr


def test_markup_in_messages_is_text():
    assert "[red]x[/red]" in run(BadInputError("[red]x[/red]")).stderr


def test_warnings_are_shown_not_swallowed():
    @command()
    def warn(c: Command) -> None:
        warnings.simplefilter("always")
        warnings.warn("something odd", RuntimeWarning, stacklevel=1)

    result = result_of(warn)
    assert result.exit_code == 0
    assert "RuntimeWarning: something odd" in result.stderr
