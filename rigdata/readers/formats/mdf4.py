"""MDF 4 (and 3), read by asammdf: groups of channels, each with its own clock."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from rigdata.readers.base import SAMPLE, refuse_claim
from rigdata.readers.formats.sandbox import read_sandboxed
from rigdata.readers.series import Series


def read_series(path: Path) -> list[Series]:
    """Read every channel of numbers, converted to what the file calls its physical value.

    Parameters
    ----------
    path : Path
        ``.mf4`` or ``.mdf``.

    Raises
    ------
    ModuleNotFoundError
        asammdf is not installed.
    RigDataError
        The file is damaged.
    """
    if importlib.util.find_spec("asammdf") is None:
        raise ModuleNotFoundError("No module named 'asammdf'", name="asammdf")
    return read_sandboxed("mdf4", path)


def read_in_sandbox(path: Path) -> list[Series]:
    """As `read_series`, in this process: a damaged file can end it."""
    from asammdf import MDF

    series = []
    with MDF(path) as file:
        samples = sum(group.channel_group.cycles_nr * len(group.channels) for group in file.groups)
        refuse_claim(SAMPLE * samples, path.stat().st_size, path.name)
        for signal in file.iter_channels(skip_master=True):
            values = signal.samples
            if values.ndim == 1 and np.issubdtype(values.dtype, np.number):
                time = np.asarray(signal.timestamps, dtype=float)
                group = f"group {signal.group_index + 1}"
                series.append(Series(signal.name, signal.unit or "", np.asarray(values, dtype=float), time, group))
    return series
