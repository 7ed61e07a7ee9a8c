"""The command line in this process, for tests that are not about its start-up."""

import contextlib
import functools
import os
from collections.abc import Iterator
from typing import Any
from unittest import mock

import typer.testing

from tpjb_ident.cli.commands.app import app

# typer builds all commands anew for every call, which takes longer than most calls that are tested; where a version has
# no such function, tests only take longer
if (builder := getattr(typer.testing, "_get_command", None)) is not None:
    typer.testing._get_command = functools.cache(builder)


#: Commands that draw, which need the pictures' module anyway.
DRAWING = ("show", "pivot", "locus", "compare", "demo", "diagnose", "plan", "watch", "rerun")


@contextlib.contextmanager
def coarse_pictures() -> Iterator[None]:
    """Pictures of a quarter of the resolution, for tests that do not look at them: a third of a report's time."""
    from tpjb_ident.report import figure

    with mock.patch.object(figure, "_PNG_DPI", 40):
        yield


def tpjb(*words: Any, app: typer.Typer = app, cores: int = 1, sharp: bool = False) -> Any:
    """Run `tpjb words`, or another program of commands; its output, in long lines, exit code and exception.

    One core, unless more are asked for: a job beside the command would load everything once more, and the other core is
    busy with other tests. Pictures are coarse unless they are to be `sharp`.
    """
    coarse = coarse_pictures() if words[0] in DRAWING and not sharp else contextlib.nullcontext()
    with coarse, mock.patch.object(os, "sched_getaffinity", return_value=set(range(cores)), create=True):
        return typer.testing.CliRunner(env={"COLUMNS": "400"}).invoke(app, [str(word) for word in words])


def ended(code: int, *words: Any) -> Any:
    """Run `tpjb words`, which has to end with this exit code; what `tpjb` gives."""
    result = tpjb(*words)
    assert result.exit_code == code, f"tpjb {' '.join(map(str, words))}: ended with {result.exit_code}\n{result.output}"
    return result
