"""Formats of loggers and programs, each read by its own library, which is imported when such a file comes."""

import importlib.util
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import refuse
from rigdata.readers.base import SAMPLE, refuse_claim
from rigdata.readers.formats.sandbox import read_sandboxed
from rigdata.readers.series import Series, equidistant, is_time, seconds, to_temporary_file

#: Function types of data set 58 that are records over time.
_GENERAL, _TIME_RESPONSE = 0, 1
#: Directions of data set 58 by their numbers.
_DIRECTIONS: dict[Any, str] = {1: "+X", 2: "+Y", 3: "+Z", -1: "-X", -2: "-Y", -3: "-Z"}


def read_tdms(path: Path) -> list[Series]:
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

    series = []
    # opened here: npTDMS leaves a file open that it cannot read
    with path.open("rb") as stream, TdmsFile.open(stream) as file:
        samples = 0
        for group in file.groups():
            samples += sum(len(channel) for channel in group.channels())
        refuse_claim(SAMPLE * samples, path)
        for group in file.groups():
            channels = [c for c in group.channels() if np.issubdtype(c.dtype or object, np.number)]
            clock = next((c for c in channels if is_time(c.name) and len(c)), None)
            shared = None if clock is None else seconds(_waveform(clock, group.name, None))
            series += [_waveform(channel, group.name, shared) for channel in channels if channel is not clock]
    return series


def _waveform(channel: Any, group: str, shared: FloatArray | None) -> Series:
    values = to_temporary_file(np.asarray(channel[:], dtype=float))
    unit = str(channel.properties.get("unit_string", ""))
    step = channel.properties.get("wf_increment")
    time = shared if shared is not None and len(shared) == len(values) else None
    if step is not None and float(step) > 0:
        time = equidistant(len(values), float(step), float(channel.properties.get("wf_start_offset", 0.0)))
    return Series(channel.name, unit, values, time, group)


def read_uff(path: Path) -> list[Series]:
    """Read every time record of a universal file.

    A record is named by its ID line 1, or else by its response node and direction (``"Rsp 7+X"``).

    Parameters
    ----------
    path : Path
        ``.uff``, ``.unv`` or ``.58``.

    Raises
    ------
    RigDataError
        It holds none: says what it holds.
    """
    import pyuff

    file = pyuff.UFF(str(path))
    series = []
    unusable: Counter[str] = Counter()
    for index, kind in enumerate(file.get_set_types()):
        if int(kind) != 58:
            unusable[f"data set {int(kind)}"] += 1
            continue
        data = file.read_sets(index)
        function = int(data.get("func_type", 0))
        if function not in (_GENERAL, _TIME_RESPONSE) or np.iscomplexobj(data["data"]):
            unusable[f"function type {function}"] += 1
            continue
        values, time = (to_temporary_file(np.asarray(data[key], dtype=float)) for key in ("data", "x"))
        unit = str(data.get("ordinate_axis_units_lab") or "").strip()
        unit = "" if unit.upper() == "NONE" else unit
        series.append(Series(_record_name(data, index), unit, values, time, f"set {index + 1}"))
    if not series:
        counts = ", ".join([f"{count} x {kind}" for kind, count in unusable.items()][:6])
        fault = f"holds no record over time, only {counts}" if counts else "holds no data set"
        raise refuse(path.name, "", fault, "Export the time records (data set 58, time response)")
    return series


def _record_name(data: dict[str, Any], index: int) -> str:
    for key in ("id1", "id4", "ordinate_axis_lab"):
        text = str(data.get(key) or "").strip()
        if text and text.upper() != "NONE":
            return text
    node, code = data.get("rsp_node"), data.get("rsp_dir")
    if not node:
        return f"set {index + 1}"
    return f"Rsp {node}{_DIRECTIONS.get(code, '')}"


def read_mdf(path: Path) -> list[Series]:
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
    return read_sandboxed("mdf_in_sandbox", path)


def mdf_in_sandbox(path: Path) -> list[Series]:
    """As `read_mdf`, in this process: a damaged file can end it."""
    from asammdf import MDF

    series = []
    with MDF(path) as file:
        samples = sum(group.channel_group.cycles_nr * len(group.channels) for group in file.groups)
        refuse_claim(SAMPLE * samples, path)
        for signal in file.iter_channels(skip_master=True):
            values = signal.samples
            if values.ndim == 1 and np.issubdtype(values.dtype, np.number):
                time = np.asarray(signal.timestamps, dtype=float)
                group = f"group {signal.group_index + 1}"
                series.append(Series(signal.name, signal.unit or "", np.asarray(values, dtype=float), time, group))
    return series


def read_parquet(path: Path) -> list[Series]:
    """Read every column of numbers.

    Field metadata ``unit`` gives a column's unit, table metadata ``sample_rate_hz`` the rate where no column is a time.

    Parameters
    ----------
    path : Path
        ``.parquet``.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    series = []
    with path.open("rb") as stream, pq.ParquetFile(stream) as table:
        schema, rows = table.schema_arrow, table.metadata.num_rows
        numeric = [c for c in schema if pa.types.is_integer(c.type) or pa.types.is_floating(c.type)]
        refuse_claim(SAMPLE * rows * (len(numeric) + 1), path)
        rate, time = (schema.metadata or {}).get(b"sample_rate_hz"), None
        if rate is not None and not any(is_time(column.name) for column in numeric):
            time = equidistant(rows, 1.0 / float(rate))
        for column in numeric:
            values = table.read([column.name]).column(0).cast(pa.float64()).to_numpy()
            unit = (column.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
            series.append(Series(column.name, unit, to_temporary_file(values), time))
    return series
