"""Writing a campaign as one HDF5 file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.virtual_rig.faults import Fault
from rigdata.virtual_rig.layout import Hdf5Layout
from rigdata.virtual_rig.plan import PlannedRun
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig


def write_hdf5(path: Path, rig: VirtualRig, manifest: str, records: Iterable[SimulatedRun], layout: Hdf5Layout) -> None:
    """Write all records to a new file; runs that share a record share its group.

    No time stamps are stored: the same rig gives the same bytes.

    Parameters
    ----------
    path : Path
    rig : VirtualRig
    manifest : str
        Text of the manifest.
    records : iterable of SimulatedRun
    layout : Hdf5Layout
    """
    import h5py

    precision = layout.precision or ("float64" if rig.noise.bits is None else "float32")
    with h5py.File(path, "w-", libver="earliest") as file:
        file.attrs["manifest"] = manifest
        file.attrs["bearing"] = rig.truth.bearing_text
        groups = file.create_group("runs")
        for record in records:
            faults = rig.faults_of(record.run.id)
            if any(f.kind == "missing_file" for f in faults):
                continue
            _write_record(groups.create_group(record.run.id), record, layout, precision, faults)
        for run in rig.runs():
            if run.record != run.id and run.record in groups:
                _share(groups, run)


def _write_record(
    group: Any, record: SimulatedRun, layout: Hdf5Layout, precision: str, faults: tuple[Fault, ...]
) -> None:
    group.attrs["sample_rate_hz"] = float(record.readings.rate)
    empty = any(f.kind == "empty_file" for f in faults)
    if layout.time_name is not None:
        stored = record.readings.time[: 0 if empty else None]
        group.create_dataset(layout.time_name, data=stored, **_options(len(stored), layout))
    for name, values in record.readings.columns.items():
        if any(f.kind == "missing_channel" and f.strikes(record.run.id, name) for f in faults):
            continue
        count = 0 if empty else len(values)
        if any(f.kind == "short_channel" and f.strikes(record.run.id, name) for f in faults):
            count = count * 3 // 4
        data = values[:count].astype(np.dtype(precision))
        group.create_dataset(name, data=data, **_options(count, layout))


def _options(count: int, layout: Hdf5Layout) -> dict[str, Any]:
    if not layout.compression or not count:
        return {"track_times": False}
    return {
        "track_times": False,
        "compression": "gzip",
        "compression_opts": layout.compression,
        "shuffle": True,
        "chunks": (min(count, 16384),),
    }


def _share(groups: Any, run: PlannedRun) -> None:
    # a hard link: the same group under a second name, inside the file
    groups[run.id] = groups[run.record]
