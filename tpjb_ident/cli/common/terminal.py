"""What the person at the terminal sees: short tables, messages, progress. Results go to stdout, the rest to stderr."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.output import command_output
from tpjb_ident.cli.common.table_layout import table_lines, wrapped
from tpjb_ident.runtime.tables import printable, readable

if TYPE_CHECKING:
    from rich.console import Console

#: Seconds between two lines about progress where there is no terminal.
LINE_EVERY = 30.0
#: Columns of a log file or a pipe.
LOG_WIDTH = 100
#: Rows of a table that are printed where a file has them all.
MOST_ROWS = 40
#: Share of a step from which its speed is known well enough to tell the time left.
FORETELLS = 0.02
#: Called with what is being done, how many are done, of how many.
Progress = Callable[[str, int, int], None]


def _console(stderr: bool = False) -> Console:
    from rich.console import Console

    class Patient(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # `guarded` ends the command well; rich would say 1

    console = Patient(stderr=stderr, highlight=False, soft_wrap=True)
    return console


def width() -> int:
    """Columns that a table may take: the terminal's, or what COLUMNS says, or a log file's."""
    return max(40, shutil.get_terminal_size((LOG_WIDTH, 24)).columns)


def print_line(text: str) -> None:
    """Print one line; text from outside is shown as it is, less its control characters."""
    command_output().sentences.append(printable(text))
    if command_output().silent:
        return
    _console().print(_fitted(text), markup=False)


def _fitted(text: str, stderr: bool = False) -> str:
    """Lines with whole words on a terminal; as they are in a log, which has no edge, and for who searches messages."""
    lines = [readable(line) for line in text.split("\n")]
    if _console(stderr).is_terminal or ("COLUMNS" in os.environ and not stderr):
        lines = [part for line in lines for part in wrapped(line, width())]
    return "\n".join(lines)


def command_line(text: str) -> None:
    """Print a command to type, unbroken, so that it can be copied."""
    line = f"Next: {printable(text)}"
    command_output().sentences.append(line)
    if not command_output().silent:
        _console().print(line, markup=False)


def error_line(kind: str, text: str) -> None:
    """Print a message to stderr, its lines kept."""
    lines = "\n".join(printable(line) for line in text.splitlines())
    command_output().remarks.append({"kind": kind, "text": lines})
    style = "bold red" if kind == "bug" else None
    _console(stderr=True).print(_fitted(f"tpjb: {kind}: {lines}", stderr=True), markup=False, style=style)


def note_line(kind: str, text: str) -> None:
    """Print a remark to stderr; of a quiet command only warnings."""
    if kind != "doing":
        command_output().remarks.append({"kind": kind, "text": printable(text)})
    if command_output().silent and kind != "warning":
        return
    _console(stderr=True).print(_fitted(f"tpjb: {kind}: {printable(text)}", stderr=True), markup=False)


def table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], words: Collection[int] = (0,), whole: str = ""
) -> None:
    """Print a table that fits the terminal; columns of words stand left, numbers right."""
    command_output().tables.append({"title": title, "columns": list(columns), "rows": [list(row) for row in rows]})
    if command_output().silent:
        return
    shown = rows[:MOST_ROWS] if whole else rows
    lines = table_lines([readable(c) for c in columns], [[readable(c) for c in r] for r in shown], words, width())
    for line in ("", printable(title), *lines, ""):
        _console().print(line, markup=False)
    if len(shown) < len(rows):
        _console().print(f"{len(rows) - len(shown)} more rows: {whole} has all {len(rows)}", markup=False)


@contextlib.contextmanager
def progress(what: str) -> Iterator[Progress]:
    """Show a bar with the time left on a terminal while the block runs; elsewhere a line now and then."""
    console = _console(stderr=True)
    if command_output().silent or not console.is_terminal:
        note_line("doing", what)
        yield _Lines(what)
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    text, left = TextColumn("{task.description}", markup=False), TextColumn("left")
    columns = (text, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn(), left)
    with Bar(*columns, console=console, transient=True, speed_estimate_period=120.0) as bar:
        task = bar.add_task(what, total=1.0)

        def show(text: str, done: int, total: int) -> None:
            # a step that cannot be counted pulses; a full bar would stop the clock
            share = min(done / total, 0.999) if total > 1 else 0.0
            known = 1.0 if total > 1 else None
            bar.update(task, total=known, completed=share, description=f"{what}: {printable(text)}")

        yield show


class _Lines:
    """Progress for a log file: a line with the time left every half minute, none for what is quickly done."""

    def __init__(self, what: str) -> None:
        self._what, self._step, self._first = what, 0, 0
        self._began = self._last = time.monotonic()

    def __call__(self, text: str, done: int, total: int) -> None:
        now = time.monotonic()
        # Another step has begun to count, or its first one is done, which also compiled, loaded and started workers.
        if done <= self._step or done == 1:
            self._began, self._first = now, done
        self._step = done
        if now - self._last < LINE_EVERY or not 0 < done < total:
            return
        self._last = now
        left = ""
        counted = done - self._first
        if counted > 0 and done >= FORETELLS * total:
            left = f", about {_duration((now - self._began) * (total - done) / counted)} left"
        note_line("doing", f"{self._what}: {done} of {total}{left} ({text})")


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if minutes < 1:
        return f"{max(1, round(seconds))} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
