"""LabVIEW TDMS, read by npTDMS: waveforms bring their own step; a channel named like a time is one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.readers.base import SAMPLE, refuse_claim
from rigdata.readers.series import Series, equidistant, is_time, seconds, to_temporary_file


def read_series(path: Path) -> list[Series]:
    """Read every channel of numbers.

    Parameters
    ----------
    path : Path
        A ``.tdms`` file; its index file is not needed.

    Returns
    -------
    list of Series
    """
    from nptdms import TdmsFile

    series: list[Series] = []
    # opened here: npTDMS leaves a file open that it cannot read
    with path.open("rb") as stream, TdmsFile.open(stream) as file:
        samples = 0
        for group in file.groups():
            samples += sum(len(channel) for channel in group.channels())
        refuse_claim(SAMPLE * samples, path.stat().st_size, path.name)
        for group in file.groups():
            channels = [c for c in group.channels() if np.issubdtype(c.dtype or object, np.number)]
            clock = next((c for c in channels if is_time(c.name) and len(c)), None)
            shared = None if clock is None else seconds(_series(clock, group.name, None))
            series += [_series(channel, group.name, shared) for channel in channels if channel is not clock]
    return series


def _series(channel: Any, group: str, shared: FloatArray | None) -> Series:
    values = to_temporary_file(np.asarray(channel[:], dtype=float))
    unit = str(channel.properties.get("unit_string", ""))
    step = channel.properties.get("wf_increment")
    time = shared if shared is not None and len(shared) == len(values) else None
    if step is not None and float(step) > 0:
        time = equidistant(len(values), float(step), float(channel.properties.get("wf_start_offset", 0.0)))
    return Series(channel.name, unit, values, time, group)
