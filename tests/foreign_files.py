"""Files of loggers: tables of columns, and groups of channels as those formats' own libraries write them.

Skipped where a library is not installed.
"""

import itertools
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rigdata.readers.base import RecordFile
from rigdata.readers.file_reader import read_contents
from rigdata.readers.series import Series

Columns = Mapping[str, Any]
#: Channels that are sampled together: their times [s], and unit and values by name.
Group = tuple[np.ndarray, Mapping[str, tuple[str, Any]]]
_SEPARATORS = {"\t": "Tab", ",": "Comma", ";": "Semicolon"}


def read_series(path: Path, file: str) -> list[Series]:
    """Read every channel of a file without a manifest, each at its own times."""
    return list(read_contents(RecordFile(path, file)).series)


def write_columns(path: Path, columns: Columns) -> None:
    """Write a table by its suffix: text, text as catman has it (.asc), Parquet or MATLAB; short columns end in gaps."""
    if path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, dict(columns), oned_as="column")
        return
    import pandas as pd

    frame = pd.DataFrame({name: pd.Series(values) for name, values in columns.items()})
    if path.suffix == ".parquet":
        frame.to_parquet(path, index=False)
    else:
        catman = {"sep": "\t", "decimal": ",", "lineterminator": "\r\n", "encoding": "cp1252"}
        frame.to_csv(path, index=False, **(catman if path.suffix == ".asc" else {}))


def write_mat73(path: Path, columns: Columns) -> None:
    """Write a MATLAB file of version 7.3: HDF5 behind 512 bytes of MATLAB's own text."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            kind = "char" if isinstance(values, str) else "double"
            data = np.frombuffer(values.encode("utf-16-le"), "uint16") if kind == "char" else values[None, :]
            file.create_dataset(name, data=data).attrs["MATLAB_class"] = np.bytes_(kind)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\x02IM")


def write_groups(path: Path, *groups: Group) -> None:
    """Write a logger's file by its suffix."""
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # what other people's writers warn of is not ours to judge
        _WRITERS[path.suffix](path, groups)


def _write_tdms(path: Path, groups: Sequence[Group]) -> None:
    nptdms = pytest.importorskip("nptdms")
    objects = []
    for number, (time, channels) in enumerate(groups):
        wave = {"wf_increment": float(time[1] - time[0]), "wf_start_offset": float(time[0])}
        for name, (unit, values) in channels.items():
            properties = {} if isinstance(values, list) else wave | ({"unit_string": unit} if unit else {})
            objects.append(nptdms.ChannelObject(f"group {number + 1}", name, values, properties=properties))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(objects)


def _write_mdf(path: Path, groups: Sequence[Group]) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is heavy; install the extra mdf to run this")
    with asammdf.MDF(version="4.10") as file:
        for time, channels in groups:
            file.append([asammdf.Signal(v, time, name=name, unit=unit) for name, (unit, v) in channels.items()])
        file.save(path, overwrite=True)


def _write_uff(path: Path, groups: Sequence[Group]) -> None:
    """Data sets 58 over time."""
    for time, channels in groups:
        for name, (_, values) in channels.items():
            write_data_set(path, time, values, id1=name, func_type=1, abscissa_spec_data_type=17)


def write_data_set(path: Path, abscissa: np.ndarray, data: np.ndarray, **entries: Any) -> None:
    """Append a data set 58 to a universal file."""
    pyuff = pytest.importorskip("pyuff")
    usual = dict.fromkeys(("rsp_node", "rsp_dir", "ref_node", "ref_dir"), 1)
    usual |= {"abscissa_inc": float(abscissa[1] - abscissa[0]), "abscissa_min": 0.0, "abscissa_axis_units_lab": "s"}
    usual |= {"ordinate_axis_units_lab": "NONE"}
    usual |= dict.fromkeys(("ordinate_spec_data_type", "orddenom_spec_data_type", "z_axis_spec_data_type"), 0)
    record = pyuff.prepare_58(binary=0, x=abscissa, data=data, **(usual | entries))
    pyuff.UFF(str(path)).write_sets(record, "add")


def _write_lvm(path: Path, groups: Sequence[Group]) -> None:
    path.write_text(lvm_text(groups), newline="")


def lvm_text(
    groups: Sequence[Group], x_columns: str = "No", separator: str = "\t", decimal: str = ".", segments: int = 1
) -> str:
    """A LabVIEW measurement; every further segment, a moment later, reads 1 more in its first channel."""

    def number(value: float) -> str:
        return f"{value:.9f}".replace(".", decimal)

    channels = [(name, unit, time, values) for time, of in groups for name, (unit, values) in of.items()]
    count = len(channels)
    lines = ["LabVIEW Measurement", f"Writer_Version{separator}2", f"Separator{separator}{_SEPARATORS[separator]}"]
    lines += [f"Decimal_Separator{separator}{decimal}", f"X_Columns{separator}{x_columns}"]
    lines += ["***End_of_Header***", ""]
    for part in range(segments):
        begin = f"11:31:{22 + part * len(channels[0][2]) * _step(channels[0][2]):012.9f}".replace(".", decimal)
        heading = [["Channels", str(count)], ["Samples", *(str(len(values)) for *_, values in channels)]]
        heading += [["Date", *["2019/07/22"] * count], ["Time", *[begin] * count]]
        heading += [["Y_Unit_Label", *(unit for _, unit, *_ in channels)], ["X_Dimension", *["Time"] * count]]
        heading += [["X0", *(number(time[0]) for _, _, time, _ in channels)]]
        heading += [["Delta_X", *(number(_step(time)) for _, _, time, _ in channels)]]
        lines += [separator.join([*row, ""]) for row in heading] + ["***End_of_Header***" + separator * count]
        names = [name for name, *_ in channels]
        multi = itertools.chain.from_iterable(("X_Value", name) for name in names)
        lines.append(separator.join([*(multi if x_columns == "Multi" else ["X_Value", *names]), "Comment"]))
        for i in range(max(len(values) for *_, values in channels)):
            cells = [] if x_columns == "Multi" else [number(channels[0][2][i]) if x_columns == "One" else ""]
            for k, (_, _, time, values) in enumerate(channels):
                held = i < len(values)
                cells += [number(time[i]) if held else ""] if x_columns == "Multi" else []
                cells.append(number(values[i] + part * (k == 0)) if held else "")
            lines.append(separator.join([*cells, "a remark" if i == 3 else ""]))
        lines.append("")
    return "\r\n".join(lines)


def _step(time: np.ndarray) -> float:
    return float(time[1] - time[0])


_WRITERS = {
    ".tdms": _write_tdms, ".mf4": _write_mdf, ".uff": _write_uff, ".unv": _write_uff, ".lvm": _write_lvm,
}  # fmt: skip
