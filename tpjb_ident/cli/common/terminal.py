"""What the person at the terminal sees: results on standard output, messages and progress on standard error."""

from __future__ import annotations

import contextlib
import shlex
import shutil
import textwrap
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from tpjb_ident.columns import Column
from tpjb_ident.runtime.tables import printable, readable

if TYPE_CHECKING:
    from rich.console import Console


#: Seconds between two lines about progress where there is no terminal.
LINE_EVERY = 30.0
#: Columns of a log file or a pipe.
_LOG_WIDTH = 80
#: Rows of a table that are printed where a file has them all.
MOST_ROWS = 40
#: Share of a step from which its speed is known well enough to tell the remaining time.
_FORETELLS = 0.02
#: Columns between two columns of a table.
_SPACE = 2
#: A column of words is not made narrower than this; what needs less room than it has is printed below the row instead.
_NARROWEST = 14
#: Called with what is being done, how many are done, of how many.
Progress = Callable[[str, int, int], None]


class Terminal:
    """What a command prints, all of it or, with ``--quiet``, warnings and errors alone; collected for ``--json``."""

    def __init__(self, as_json: bool = False, quiet: bool = False) -> None:
        self.as_json = as_json
        self._silent = as_json or quiet
        self.lines: list[str] = []
        self.following = ""  #: the command that comes next
        self.messages: list[dict[str, str]] = []
        self.tables: list[dict[str, Any]] = []

    def print(self, text: str) -> None:
        """Print one line; text from outside is shown as it is, less its control characters."""
        self.lines.append(printable(text))
        if not self._silent:
            _console().print(_fitted(text), markup=False)

    def next(self, *words: object) -> None:
        """Note the command that comes next, by its words after `tpjb` or as typed; it is the last line of all."""
        texts = [str(word) for word in words]
        self.following = texts[0] if len(texts) == 1 else shlex.join(["tpjb", *texts])

    def close(self) -> None:
        """Print the command that comes next, unbroken, so that it can be copied."""
        if not self.following:
            return
        line = f"Next: {printable(self.following)}"
        self.lines.append(line)
        if not self._silent:
            _console().print(line, markup=False)

    def error(self, kind: str, text: str) -> None:
        """Print a message to stderr, its lines kept."""
        lines = "\n".join(printable(line) for line in text.splitlines())
        self.messages.append({"kind": kind, "text": lines})
        _print_message(kind, lines)

    def warn(self, text: str) -> None:
        """Print a warning to stderr."""
        self.messages.append({"kind": "warning", "text": printable(text)})
        _print_message("warning", printable(text))

    def note(self, text: str) -> None:
        """Print a remark to stderr; not of a quiet command."""
        self.messages.append({"kind": "note", "text": printable(text)})
        if not self._silent:
            _print_message("note", printable(text))

    def doing(self, text: str) -> None:
        """Print to stderr what the command is at."""
        if not self._silent:
            _print_message("doing", printable(text))

    def show(
        self,
        title: str,
        titles: Sequence[Column | str],
        rows: Iterable[Sequence[Any]],
        file: str = "",
    ) -> None:
        """Print a table that fits the terminal, its columns of words to the left; of a long one the `file` with all."""
        columns = [Column(title) if isinstance(title, str) else title for title in titles]
        headings = [column.heading for column in columns]
        texts = []
        for row in rows:
            cells = [column.cell(value) for column, value in zip(columns, row, strict=True)]
            texts.append(cells)
        self.tables.append({"title": title, "columns": headings, "rows": texts})
        if self._silent:
            return
        head = texts[:MOST_ROWS] if file else texts
        shown = [[readable(cell) for cell in row] for row in head]
        words = [i for i, column in enumerate(columns) if column.words]
        shown_headings = [readable(heading) for heading in headings]
        title, lines = _titled_table(printable(title), shown_headings, shown, words)
        for line in ("", title, *lines, ""):
            _console().print(line, markup=False)
        if len(head) < len(texts):
            _console().print(f"{len(texts) - len(head)} more rows: {file} has all {len(texts)}", markup=False)

    @contextlib.contextmanager
    def progress(self, activity: str) -> Iterator[Progress]:
        """Show a bar with the remaining time on a terminal while the block runs; elsewhere a line now and then."""
        console = _console(stderr=True)
        if self._silent or not console.is_terminal:
            self.doing(activity)
            yield ProgressLines(activity, self.doing).show
            return
        from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        text = TextColumn("{task.description}", markup=False)
        columns = (text, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        with Bar(*columns, TextColumn("left"), console=console, transient=True, speed_estimate_period=120.0) as bar:
            task = bar.add_task(activity, total=1.0)

            def show(step: str, done: int, total: int) -> None:
                # a step that cannot be counted pulses; a full bar would stop the clock
                share, whole = (min(done / total, 0.999), 1.0) if total > 1 else (0.0, None)
                bar.update(task, total=whole, completed=share, description=f"{activity}: {printable(step)}")

            yield show


class ProgressLines:
    """Progress for a log file: a line with the remaining time every half minute, none for what is quickly done."""

    def __init__(self, activity: str, report: Callable[[str], None]) -> None:
        self._activity, self._report = activity, report
        self._step, self._first = 0, 0
        self._began = self._last = time.monotonic()

    def show(self, text: str, done: int, total: int) -> None:
        """Print a line if it is time for one."""
        now = time.monotonic()
        # Another step has begun to count, or its first one is done, which also compiled, loaded and started workers.
        if done <= self._step or done == 1:
            self._began, self._first = now, done
        self._step = done
        if now - self._last < LINE_EVERY or not 0 < done < total:
            return
        self._last = now
        remaining = ""
        counted = done - self._first
        if counted > 0 and done >= _FORETELLS * total:
            remaining = f", about {_duration((now - self._began) * (total - done) / counted)} left"
        self._report(f"{self._activity}: {done} of {total}{remaining} ({text})")


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if minutes < 1:
        return f"{max(1, round(seconds))} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"


def _console(stderr: bool = False) -> Console:
    from rich.console import Console

    class PipeConsole(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # the command then ends well; rich would say 1

    return PipeConsole(stderr=stderr, highlight=False, soft_wrap=True)


def _print_message(kind: str, text: str) -> None:
    style = "bold red" if kind == "bug" else None
    _console(stderr=True).print(_fitted(f"tpjb: {kind}: {text}", stderr=True), markup=False, style=style)


def _width() -> int:
    """Columns that a table may take: the terminal's, or what COLUMNS says, or a log file's."""
    return max(40, shutil.get_terminal_size((_LOG_WIDTH, 24)).columns)


def _titled_table(title: str, headings: list[str], rows: list[list[str]], words: list[int]) -> tuple[str, list[str]]:
    """Title and lines of a table; of one that is too wide, columns of one and the same number go to the title."""
    common = [i for i in range(len(headings)) if i not in words and rows and len({row[i] for row in rows}) == 1]
    columns = list(range(len(headings)))
    while True:
        chosen = [[row[i] for i in columns] for row in rows]
        texts = [columns.index(i) for i in words]
        lines = table_lines([headings[i] for i in columns], chosen, texts, _width(), whole=bool(common))
        if not common or max(map(cell_len, lines)) <= _width():
            return "\n".join(wrapped(title, _width())), lines
        constant = common.pop(0)
        columns.remove(constant)
        title += f"; {headings[constant]} {rows[0][constant].strip()}"


def _fitted(text: str, stderr: bool = False) -> str:
    """Lines with whole words, as wide as a table; messages in a log stay whole, for who searches them."""
    lines = [readable(line) for line in text.split("\n")]
    if _console(stderr).is_terminal or not stderr:
        lines = [part for line in lines for part in wrapped(line, _width())]
    return "\n".join(lines)


def cell_len(text: str) -> int:
    """Columns that a text takes on a terminal; wide letters take two."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len as measured  # only where it is needed: help shall be instant

    return measured(text)


def wrapped(text: str, width: int) -> list[str]:
    """Break a sentence at spaces; words that are longer than a line, as paths are, stay whole."""
    return textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False) or [""]


def table_lines(
    columns: Sequence[str], rows: Sequence[Sequence[str]], words: Collection[int], width: int, whole: bool = False
) -> list[str]:
    """Lay out a table: numbers are never broken, words wrap, what has no room is printed below its row.

    Numbers of a `whole` one stay in their row, however wide it is.
    """
    cells = [max((cell_len(row[i]) for row in rows), default=0) for i in range(len(columns))]
    sizes = [max(cell, cell_len(column)) for cell, column in zip(cells, columns, strict=True)]
    if _total(sizes) > width:  # headings break at spaces first
        longest = [max((cell_len(word) for word in column.split()), default=0) for column in columns]
        sizes = [max(pair) for pair in zip(cells, longest, strict=True)]
    below = _narrow(sizes, words, width, words if whole else range(len(sizes)))
    beside = [i for i in range(len(columns)) if i not in below]
    layout = [(i, sizes[i], i in words) for i in beside]
    lines = _row_lines(columns, layout, bottom=True)
    lines.append("-" * min(width, _total([sizes[i] for i in beside])))
    for row in rows:
        lines += _row_lines(row, layout)
        texts = [f"{columns[i]}: {row[i].strip()}".lstrip(": ") for i in below if row[i].strip(" -")]
        if texts:
            lines += [f"    {line}" for line in wrapped("; ".join(texts), width - 4)]
    return lines


def _narrow(sizes: list[int], words: Collection[int], width: int, movable: Iterable[int]) -> list[int]:
    """Make columns of words narrower until the table fits; what still has no room is to be printed below its row."""
    below: list[int] = []
    while True:
        over = _total([size for i, size in enumerate(sizes) if i not in below]) - width
        candidates = [i for i in movable if i > 0 and i not in below]
        wide = [i for i in words if i not in below and sizes[i] > _NARROWEST]
        if over > 0 and wide:
            widest = max(wide, key=lambda i: sizes[i])
            sizes[widest] = max(_NARROWEST, sizes[widest] - over)
        elif over > 0 and candidates:
            below.append(max([i for i in candidates if i in words] or candidates))
        else:
            return sorted(below)


def _total(sizes: Sequence[int]) -> int:
    return sum(sizes) + _SPACE * (len(sizes) - 1)


def _row_lines(row: Sequence[str], layout: Sequence[tuple[int, int, bool]], bottom: bool = False) -> list[str]:
    """Lines of one row, of (column, its size, whether it holds words) each; headings end at the bottom of theirs."""
    blocks = []
    for column, size, is_text in layout:
        parts = [row[column]]
        if cell_len(row[column]) > size:
            parts = textwrap.wrap(row[column], max(size, 1), break_on_hyphens=False) or [""]
        pads = [" " * max(0, size - cell_len(part)) for part in parts]
        blocks.append((size, [part + pad if is_text else pad + part for part, pad in zip(parts, pads, strict=True)]))
    height = max((len(block) for _, block in blocks), default=1)
    for size, block in blocks:
        missing = [" " * size] * (height - len(block))
        block[:] = [*missing, *block] if bottom else [*block, *missing]
    return [(" " * _SPACE).join(cells).rstrip() for cells in zip(*(block for _, block in blocks), strict=True)]
