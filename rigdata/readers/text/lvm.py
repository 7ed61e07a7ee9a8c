"""LabVIEW measurement files (.lvm): a header, then segments of a header and a table each."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import refuse
from rigdata.readers.series import Series, equidistant
from rigdata.readers.text.byte_stream import all_lines, text_encoding
from rigdata.readers.text.cells import stamp_seconds

_MAGIC, _END = "LabVIEW Measurement", "***End_of_Header***"
_X, _COMMENT = "X_Value", "Comment"
#: Lines that are held as text at a time: as text a table takes several times the memory of its numbers.
_BLOCK = 20_000


@dataclass
class _Segment:
    """One table with its header."""

    header: dict[str, list[str]] = field(default_factory=dict)  #: key -> one cell per channel
    names: list[str] = field(default_factory=list)
    rows: list[str] = field(default_factory=list)
    blocks: list[FloatArray] = field(default_factory=list)  #: (rows, columns), NaN where blank

    def entry(self, key: str, number: int) -> str:
        """What the header has under `key` for channel `number`, counted from 1."""
        return "".join(self.header.get(key, [])[number - 1 : number])


def read_series(path: Path) -> list[Series]:
    """Read every channel over time; segments of the same channels follow each other."""
    return _LvmFile(path).read()


class _LvmFile:
    def __init__(self, path: Path) -> None:
        self.file = path.name
        self.lines = all_lines(path, text_encoding(path, None))
        self.separator, self.decimal = "\t", "."

    def read(self) -> list[Series]:
        first = next(self.lines, "")
        if not first.startswith(_MAGIC):
            remedy = "Is it a LabVIEW measurement file?"
            raise refuse(self.file, "line 1", f"does not begin with {_MAGIC!r}", remedy)
        self._read_spelling()
        parts: dict[str, list[Series]] = {}
        for segment in self._segments():
            for channel in self._channels(segment):
                parts.setdefault(channel.name, []).append(channel)
        if not parts:
            raise refuse(self.file, "", "holds no channel over time", "Export the run again, with its samples")
        return [_joined(segments) for segments in parts.values()]

    def _read_spelling(self) -> None:
        """Separator and decimal mark by the file's own header, which ends with this."""
        for line in self.lines:
            if line.startswith("Separator"):  # it is behind its own key
                self.separator = line[len("Separator") :][:1] or self.separator
            elif line.startswith("Decimal_Separator"):
                self.decimal = line[len("Decimal_Separator") + 1 :].strip()[:1] or self.decimal
            elif line.startswith(_END):
                break

    def _cells(self, line: str) -> list[str]:
        return [cell.strip() for cell in line.split(self.separator)]

    def _heading(self) -> dict[str, list[str]]:
        """Entries of a segment's heading, one cell per channel, up to its end mark; special blocks are left alone."""
        entries: dict[str, list[str]] = {}
        special = False
        for line in self.lines:
            key, *cells = self._cells(line)
            if key.startswith(_END):
                break
            if key.startswith("***Start_Special"):
                special = True
            elif key.startswith("***End_Special"):
                special = False
            if key and not special:
                entries[key] = cells
        return entries

    def _segments(self) -> Iterator[_Segment]:
        """Segments in order, their rows as numbers; without headings of their own all samples are one."""
        segment: _Segment | None = None
        blank = f"{self.separator} \t\r\n"
        for line in self.lines:
            first = line.partition(self.separator)[0].strip()
            if first == "Channels":
                if segment is not None:
                    self._convert_rows(segment)
                    yield segment
                segment = _Segment(self._heading(), self._cells(next(self.lines, "")))
            elif first == _X:
                segment = segment or _Segment()
                segment.names = self._cells(line)
            elif segment is not None and line.strip(blank):
                segment.rows.append(line)
                if len(segment.rows) == _BLOCK:
                    self._convert_rows(segment)
        if segment is not None:
            self._convert_rows(segment)
            yield segment

    def _convert_rows(self, segment: _Segment) -> None:
        """Turn the rows that a segment holds as text into numbers; the column of comments is left out."""
        import pandas as pd

        width = len(segment.names)
        used = [i for i, name in enumerate(segment.names) if name and name != _COMMENT]
        if not segment.rows:
            segment.blocks.append(np.empty((0, width)))
            return
        # a blank comment at the end of every row may be left out altogether
        first, *further = segment.rows
        first += self.separator * max(0, width - 1 - first.count(self.separator))
        text = io.StringIO("\n".join([first, *further]))
        try:
            frame = pd.read_csv(
                text, sep=self.separator, decimal=self.decimal, header=None, names=range(width), usecols=used,
                index_col=False, dtype=float, skip_blank_lines=False, quoting=3,
            )  # fmt: skip
        except ValueError as error:
            fault = f"has text among its numbers ({error})"
            raise refuse(self.file, "", fault, "Export the run again") from error
        values = np.full((len(frame), width), np.nan)
        values[:, used] = frame.to_numpy(float)
        segment.blocks.append(values)
        segment.rows.clear()

    def _channels(self, segment: _Segment) -> Iterator[Series]:
        values = np.concatenate(segment.blocks)
        x: FloatArray | None = None
        number = 0
        for i, name in enumerate(segment.names):
            if name == _X:
                x = values[:, i] if np.isfinite(values[:, i]).any() else None
            elif name and name != _COMMENT:
                number += 1
                if segment.entry("X_Dimension", number).lower() in ("time", ""):
                    yield self._series(segment, number, name, values[:, i], x)

    def _series(self, segment: _Segment, number: int, name: str, values: FloatArray, x: FloatArray | None) -> Series:
        """A channel; its group is date and time of day at which the segment began."""

        def stated(key: str) -> float:
            try:
                return float(segment.entry(key, number).replace(self.decimal, "."))
            except ValueError:
                return float("nan")

        count, step, start = stated("Samples"), stated("Delta_X"), stated("X0")
        length = int(count) if 0 < count <= len(values) else len(values)
        time = None if x is None else x[:length]
        if step > 0:  # X as written is rounded
            time = equidistant(length, step, start if np.isfinite(start) else 0.0)
        began = f"{segment.entry('Date', number)} {segment.entry('Time', number)}".strip()
        return Series(name, segment.entry("Y_Unit_Label", number), values[:length], time, began)


def _joined(parts: Sequence[Series]) -> Series:
    """Segments of one channel behind each other, by the times that they began, else without a gap."""
    first = parts[0]
    if len(parts) == 1:
        return Series(first.name, first.unit, first.values, first.time)
    values = np.concatenate([part.values for part in parts])
    if any(part.time is None for part in parts):
        return Series(first.name, first.unit, values, None)
    began, bad = stamp_seconds([part.group or None for part in parts])
    times: list[FloatArray] = []
    for i, part in enumerate(parts):
        time = np.asarray(part.time)
        if times:
            end = 2.0 * times[-1][-1] - times[-1][-2] if len(times[-1]) > 1 else times[-1][-1]
            if bad == 0 and np.isfinite(began[i]) and began[i] > 0 and time[0] < end:
                time = time - time[0] + times[0][0] + began[i]
            if time[0] < end - 1e-9:
                time = time - time[0] + end
        times.append(time)
    return Series(first.name, first.unit, values, np.concatenate(times))
