"""What the person at the terminal sees: short tables, messages, progress. Results go to stdout, the rest to stderr."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import TYPE_CHECKING, Literal

from tpjb_ident.cli.voice import voice
from tpjb_ident.tables import printable

if TYPE_CHECKING:
    from rich.console import Console

#: Called with what is being done, how many are done, of how many.
Progress = Callable[[str, int, int], None]


def _console(stderr: bool = False) -> Console:
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False, soft_wrap=True)
    if not console.is_terminal:
        console.width = 140  # a log file has no edge to fold at
    return console


def say(text: str) -> None:
    """Print one line; text from outside is shown as it is, less its control characters."""
    voice().said.append(printable(text))
    if voice().silent:
        return
    _console().print(printable(text), markup=False)


def error_line(kind: str, text: str) -> None:
    """Print a message to stderr, its lines kept."""
    lines = "\n".join(printable(line) for line in text.splitlines())
    voice().remarks.append({"kind": kind, "text": lines})
    style = "bold red" if kind == "bug" else None
    _console(stderr=True).print(f"tpjb: {kind}: {lines}", markup=False, style=style)


def note_line(kind: str, text: str) -> None:
    """Print a remark to stderr; of a quiet command only warnings."""
    if kind != "doing":
        voice().remarks.append({"kind": kind, "text": printable(text)})
    if voice().silent and kind != "warning":
        return
    _console(stderr=True).print(f"tpjb: {kind}: {printable(text)}", markup=False)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], words: Collection[int] = (0,)) -> None:
    """Print a table; columns of words stand left, numbers right."""
    voice().tables.append({"title": title, "columns": list(columns), "rows": [list(row) for row in rows]})
    if voice().silent:
        return
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(title=Text(printable(title)), box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
    for i, column in enumerate(columns):
        side: Literal["left", "right"] = "left" if i in words else "right"
        grid.add_column(Text(printable(column)), justify=side, no_wrap=i < len(columns) - 1, overflow="fold")
    for row in rows:
        grid.add_row(*(Text(printable(cell)) for cell in row))
    _console().print(grid)


@contextlib.contextmanager
def progress(what: str) -> Iterator[Progress]:
    """Show a bar on a terminal while the block runs; elsewhere only what is being done, once each.

    Yields
    ------
    Progress
    """
    console = _console(stderr=True)
    if voice().silent or not console.is_terminal:
        yield _plain_progress(what)
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=1.0)

        def show(text: str, done: int, total: int) -> None:
            # a step that cannot be counted pulses; a full bar would stop the clock
            share = min(done / total, 0.999) if total > 1 else 0.0
            known = 1.0 if total > 1 else None
            bar.update(task, total=known, completed=share, description=f"{what}: {printable(text)}")

        yield show


def _plain_progress(what: str) -> Progress:
    note_line("doing", what)

    def silent(text: str, done: int, total: int) -> None:
        """A log file has no use for a moving bar."""

    return silent
