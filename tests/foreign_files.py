"""Files of other loggers, written by those formats' own libraries; skipped where the library is not installed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

#: Unit and values by channel.
Group = Mapping[str, tuple[str, np.ndarray]]


def write_tdms(path: Path, channels: Sequence[tuple[str, str, Any, dict[str, object]]]) -> None:
    """LabVIEW's binary format; group, name, values and properties of each channel."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([
            nptdms.ChannelObject(group, name, values, properties=properties)
            for group, name, values, properties in channels
        ])  # fmt: skip


def write_mdf(path: Path, groups: Sequence[tuple[np.ndarray, Group]]) -> None:
    """MDF 4; times and channels of each group."""
    asammdf = pytest.importorskip("asammdf", reason="asammdf is heavy; install the extra mdf to run this")
    with asammdf.MDF(version="4.10") as file:
        for time, channels in groups:
            file.append([asammdf.Signal(v, time, name=name, unit=unit) for name, (unit, v) in channels.items()])
        file.save(path, overwrite=True)


def write_uff(path: Path, channels: Mapping[str, tuple[float, np.ndarray]]) -> None:
    """Universal file of data sets 58 over time; step [s] and values of each channel."""
    pyuff = pytest.importorskip("pyuff")
    for name, (step, values) in channels.items():
        record = pyuff.prepare_58(
            binary=0, id1=name, func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=values,
            x=step * np.arange(len(values)), abscissa_inc=step, abscissa_min=0.0, abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s", ordinate_spec_data_type=0, ordinate_axis_units_lab="NONE",
            orddenom_spec_data_type=0, z_axis_spec_data_type=0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(record, "add")
