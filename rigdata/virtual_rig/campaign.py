"""Writing a virtual campaign, as HDF5 or a folder of CSV, everything or nothing; and its truth, to be kept outside."""

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from math import ceil, degrees, log10
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import ROTATIONS
from rigdata.problem import toml_value
from rigdata.vector import directions
from rigdata.virtual_rig.instruments import Instruments, Sensor
from rigdata.virtual_rig.motion import answer
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig, converter_step, felt_direction
from rigdata.virtual_rig.truth import PAPER_RIG, DryTest, PlannedRun, RigTruth, VirtualRigError, hz, point_facts

Progress = Callable[[int, int, str], None]
#: Names and readings of a file's columns.
_Columns = list[tuple[str, FloatArray]]
_Records = Iterator[SimulatedRun]
_UNQUANTISED_BITS = 36  # without a converter, digits are written as if it had this many bits
_PIVOT_LOADS = np.arange(250.0, 8001.0, 250.0)


@dataclass(frozen=True)
class CsvLayout:
    """Folder with `campaign.toml` and one CSV file per record."""

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    newline: str = "\n"
    preamble: tuple[str, ...] = ()
    units_line: bool = False
    time_name: str = "time"  #: "" where times are counted
    missing: str = ""
    trailing_delimiter: bool = False
    blank_last_lines: int = 0
    declared: bool = True


def csv_layout(layout: str | CsvLayout) -> CsvLayout | None:
    """How CSV is written, by the name of a layout; None for HDF5."""
    if not isinstance(layout, str):
        return layout
    named = PAPER_RIG["layouts"]
    if layout not in ("hdf5", *named):
        raise VirtualRigError(f"no layout {layout!r}; there are hdf5, {', '.join(named)}")
    return None if layout == "hdf5" else CsvLayout(**named[layout])


class CampaignTruth(dict[str, Any]):
    """What was really put into a campaign, by the keys of the samples' truth files."""

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write as JSON, never into the campaign itself; what is infinite becomes null."""
        finite = json.loads(json.dumps(self), parse_constant=lambda infinite: None)
        Path(path).write_text(json.dumps(finite, indent=1), encoding="utf-8")


def write_campaign(
    out: str | os.PathLike[str],
    rig: VirtualRig,
    layout: str | CsvLayout = "hdf5",
    *,
    progress: Progress | None = None,
) -> CampaignTruth:
    """Write a campaign in the `tpjb-rig/1` format: as HDF5, or as CSV in a layout or that of a name."""
    target, csv = Path(out), csv_layout(layout)
    if not target.parent.is_dir():
        raise VirtualRigError(f"{target.parent} is not a folder; make it first")
    if os.path.lexists(target):
        raise VirtualRigError(f"{target} exists; choose another name, or delete it first")
    lacks = {"CsvLayout": csv is None, "Hdf5Layout": csv is not None, "times": csv is None or not csv.time_name}
    for fault in rig.faults:
        for need in fault.rule["needs"]:
            if lacks.get(need):
                raise VirtualRigError(f"fault {fault.kind!r} needs {need}, which this layout does not have")
    laws: dict[str, Any] = {name: cache(getattr(rig.truth, name)) for name in ("stiffness", "position", "temperature")}
    rig = replace(rig, truth=replace(rig.truth, **laws))  # each is asked only once per point
    facts: dict[str, dict[str, object]] = {}
    records = _written_records(rig, facts, progress)
    # the temporary sibling is on the same file system, so that the last step is one rename
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as spare:
        draft = Path(spare) / "campaign"
        if csv is None:
            _write_hdf5(draft, rig, records)
        else:
            _write_csv(draft, rig, records, csv)
        truth = campaign_truth(rig, facts)
        os.rename(draft, target)
    return truth


def _written_records(rig: VirtualRig, facts: dict[str, dict[str, object]], progress: Progress | None) -> _Records:
    """Simulate every record and note its facts; those whose file is there."""
    records = [run.id for run in rig.runs if run.record == run.id]
    for done, run in enumerate(records, 1):
        record = rig.simulate(run)
        facts[run] = {
            "kind": record.run.kind,
            "recorded_in": record.source,
            **record.motion.facts,
            "glitches": [asdict(glitch) for glitch in record.glitches],
        }
        if "missing_file" not in rig.fault_kinds(run):
            yield record
        if progress is not None:
            progress(done, len(records), run)


def _stored(record: SimulatedRun, rig: VirtualRig, time_name: str = "") -> _Columns:
    """Columns of a record as its file holds them, times first, with the faults of the file."""
    readings, run = record.readings, record.run.id
    columns = [] if not time_name else [(time_name, readings.time)]
    doubled = []
    for name, values in readings.columns.items():
        kinds = rig.fault_kinds(run, name)
        if "missing_channel" in kinds:
            continue
        columns.append((name, values[: len(values) * 3 // 4] if "short_channel" in kinds else values))
        if "duplicate_column" in kinds:
            doubled.append((name, values))
    columns += doubled
    return [(name, values[:0]) for name, values in columns] if "empty_file" in rig.fault_kinds(run) else columns


def _write_hdf5(path: Path, rig: VirtualRig, records: _Records) -> None:
    """Write all records to a new file; runs that share a record share its group.

    No time stamps are stored: the same rig gives the same bytes.
    """
    import h5py

    kind = "float64" if rig.noise.bits is None else "float32"
    with h5py.File(path, "w-", libver="earliest") as file:
        file.attrs["manifest"] = manifest_text(rig)
        file.attrs["bearing"] = rig.truth.bearing_text
        groups = file.create_group("runs")
        for record in records:
            group = groups.create_group(record.run.id)
            group.attrs["sample_rate_hz"] = float(record.readings.rate)
            for name, values in _stored(record, rig):
                packing = {}
                if len(values):
                    chunks = (min(len(values), 16384),)
                    packing = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "chunks": chunks}
                group.create_dataset(name, data=values.astype(kind), track_times=False, **packing)
        for run in rig.runs:
            if run.record != run.id and run.record in groups:
                groups[run.id] = groups[run.record]  # a hard link


def _write_csv(folder: Path, rig: VirtualRig, records: _Records, layout: CsvLayout) -> None:
    """Write manifest, bearing and all records into a new folder."""
    (folder / "runs").mkdir(parents=True)
    (folder / "campaign.toml").write_bytes(manifest_text(rig, layout).encode())
    (folder / rig.truth.bearing_name).write_bytes(rig.truth.bearing_text.encode())
    for record in records:
        text = _record_text(record, rig, layout)
        (folder / "runs" / f"{record.run.id}.csv").write_bytes(text.encode(layout.encoding))


def _record_text(record: SimulatedRun, rig: VirtualRig, layout: CsvLayout) -> str:
    columns, rate = _stored(record, rig, layout.time_name), record.readings.rate
    names, values = zip(*columns)
    units, forms = [], []
    for name in names:
        unit, decimals = "s", 6 if (1e6 / rate).is_integer() else 9
        if name != layout.time_name:
            sensor = rig.instruments.named(name)
            # decimals that keep a hundredth of a converter step
            step = converter_step(sensor, rig.noise.bits or _UNQUANTISED_BITS)
            unit, decimals = sensor.unit, max(0, ceil(-log10(step)) + 2)
        units.append(unit)
        forms.append(f"%.{decimals}f")
    table = np.stack(values, axis=1)
    tail = layout.delimiter if layout.trailing_delimiter else ""
    head = [line.format(rate=f"{rate:g}", count=len(table)) for line in layout.preamble]
    head += [layout.delimiter.join(cells) + tail for cells in [names, units][: 1 + layout.units_line]]
    form = "\0".join(forms)  # one format string for a whole row is the fastest way in Python
    text = "\n".join([form % tuple(row) for row in table.tolist()])
    for former_text, spelling in (("nan", layout.missing), (".", layout.decimal), ("\0", layout.delimiter)):
        text = text.replace(former_text, spelling)
    body = [line + tail for line in text.split("\n")] if text else []
    end = [""] * (1 + layout.blank_last_lines)
    if "truncated_line" in rig.fault_kinds(record.run.id) and body:
        body[-1] = body[-1][: len(body[-1]) * 3 // 5]
        end = []
    return layout.newline.join([*head, *body, *end])


def campaign_truth(rig: VirtualRig, runs: Mapping[str, Mapping[str, object]]) -> CampaignTruth:
    """Gather the truth of a rig and of its simulated runs."""
    truth, instruments = rig.truth, rig.instruments
    points = []
    for point in rig.plan.dynamic:
        h, steady = truth.stiffness(point), replace(point, excitation=0.0)
        readings = apparent_stiffness(h, point.excitation, instruments)
        entry = {
            **point_facts(point, truth.position(steady)),
            "excitation_Hz": point.excitation_hz,
            "K": h.real.tolist(),
            "C": (h.imag / point.excitation).tolist(),
            "K_apparent": readings.real.tolist(),
            "C_apparent": (readings.imag / point.excitation).tolist(),
            "pad_temperature_C": truth.temperature(steady).tolist(),
        }
        points.append(entry)
    return CampaignTruth(
        schema="tpjb-truth/1",
        campaign=rig.campaign,
        seed=rig.seed,
        points=points,
        locus=[point_facts(point, truth.position(point)) for point in rig.plan.locus],
        pivot_curves=[_pivot_curve(truth, k + 1) for k in range(len(truth.pivot_angles))],
        clearance_cold_m=truth.clearance,
        gap_voltage_V=instruments.gap_voltages(),
        housing_mass_kg=instruments.true_mass,
        cell_stiffness_N_per_m=instruments.cell_stiffness,
        sensor_errors={s.name: asdict(s.error) for s in instruments.sensors},
        faults=[fault.stated() for fault in rig.faults],
        runs=runs,
    )


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


def apparent_stiffness(h: ComplexArray, frequency: float, instruments: Instruments) -> ComplexArray:
    """Dynamic stiffness (2, 2) [N/m] that the readings show for a true `h` at `frequency` [rad/s].

    Instrument errors are linear maps, so this needs no records: the difference to the truth is what the errors alone
    do, and a sharp test of whoever evaluates the records.
    """
    response = answer(frequency, np.eye(2, dtype=complex), h, instruments)
    readings = {}
    for quantity in ("displacement", "force", "acceleration"):
        nominal, sensed = [], []
        for sensor in instruments.of(quantity)[:2]:
            gain = sensor.error.gain * np.exp(-1j * frequency * sensor.error.delay)
            nominal.append(directions(sensor.axis or 0.0))
            sensed.append(gain * felt_direction(sensor, instruments))
        phasors = getattr(response, quantity).T
        readings[quantity] = np.linalg.solve(np.array(nominal, dtype=complex), np.array(sensed)) @ phasors
    oil_force = readings["force"] + instruments.housing_mass * readings["acceleration"]
    return oil_force @ np.linalg.inv(readings["displacement"])


def manifest_text(rig: VirtualRig, layout: CsvLayout | None = None) -> str:
    """Write the manifest (`tpjb-rig/1`)."""
    rates = [run.rate for run in rig.runs]
    rate, rotation = max(set(rates), key=rates.count), rig.runs[0].point.rotation
    header = {"schema": "tpjb-rig/1", "id": rig.campaign, "bearing": rig.truth.bearing_name}
    tables: dict[str, dict[str, Any]] = {
        "": header | {"description": rig.description},
        "[housing]": {"mass": f"{rig.instruments.housing_mass:.10g} kg"},
        "[acquisition]": {"sample_rate": _rate(rate)},
    }
    if layout is not None and layout.declared:
        line = len(layout.preamble) + 1
        tables["[csv]"] = {
            "delimiter": layout.delimiter,
            "decimal": layout.decimal,
            "encoding": layout.encoding,
            "header_line": line,
            "units_line": line + 1 if layout.units_line else None,
        }
    if layout is not None and layout.time_name:
        tables[f"[channels.{layout.time_name}]"] = {"quantity": "time", "unit": "s"}
    for sensor in rig.instruments.sensors:
        tables[f"[channels.{sensor.name}]"] = _channel(sensor)
    if rotation != ROTATIONS[0]:
        tables["[shaft]"] = {"rotation": rotation}
    suffix = "" if layout is None else ".csv"
    runs = [("[[runs]]", _run(_as_noted(run, rig), suffix, rate, rotation)) for run in rig.runs]
    return "\n".join(_table(title, entries) for title, entries in (*tables.items(), *runs))


def _table(title: str, entries: dict[str, object]) -> str:
    """A table of the manifest; entries without a value are left out."""
    lines = [title] if title else []
    for key, value in entries.items():
        if value is not None:
            lines.append(f"{key} = {toml_value(value)}")
    return "\n".join(lines) + "\n"


def _channel(sensor: Sensor) -> dict[str, object]:
    return {
        "quantity": sensor.quantity,
        "axis": None if sensor.axis is None else _degrees(sensor.axis),
        "pad": sensor.pad,
        "position": sensor.position,
        "unit": sensor.unit,
        **sensor.calibration,
        "polarity": sensor.polarity if sensor.polarity < 0 else None,
        "uncertainty": f"{100 * sensor.uncertainty:g} %" if sensor.uncertainty else None,
    }


def _run(run: PlannedRun, suffix: str, rate: float, rotation: str) -> dict[str, object]:
    test, point = run.test, run.point
    entries: dict[str, object] = {
        "id": run.id,
        "file": f"runs/{run.record}{suffix}" if suffix else None,
        "kind": run.kind,
    }
    if isinstance(test, DryTest):
        entries["pad"] = test.pad
        entries["static_load_direction"] = _degrees(run.direction)
        entries["branch"] = test.branch if test.branch != "up" else None
    elif test is None:
        entries["shaft_speed"] = f"{point.shaft_speed_hz:.10g} Hz"
        entries["static_load"] = f"{point.static_load / 1e3:.10g} kN"
        entries["static_load_direction"] = _degrees(point.static_load_direction)
        entries["rotation"] = point.rotation if point.rotation != rotation else None
    if run.kind == "dynamic":
        entries["excitation_frequency"] = f"{point.excitation_hz:.10g} Hz"
        entries["excitation_direction"] = _degrees(run.direction)
    entries["sample_rate"] = _rate(run.rate) if run.rate != rate else None
    return entries


def _as_noted(run: PlannedRun, rig: VirtualRig) -> PlannedRun:
    """Give the run as somebody noted it, with that person's mistakes."""
    for fault in rig.faults:
        if not fault.affects(run.id):
            continue
        point, value = run.point, fault.size(0.0)
        if fault.kind == "wrong_pad" and isinstance(run.test, DryTest):
            run = replace(run, test=replace(run.test, pad=int(value)))
        elif fault.kind == "wrong_direction":
            run = replace(run, direction=run.direction + value)
        elif fault.kind == "wrong_frequency":
            run = replace(run, point=replace(point, excitation=point.excitation + hz(value)))
        elif fault.kind == "wrong_load":
            run = replace(run, point=replace(point, static_load=point.static_load * value))
    return run


def _degrees(angle: float) -> str:
    return f"{round(degrees(angle), 9) + 0.0:.10g} deg"


def _rate(rate: float) -> str:
    return f"{rate / 1e3:g} kHz" if rate >= 1e3 and rate % 1e3 == 0 else f"{rate:.10g} Hz"
