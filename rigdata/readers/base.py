"""What every reader of one run's record offers to `rigdata.campaign.Run`, and which file names which reader takes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.device import Device, Grid, by_clock
from rigdata.near_names import nearest_name
from rigdata.problem import Problem, refuse

#: A channel longer than this is rejected: slices of it would be asked for by mistake [samples].
MAX_SAMPLES = 2**31
#: One request for more samples of one channel than this is rejected (it would be 4 GB) [samples].
MAX_REQUEST = 2**29
#: What a file may claim to hold, unpacked and as numbers of eight bytes: so much in any case [bytes], and so many times
#: its size; a program that needs more sets them before it loads a campaign.
CLAIM_FREE, CLAIM_MULTIPLES = 2**28, 64
#: Bytes of a sample as it is read.
SAMPLE = 8
#: Sample rates beyond these are none [Hz]: times counted from them overflow.
LEAST_RATE, MOST_RATE = 1e-6, 1e12
#: Text in any national spelling.
TEXT = (".csv", ".txt", ".asc", ".dat", ".tsv")
#: Suffix -> module of `rigdata.readers`, extra that brings its library.
FORMATS = {
    ".tdms": ("formats.tdms", "tdms"),
    ".lvm": ("text.lvm", ""),
    ".uff": ("formats.uff58", "uff"),
    ".unv": ("formats.uff58", "uff"),
    ".58": ("formats.uff58", "uff"),
    ".mf4": ("formats.mdf4", "mdf"),
    ".mdf": ("formats.mdf4", "mdf"),
    ".mat": ("formats.mat", ""),
    ".parquet": ("formats.parquet", ""),
}
#: Suffixes of loggers and programs that write one of the known kinds on request.
_EXPORTABLE = {
    ".tdm": ".tdms or .csv", ".tdx": ".tdms or .csv", ".xlsx": ".csv", ".xls": ".csv", ".ods": ".csv", ".bin": ".csv",
    ".dxd": ".mat or .csv", ".d7d": ".mat or .csv", ".ltd": ".uff", ".lms": ".uff", ".pro": ".uff",
    ".wav": ".csv", ".npy": ".csv", ".npz": ".csv", ".rec": ".csv", ".sie": ".csv", ".tst": ".csv",
}  # fmt: skip


class RunReader(Protocol):
    """Lazy access to one run's record; nothing is opened before it is asked for."""

    @property
    def file(self) -> str:
        """Display name of the file (and the group in it)."""

    def names(self) -> tuple[str, ...]:
        """List the names of all columns or datasets."""

    def length(self) -> int:
        """Count the samples per channel."""

    def rate(self) -> float:
        """Give the nominal sample rate [Hz]."""

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Read raw readings of `names` in samples start..stop-1, one (stop - start,) array each.

        Parameters
        ----------
        names : sequence of str
            Of channels.
        start : int
            First sample.
        stop : int
            Sample after the last.
        """

    def time(self, start: int, stop: int) -> FloatArray:
        """Give the seconds of samples start..stop-1.

        Parameters
        ----------
        start : int
            First sample.
        stop : int
            Sample after the last.
        """

    def problems(self) -> tuple[Problem, ...]:
        """Report what does not stop the run from being used."""


def refuse_claim(claimed: int, size: int, file: str, run: str | None = None) -> None:
    """Refuse a file of `size` bytes whose headers claim far more than it can hold, before any of it is read."""
    if claimed > CLAIM_FREE + CLAIM_MULTIPLES * size:
        fault = f"claims {claimed / 1e6:.0f} MB of samples in a file of {size / 1e6:.3g} MB"
        raise refuse(file, "", fault, "Copy it again from the logger, or split the run", run)


class GridReader:
    """What readers of files with several devices have in common."""

    channels: Mapping[str, Channel]

    def _grids(self) -> Sequence[Grid]:
        """Channels at the same times, those of the run's own device first."""
        raise NotImplementedError

    def _grid(self, name: str) -> Grid:
        """Channels at the times of `name`."""
        grids = self._grids()
        return next((grid for grid in grids if name in grid.channels), grids[0])

    def devices(self) -> tuple[Device, ...]:
        """Channels that are sampled together."""
        return by_clock(self._grids(), self.channels)

    def apart(self) -> frozenset[str]:
        """Channels that are not sampled with the run's own device."""
        return frozenset(itertools.chain.from_iterable(grid.channels for grid in self._grids()[1:]))

    def _other_devices(self) -> tuple[Problem, ...]:
        """Note the channels that are sampled apart from the run's own device."""
        if not self.apart():
            return ()
        reader: Any = self
        parts = [f"{', '.join(device.channels[:6])} ({device.rate:.6g} Hz)" for device in self.devices()]
        text = f"sampled apart: {'; '.join(parts[:6])}"
        return (Problem("note", reader.file, "channels", text, "Nothing, if that is meant", reader.run),)

    def _along(self, name: str, start: int, stop: int) -> FloatArray:
        """Readings of another device along the run's own times, for those who look at all channels together.

        Straight lines, missing before the first sample and after the last; no phasor may come from it.
        """
        reader: Any = self
        length = self._grid(name).length
        (values,) = reader.read_device([name], 0, length)
        at = reader.device_time(name, 0, length)
        finite = np.isfinite(values)
        if not finite.any():
            return np.full(stop - start, np.nan)
        return np.interp(reader.time(start, stop), at[finite], values[finite], left=np.nan, right=np.nan)


def undescribed(names: Sequence[str], members: str, file: str, run: str) -> tuple[Problem, ...]:
    """Note columns or datasets that the manifest does not describe."""
    if not names:
        return ()
    listed = ", ".join(ascii(name)[1:-1][:40] for name in names[:6])
    if len(names) > 6:
        listed += f", ... ({len(names)} in all)"
    remedy = "Nothing, or describe them in the manifest"
    return (Problem("note", file, members, f"{members} without a description: {listed}", remedy, run),)


def rate_of_time(time: FloatArray) -> float:
    """Nominal sample rate of a time column (n,) [Hz].

    The median step over many samples is free of gaps, of jitter and of the rounding of the column
    (0.000, 0.001, 0.001, 0.002 at 2 kHz); NaN where no two times are finite or time does not advance.
    """
    finite = time[np.isfinite(time)]
    span = min(1000, len(finite) // 4) or len(finite) - 1
    if span < 1:
        return float("nan")
    step = float(np.median(finite[span:] - finite[:-span])) / span
    # Ten digits: as much as a column of rounded times holds; keeps 1000 Hz from being 999.9999999999.
    return float(f"{1.0 / step:.10g}") if step > 0 else float("nan")


def suffix_hint(path: Path) -> str:
    """What to do about a suffix that no reader is known by; "" where it is known."""
    suffix = path.suffix.lower()
    readable = (*TEXT, *FORMATS)
    if suffix in readable:
        return ""
    if suffix in _EXPORTABLE:
        return f"{suffix} files are not read; export it as {_EXPORTABLE[suffix]}"
    near = nearest_name(suffix, readable)
    hint = f"did you mean {near}?" if near else f"known are {', '.join(readable)}"
    return f"the suffix {suffix or '(none)'} is not known; {hint}"
