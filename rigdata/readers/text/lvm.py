"""LabVIEW measurement files: a header of the file, then segments of a header and a table each."""

import io
import itertools
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import refuse
from rigdata.readers.series import Series, equidistant
from rigdata.readers.text.cells import all_lines, stamp_seconds, text_encoding

_MAGIC, _END = "LabVIEW Measurement", "***End_of_Header***"
_CHANNELS, _X, _COMMENT = "Channels", "X_Value", "Comment"
#: Lines that are parsed at a time.
_LINES = 5000


def read_lvm(path: Path) -> list[Series]:
    """Read every channel over time; segments of the same channels follow each other."""
    parts = defaultdict(list)
    for channel in _LvmFile(path).channels():
        parts[channel.name].append(channel)
    if not parts:
        raise refuse(path.name, "", "holds no channel over time", "Export the run again, with its samples")
    return [_joined(segments) for segments in parts.values()]


class _LvmFile(io.TextIOBase):
    """A file, of which `read` gives pandas the rows of one table: as text these take much more memory."""

    def __init__(self, path: Path) -> None:
        """Read the file's own header, which tells separator and decimal mark."""
        self.file = path.name
        self.lines = all_lines(path, text_encoding(path, None))
        self.rows: Iterator[str] = iter(())
        self.separator, self.decimal = "\t", "."
        if not next(self.lines, "").startswith(_MAGIC):
            remedy = "Is it a LabVIEW measurement file?"
            raise refuse(self.file, "line 1", f"does not begin with {_MAGIC!r}", remedy)
        for line in self.lines:
            if line.startswith("Separator"):  # it is behind its own key
                self.separator = line[len("Separator") :][:1] or self.separator
            elif line.startswith("Decimal_Separator"):
                self.decimal = line[len("Decimal_Separator") + 1 :].strip()[:1] or self.decimal
            elif line.startswith(_END):
                break

    def read(self, size: int | None = -1) -> str:
        """The next rows, however much is asked for."""
        return "".join(itertools.islice(self.rows, _LINES))

    def channels(self) -> Iterator[Series]:
        """Channels over time of all segments in order; special blocks of their headings are left alone."""
        header = {}
        special = False
        while (line := next(self.lines, None)) is not None:  # a table puts the next heading back
            key, *cells = self._cells(line)
            special = (special or key.startswith("***Start_Special")) and not key.startswith("***End_Special")
            if key and not special:
                header[key] = cells  # of one channel each
            if _CHANNELS in header and key.startswith(_END):
                key, *cells = self._cells(next(self.lines, ""))
            elif key != _X:
                continue
            yield from self._segment(header, [key, *cells])
            header = {}

    def _segment(self, header: Mapping[str, Sequence[str]], names: Sequence[str]) -> Iterator[Series]:
        """Channels over time of the table that begins here; the group of each is when the segment began."""
        x = None
        number = 0
        for name, values in zip(names, self._table(names).T, strict=True):
            if name == _X:
                x = values if np.isfinite(values).any() else None
            elif name and name != _COMMENT:
                entries = {key: cells[number] for key, cells in header.items() if number < len(cells)}
                number += 1
                if entries.get("X_Dimension", "").lower() not in ("time", ""):
                    continue
                count, step, start = (self._number(entries.get(key, "")) for key in ("Samples", "Delta_X", "X0"))
                length = int(count) if 0 < count <= len(values) else len(values)
                time = None if x is None else x[:length]
                if step > 0:  # X as written is rounded
                    time = equidistant(length, step, start if np.isfinite(start) else 0.0)
                began = f"{entries.get('Date', '')} {entries.get('Time', '')}".strip()
                yield Series(name, entries.get("Y_Unit_Label", ""), values[:length], time, began)

    def _number(self, cell: str) -> float:
        try:
            return float(cell.replace(self.decimal, "."))
        except ValueError:
            return np.nan

    def _cells(self, line: str) -> list[str]:
        return [cell.strip() for cell in line.split(self.separator)]

    def _table(self, names: Sequence[str]) -> FloatArray:
        """Numbers (n, columns) of the table that begins here, NaN where blank; the column of comments is left out."""
        import pandas as pd

        width = len(names)
        used = [i for i, name in enumerate(names) if name and name != _COMMENT]
        self.rows = self._rows(width)
        try:
            frame = pd.read_csv(
                self, sep=self.separator, decimal=self.decimal, header=None, names=range(width),
                usecols=used, index_col=False, dtype=float, skip_blank_lines=False, quoting=3,
            )  # fmt: skip
        except pd.errors.EmptyDataError:
            return np.empty((0, width))
        except ValueError as error:
            fault = f"has text among its numbers ({error})"
            raise refuse(self.file, "", fault, "Export the run again") from error
        values = np.full((len(frame), width), np.nan)
        values[:, used] = frame.to_numpy(float)
        return values

    def _rows(self, width: int) -> Iterator[str]:
        """Lines of a table up to the next heading, with all their cells: a blank comment at the end may be left out."""
        blank = f"{self.separator} \t\r\n"
        for line in self.lines:
            if line.partition(self.separator)[0].strip() in (_CHANNELS, _X):
                self.lines = itertools.chain([line], self.lines)
                return
            if line.strip(blank):
                yield line + self.separator * max(0, width - 1 - line.count(self.separator)) + "\n"


def _joined(parts: Sequence[Series]) -> Series:
    """Segments of one channel behind each other, by the times that they began, else without a gap."""
    first = replace(parts[0], group="")
    if len(parts) == 1:
        return first
    values = np.concatenate([part.values for part in parts])
    if any(part.time is None for part in parts):
        return replace(first, values=values, time=None)
    began, bad = stamp_seconds([part.group or None for part in parts])
    times: list[FloatArray] = []
    for part, start in zip(parts, began, strict=True):
        time = np.asarray(part.time)
        if times:
            last = times[-1]
            end = 2.0 * last[-1] - last[-2] if len(last) > 1 else last[-1]
            if bad == 0 and start > 0 and time[0] < end:
                time = time - time[0] + times[0][0] + start
            if time[0] < end - 1e-9:
                time = time - time[0] + end
        times.append(time)
    return replace(first, values=values, time=np.concatenate(times))
