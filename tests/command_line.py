"""The command line in this process, for tests that are not about its start-up."""

import functools
import os
from typing import Any
from unittest import mock

import typer.testing

from tpjb_ident.cli.commands.app import app

# typer builds all commands anew for every call, which takes longer than most calls that are tested; where a version has
# no such function, tests only take longer
if (builder := getattr(typer.testing, "_get_command", None)) is not None:
    typer.testing._get_command = functools.cache(builder)


def tpjb(*words: Any, app: typer.Typer = app, cores: int = 1) -> Any:
    """Run `tpjb words`, or another program of commands; its output, in long lines, exit code and exception.

    One core, unless more are asked for: a job beside the command would load everything once more, and the other core is
    busy with other tests.
    """
    with mock.patch.object(os, "sched_getaffinity", return_value=set(range(cores)), create=True):
        return typer.testing.CliRunner(env={"COLUMNS": "400"}).invoke(app, [str(word) for word in words])


def ended(code: int, *words: Any) -> Any:
    """Run `tpjb words`, which has to end with this exit code; what `tpjb` gives."""
    result = tpjb(*words)
    assert result.exit_code == code, f"tpjb {' '.join(map(str, words))}: ended with {result.exit_code}\n{result.output}"
    return result
