"""What the person at the terminal sees: results on standard output, messages and progress on standard error."""

from __future__ import annotations

import contextlib
import csv
import itertools
import math
import shlex
import shutil
import sys
import textwrap
import time
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.columns import Column
from tpjb_ident.runtime.tables import printable, readable

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.report.page import Table

#: Seconds between two lines about progress where there is no terminal, and between two states of the one line on it.
LINE_EVERY, _STATE_EVERY = 30.0, 0.1
#: Columns of a log file or a pipe.
_LOG_WIDTH = 80
#: Rows of a table that are printed where a file has them all.
MOST_ROWS = 40
#: Share of a step from which its speed is known well enough to tell the remaining time.
_FORETELLS = 0.02
#: Between two columns of a table.
_SPACE = "  "


_TABLE = csv.DictReader(Path(__file__).with_name("printed.csv").read_text("utf-8").splitlines())
#: How columns of tables on disk are printed, by name.
PRINTED = {row["column"]: Column(row["title"], row["form"], bool(row["words"])) for row in _TABLE}
#: Called with what is being done, how many are done, of how many.
Progress = Callable[[str, int, int], None]


def with_half(value: float, half: float) -> str:
    """A number with half its interval, or that there is none."""
    if value == half == 0.0:  # the mass of a model without one
        return "-"
    if not math.isfinite(value) or (value == 0.0 and not half > 0.0):
        return "no answer"
    if not math.isfinite(half) or half <= 0:
        return f"{value:.4g} ±?"
    digits = min(3, max(0, -math.floor(math.log10(half)))) if half < 10 else 0
    return f"{value:.{digits}f} ±{half:.{digits}f}"


class Terminal:
    """What a command prints, all of it or, with ``--quiet``, warnings and errors alone; collected for ``--json``."""

    def __init__(self, silent: bool = False) -> None:
        self._silent = silent
        self.lines: list[str] = []
        self.following = ""  #: the command that comes next
        self.messages: list[dict[str, str]] = []
        self.tables: list[dict[str, Any]] = []

    def print(self, text: str, fitted: bool = True) -> None:
        """Print one line; text from outside is shown as it is, less its control characters."""
        self.lines.append(printable(text))
        if not self._silent:
            print(_fitted(text) if fitted else printable(text), flush=True)

    def next(self, *words: object) -> None:
        """Note the command that comes next, by its words after `tpjb`; it is the last line of all.

        Looking at records needs what not everybody has installed.
        """
        if words[0] != "view" or find_spec("bokeh"):
            self.following = shlex.join(["tpjb", *map(str, words)])

    def close(self) -> None:
        """Print the command that comes next, unbroken, so that it can be copied."""
        if self.following:
            self.print(f"Next: {self.following}", fitted=False)

    def say(self, kind: str, text: str) -> None:
        """Print a message to stderr, its lines kept; a note not of a quiet command."""
        text = "\n".join(printable(line) for line in text.splitlines())
        self.messages.append({"kind": kind, "text": text})
        if kind != "note" or not self._silent:
            _print_message(kind, text)

    def warn(self, text: str) -> None:
        """Print a warning to stderr."""
        self.say("warning", text)

    def note(self, text: str) -> None:
        """Print a remark to stderr."""
        self.say("note", text)

    def doing(self, text: str) -> None:
        """Print to stderr what the command is at."""
        if not self._silent:
            _print_message("doing", printable(text))

    def show(self, title: str, titles: Iterable[Column | str], rows: Iterable[Sequence[Any]], file: str = "") -> None:
        """Print a table that fits the terminal, its columns of words to the left; of a long one the `file` with all."""
        columns = [Column(column) if isinstance(column, str) else column for column in titles]
        headings = [readable(column.heading) for column in columns]
        texts = []
        for row in rows:
            cells = [readable(column.cell(value)) for column, value in zip(columns, row, strict=True)]
            texts.append(cells)
        self.tables.append({"title": title, "columns": headings, "rows": texts})
        if self._silent:
            return
        shown, title = texts[:MOST_ROWS] if file else texts, printable(title)
        is_wide = len(shown) > 1 and _total(_sizes([headings, *shown])) > _width()
        varying, constant = [], []
        for i, column in enumerate(columns):
            if not is_wide or column.words or len({row[i] for row in shown}) > 1:
                varying.append(i)
            elif shown[0][i].strip(" -"):  # constant numbers go to the title
                constant.append(readable(column.with_unit(shown[0][i].strip())))
        title = "; ".join(dict.fromkeys([title, *constant]))
        body = []
        for row in [headings, *shown]:
            body.append([row[i] for i in varying])
        words = [k for k, i in enumerate(varying) if columns[i].words]
        lines = ["", *wrapped(title, _width()), *table_lines(body[0], body[1:], words, _width()), ""]
        if len(shown) < len(texts):
            lines.append(f"{len(texts) - len(shown)} more rows: {file} has all {len(texts)}")
        print("\n".join(lines), flush=True)

    def show_frame(self, title: str, frame: pd.DataFrame, names: str, file: str = "") -> None:
        """Print columns of a table on disk, by the names in a text; what has an interval with half of it."""
        columns = []
        cells = []
        for name in names.split() if len(frame) else ():
            column = PRINTED[name]
            values: Iterable[Any] = frame[name]
            if f"{name}_lo" in frame:
                column = column._replace(form=with_half)
                values = zip(values, 0.5 * (frame[f"{name}_hi"] - frame[f"{name}_lo"]), strict=True)
            columns.append(column)
            cells.append(values)
        if cells:
            self.show(title, columns, zip(*cells, strict=True), file)

    def show_table(self, table: Table, name: str) -> None:
        """Print a table of a page; `name` says what it is of."""
        columns = [Column(title, words=i in table.text_columns) for i, title in enumerate(table.columns)]
        self.show(f"{name}: {table.caption}", columns, table.rows)

    @contextlib.contextmanager
    def conclusion(self, sentences: Sequence[str]) -> Iterator[None]:
        """Print the answer, what the block shows, and all else."""
        answer, *tail = sentences
        self.print(answer)
        yield
        for line in tail:
            self.print(line)

    @contextlib.contextmanager
    def progress(self, activity: str) -> Iterator[Progress]:
        """Show how far the block is and the time left: on a terminal in one line, elsewhere in one now and then."""
        if not self._silent and sys.stderr.isatty():
            yield ProgressLines(activity, _overwrite, _STATE_EVERY).show
            _overwrite("")
        else:
            self.doing(activity)
            yield ProgressLines(activity, self.doing).show


class ProgressLines:
    """Progress for a log file: a line with the remaining time every half minute, none for what is quickly done.

    With a time of its own between two lines, every step is reported as it comes.
    """

    def __init__(self, activity: str, report: Callable[[str], None], interval: float | None = None) -> None:
        self._activity, self._report, self._interval = activity, report, interval
        self._step, self._first = 0, 0
        self._began = self._last = time.monotonic()

    def show(self, text: str, done: int, total: int) -> None:
        """Print a line if it is time for one."""
        now = time.monotonic()
        # Another step has begun to count, or its first one is done, which also compiled, loaded and started workers.
        if done <= self._step or done == 1:
            self._began, self._first = now, done
        self._step = done
        is_counted = 0 < done < total
        if now - self._last < (self._interval or LINE_EVERY) or not (is_counted or self._interval):
            return
        self._last = now
        if is_counted:
            remaining = ""
            if done > self._first and done >= _FORETELLS * total:
                seconds = (now - self._began) * (total - done) / (done - self._first)
                remaining = f", about {_duration(seconds)} left"
            text = f"{done} of {total}{remaining} ({text})"
        self._report(f"{self._activity}: {text}")


def _overwrite(text: str) -> None:
    """Write over the last line of a terminal."""
    room = _width() - 1
    print(f"\r{printable(text)[:room]:{room}}", end="" if text else "\r", file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if minutes < 1:
        return f"{max(1, round(seconds))} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"


def _print_message(kind: str, text: str) -> None:
    if sys.stderr.isatty():
        _overwrite("")  # the line of a progress
    print(_fitted(f"tpjb: {kind}: {text}", sys.stderr.isatty()), file=sys.stderr, flush=True)


def _width() -> int:
    """Columns that a table may take: the terminal's, or what COLUMNS says, or a log file's."""
    return max(40, shutil.get_terminal_size((_LOG_WIDTH, 24)).columns)


def _fitted(text: str, wraps: bool = True) -> str:
    """Lines with whole words, as wide as a table; messages in a log stay whole, for who searches them."""
    lines = []
    for line in text.split("\n"):
        line = readable(line)
        lines += wrapped(line, _width()) if wraps else [line]
    return "\n".join(lines)


def cell_len(text: str) -> int:
    """Columns that a text takes on a terminal; wide letters take two."""
    return len(text) + sum(unicodedata.east_asian_width(letter) in ("W", "F") for letter in text)


def wrapped(text: str, width: int) -> list[str]:
    """Break a sentence at spaces; words that are longer than a line, as paths are, stay whole."""
    return textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False) or [""]


def table_lines(columns: Sequence[str], rows: Sequence[Sequence[str]], words: Collection[int], width: int) -> list[str]:
    """Lay out a table: no cell is broken, what has no room is printed below its row, words before numbers."""
    sizes = _sizes([columns, *rows])
    if _total(sizes) > width:  # headings break at spaces first
        longest = [max(column.split(), key=cell_len, default="") for column in columns]
        sizes = _sizes([longest, *rows])
    row_columns = list(range(len(columns)))
    while len(row_columns) > 1 and _total([sizes[i] for i in row_columns]) > width:
        row_columns.remove(max([i for i in row_columns[1:] if i in words] or row_columns))

    def line(texts: Sequence[str]) -> str:
        padded = []
        for i, text in zip(row_columns, texts, strict=True):
            pad = " " * (sizes[i] - cell_len(text))
            padded.append(text + pad if i in words else pad + text)
        return _SPACE.join(padded).rstrip()

    headings = [reversed(textwrap.wrap(columns[i], sizes[i] or 1, break_on_hyphens=False)) for i in row_columns]
    lines = [line(texts) for texts in itertools.zip_longest(*headings, fillvalue="")][::-1]
    lines.append("-" * min(width, _total([sizes[i] for i in row_columns])))
    for row in rows:
        lines.append(line([row[i] for i in row_columns]))
        texts = []
        for i, cell in enumerate(row):
            if i not in row_columns and cell.strip(" -"):
                texts.append(f"{columns[i]}: {cell.strip()}".lstrip(": "))
        if texts:
            lines += [f"    {part}" for part in wrapped("; ".join(texts), width - 4)]
    return lines


def _sizes(rows: Iterable[Sequence[str]]) -> list[int]:
    """Size of the widest cell of each column."""
    return [max(map(cell_len, cells)) for cells in zip(*rows, strict=True)]


def _total(sizes: Sequence[int]) -> int:
    return sum(sizes) + len(_SPACE) * (len(sizes) - 1)
