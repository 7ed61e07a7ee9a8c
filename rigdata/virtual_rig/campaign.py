"""Writing a virtual campaign, as HDF5 or a folder of CSV, everything or nothing; and its truth, to be kept outside."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import cache
from math import ceil, isfinite, log10
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig.faults import Fault
from rigdata.virtual_rig.instruments import Instruments
from rigdata.virtual_rig.layout import CsvLayout, Hdf5Layout, Layout, layout_named, manifest_text
from rigdata.virtual_rig.motion import answer
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig, converter_step, felt_direction
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError, point_facts

Progress = Callable[[int, int, str], None]
_Records = Iterable[tuple[SimulatedRun, tuple[Fault, ...]]]
_UNQUANTISED_BITS = 36  # without a converter, digits are written as if it had this many bits


_PIVOT_LOADS = np.arange(250.0, 8001.0, 250.0)


class CampaignTruth(dict[str, Any]):
    """What was really put into a campaign, by the keys of the samples' truth files."""

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write as JSON, whole or not at all; never into the campaign itself. What is infinite becomes null."""
        target = Path(path)
        spare = target.with_name(f".{target.name}.part")
        spare.write_text(json.dumps(_finite(self), indent=1, allow_nan=False), encoding="utf-8")
        os.replace(spare, target)


def write_campaign(
    out: str | os.PathLike[str],
    rig: VirtualRig,
    layout: str | Layout = "hdf5",
    *,
    progress: Progress | None = None,
) -> CampaignTruth:
    """Write a campaign in the `tpjb-rig/1` format."""
    target = Path(out)
    chosen = layout_named(layout)
    if not target.parent.is_dir():
        raise VirtualRigError(f"{target.parent} is not a folder; make it first")
    if os.path.lexists(target):
        raise VirtualRigError(f"{target} exists; choose another name, or delete it first")
    _check_faults(rig, chosen)
    laws: dict[str, Any] = {name: cache(getattr(rig.truth, name)) for name in ("stiffness", "position", "temperature")}
    rig = replace(rig, truth=replace(rig.truth, **laws))  # each is asked only once per point
    runs = rig.runs()
    header = {"id": rig.campaign, "bearing": rig.truth.bearing_name, "description": rig.description}
    manifest = manifest_text(header, rig.instruments, runs, chosen, rig.faults)
    facts: dict[str, dict[str, object]] = {}
    records = _written_records(rig, facts, progress)
    # the temporary sibling is on the same file system, so that the last step is one rename
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as spare:
        draft = Path(spare) / "campaign"
        if isinstance(chosen, Hdf5Layout):
            _write_hdf5(draft, rig, manifest, records, chosen)
        else:
            _write_csv(draft, rig, manifest, records, chosen)
        truth = campaign_truth(rig, facts)
        os.rename(draft, target)
    return truth


def _written_records(
    rig: VirtualRig, facts: dict[str, dict[str, object]], progress: Progress | None
) -> Iterator[tuple[SimulatedRun, tuple[Fault, ...]]]:
    """Simulate every record and note its facts; those whose file is there, with the faults of it."""
    own = [run.id for run in rig.runs() if run.record == run.id]
    for done, run in enumerate(own, 1):
        record = rig.simulate(run)
        facts[run] = _run_facts(record)
        faults = rig.faults_of(run)
        if not _has("missing_file", faults):
            yield record, faults
        if progress is not None:
            progress(done, len(own), run)


def _check_faults(rig: VirtualRig, layout: Layout) -> None:
    """Refuse faults that this layout cannot show: a campaign must hold what was asked for."""
    for fault in rig.faults:
        other = {"CsvLayout", "Hdf5Layout"}.intersection(fault.needs) - {type(layout).__name__}
        if other:
            raise VirtualRigError(f"fault {fault.kind!r} does not exist in {type(layout).__name__}")
        if "times" in fault.needs and layout.time_name is None:
            raise VirtualRigError(f"fault {fault.kind!r} needs a time column; give the layout a time_name")


def _write_hdf5(path: Path, rig: VirtualRig, manifest: str, records: _Records, layout: Hdf5Layout) -> None:
    """Write all records to a new file; runs that share a record share its group.

    No time stamps are stored: the same rig gives the same bytes.
    """
    import h5py

    kind = np.dtype("float64" if rig.noise.bits is None else "float32")
    with h5py.File(path, "w-", libver="earliest") as file:
        file.attrs["manifest"] = manifest
        file.attrs["bearing"] = rig.truth.bearing_text
        groups = file.create_group("runs")
        for record, faults in records:
            _write_record(groups.create_group(record.run.id), record, layout, kind, faults)
        for run in rig.runs():
            if run.record != run.id and run.record in groups:
                groups[run.id] = groups[run.record]  # a hard link


def _write_record(
    group: Any, record: SimulatedRun, layout: Hdf5Layout, kind: np.dtype, faults: tuple[Fault, ...]
) -> None:
    group.attrs["sample_rate_hz"] = float(record.readings.rate)
    length = 0 if _has("empty_file", faults) else len(record.readings.time)
    if layout.time_name is not None:
        _write_dataset(group, layout.time_name, record.readings.time[:length])
    for name, values in record.readings.columns.items():
        if _has("missing_channel", faults, name):
            continue
        count = length * 3 // 4 if _has("short_channel", faults, name) else length
        _write_dataset(group, name, values[:count].astype(kind))


def _write_dataset(group: Any, name: str, values: FloatArray) -> None:
    packing: dict[str, Any] = {}
    if len(values):
        chunks = (min(len(values), 16384),)
        packing = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "chunks": chunks}
    group.create_dataset(name, data=values, track_times=False, **packing)


def _write_csv(folder: Path, rig: VirtualRig, manifest: str, records: _Records, layout: CsvLayout) -> None:
    """Write manifest, bearing and all records into a new folder."""
    (folder / "runs").mkdir(parents=True)
    (folder / "campaign.toml").write_bytes(manifest.encode())
    (folder / rig.truth.bearing_name).write_bytes(rig.truth.bearing_text.encode())
    for record, faults in records:
        text = _record_text(record, rig, layout, faults)
        (folder / "runs" / f"{record.run.id}.csv").write_bytes(text.encode(layout.encoding))


def _record_text(record: SimulatedRun, rig: VirtualRig, layout: CsvLayout, faults: tuple[Fault, ...]) -> str:
    readings = record.readings
    sensors = [s for s in rig.instruments.sensors if not _has("missing_channel", faults, s.name)]
    sensors += [s for s in sensors if _has("duplicate_column", faults, s.name)]
    names, units, columns, forms = [], [], [], []
    if layout.time_name is not None:
        names, units, columns = [layout.time_name], ["s"], [readings.time]
        forms = ["%.6f" if (1e6 / readings.rate).is_integer() else "%.9f"]
    for sensor in sensors:
        names.append(sensor.name)
        units.append(sensor.unit)
        columns.append(readings.columns[sensor.name])
        # decimals that keep a hundredth of a converter step
        decimals = ceil(-log10(converter_step(sensor, rig.noise.bits or _UNQUANTISED_BITS))) + 2
        forms.append(f"%.{max(0, decimals)}f")
    count = 0 if _has("empty_file", faults) else len(readings.time)
    tail = layout.delimiter if layout.trailing_delimiter else ""
    head = [line.format(rate=f"{readings.rate:g}", count=count) for line in layout.preamble]
    head.append(layout.delimiter.join(names) + tail)
    if layout.units_line:
        head.append(layout.delimiter.join(units) + tail)
    body = _rows(np.stack(columns, axis=1)[:count], forms, layout, tail)
    if _has("truncated_line", faults) and body:
        body[-1] = body[-1][: len(body[-1]) * 3 // 5]
        return layout.newline.join([*head, *body])
    return layout.newline.join([*head, *body, *[""] * (1 + layout.blank_last_lines)])


def _rows(table: np.ndarray, forms: list[str], layout: CsvLayout, tail: str) -> list[str]:
    """Format the lines of a table; one format string for a whole row is the fastest way in Python."""
    form = "\0".join(forms)
    text = "\n".join([form % tuple(row) for row in table.tolist()])
    if np.isnan(table).any():
        text = text.replace("nan", layout.missing)
    if layout.decimal != ".":
        text = text.replace(".", layout.decimal)
    text = text.replace("\0", layout.delimiter)
    return [line + tail for line in text.split("\n")] if text else []


def _has(kind: str, faults: tuple[Fault, ...], channel: str | None = None) -> bool:
    """Whether one of a record's faults is of a kind, and in a channel."""
    return any(f.kind == kind and (channel is None or f.is_in(channel)) for f in faults)


def _finite(value: object) -> object:
    """Copy plain data with None for infinite numbers (rigid pivots, rigid cells), which JSON does not know."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def campaign_truth(rig: VirtualRig, runs: Mapping[str, Mapping[str, object]]) -> CampaignTruth:
    """Gather the truth of a rig and of its simulated runs."""
    truth, instruments = rig.truth, rig.instruments
    return CampaignTruth(
        schema="tpjb-truth/1",
        campaign=rig.campaign,
        seed=rig.seed,
        points=[_point(rig, point) for point in rig.plan.dynamic],
        locus=[point_facts(point, truth.centre(point)) for point in rig.plan.locus],
        pivot_curves=[_pivot_curve(truth, k + 1) for k in range(len(truth.pivot_angles))],
        clearance_cold_m=truth.clearance,
        gap_voltage_V=instruments.gap_voltages(),
        housing_mass_kg=instruments.true_mass,
        cell_stiffness_N_per_m=instruments.cell_stiffness,
        sensor_errors={s.name: asdict(s.error) for s in instruments.sensors},
        faults=[_fault(fault) for fault in rig.faults],
        runs=runs,
    )


def _run_facts(record: SimulatedRun) -> dict[str, object]:
    """Facts of one record for the truth."""
    return {
        "kind": record.run.kind,
        "recorded_in": record.source,
        **record.motion.facts,
        "glitches": [asdict(glitch) for glitch in record.glitches],
    }


def _point(rig: VirtualRig, point: OperatingPoint) -> dict[str, object]:
    h = rig.truth.h(point)
    readings = apparent_stiffness(h, point.excitation, rig.instruments)
    steady = replace(point, excitation=0.0)
    return {
        **point_facts(point, rig.truth.centre(steady)),
        "excitation_Hz": point.excitation_hz,
        "K": h.real.tolist(),
        "C": (h.imag / point.excitation).tolist(),
        "K_apparent": readings.real.tolist(),
        "C_apparent": (readings.imag / point.excitation).tolist(),
        "pad_temperature_C": rig.truth.temperatures(steady).tolist(),
    }


def _pivot_curve(truth: RigTruth, pad: int) -> dict[str, object]:
    # tangents by central differences over 0.1 % of the load: error about 1e-7 for smooth laws
    low, high = _PIVOT_LOADS * (1 - 1e-3), _PIVOT_LOADS * (1 + 1e-3)
    with np.errstate(divide="ignore"):  # a rigid pivot is infinitely stiff
        stiffness = (high - low) / (truth.deflection(pad, high) - truth.deflection(pad, low))
    return {
        "pad": pad,
        "force_N": _PIVOT_LOADS.tolist(),
        "deflection_m": truth.deflection(pad, _PIVOT_LOADS).tolist(),
        "stiffness_N_per_m": stiffness.tolist(),
    }


def _fault(fault: Fault) -> dict[str, object]:
    """Fault without what was not given; an open end is not a JSON number."""
    return {k: v for k, v in asdict(fault).items() if v is not None and v != float("inf")}


def apparent_stiffness(h: ComplexArray, frequency: float, instruments: Instruments) -> ComplexArray:
    """Dynamic stiffness (2, 2) [N/m] that the readings show for a true `h` at `frequency` [rad/s].

    Instrument errors are linear maps, so this needs no records: the difference to the truth is what the errors alone
    do, and a sharp test of whoever evaluates the records.
    """
    lines = [answer(frequency, force, h, instruments) for force in np.eye(2, dtype=complex)]
    readings = {}
    for quantity in ("displacement", "force", "acceleration"):
        phasors = np.stack([getattr(line, quantity) for line in lines], axis=1)
        readings[quantity] = _reading_map(instruments, quantity, frequency) @ phasors
    oil_force = readings["force"] + instruments.housing_mass * readings["acceleration"]
    return oil_force @ np.linalg.inv(readings["displacement"])


def _reading_map(instruments: Instruments, quantity: str, frequency: float) -> ComplexArray:
    """Map (2, 2) from true to stated X and Y of a quantity, phasors at `frequency` [rad/s]; first pair of sensors."""
    stated, sensed = [], []
    for sensor in instruments.of(quantity)[:2]:
        gain = sensor.error.gain * np.exp(-1j * frequency * sensor.error.delay)
        stated.append(sensor.direction(stated=True))
        sensed.append(gain * felt_direction(sensor, instruments))
    return np.linalg.solve(np.array(stated, dtype=complex), np.array(sensed))
