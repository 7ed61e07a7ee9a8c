"""How a campaign is laid out on disk: a folder of CSV in some dialect, or one HDF5 file, each with its manifest."""

import json
from dataclasses import dataclass, replace
from math import degrees

from rigdata.operating_point import ROTATIONS
from rigdata.virtual_rig.faults import Fault
from rigdata.virtual_rig.instruments import Sensor
from rigdata.virtual_rig.plan import DryTest, PlannedRun
from rigdata.virtual_rig.rig import VirtualRig
from rigdata.virtual_rig.truth import PAPER_RIG, VirtualRigError, hz


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


@dataclass(frozen=True)
class Hdf5Layout:
    """One HDF5 file, a group per run, a dataset per channel."""

    time_name: str = ""


Layout = CsvLayout | Hdf5Layout

_LAYOUTS: dict[str, Layout] = {"hdf5": Hdf5Layout()}
_LAYOUTS |= {name: CsvLayout(**entries) for name, entries in PAPER_RIG["layouts"].items()}


def layout_named(layout: str | Layout) -> Layout:
    """Layout by its name; one that is already a layout is returned as it is."""
    if not isinstance(layout, str):
        return layout
    if layout not in _LAYOUTS:
        raise VirtualRigError(f"no layout {layout!r}; there are {', '.join(_LAYOUTS)}")
    return _LAYOUTS[layout]


def manifest_text(rig: VirtualRig, layout: Layout) -> str:
    """Write the manifest (`tpjb-rig/1`)."""
    runs, truth = rig.runs(), rig.truth
    rates = [run.rate for run in runs]
    rate, rotation = max(set(rates), key=rates.count), runs[0].point.rotation
    header = {"schema": "tpjb-rig/1", "id": rig.campaign, "bearing": truth.bearing_name}
    blocks = [
        _table("", {**header, "description": rig.description}),
        _table("[housing]", {"mass": f"{rig.instruments.housing_mass:.10g} kg"}),
        _table("[acquisition]", {"sample_rate": _rate(rate)}),
    ]
    if isinstance(layout, CsvLayout) and layout.declared:
        line = len(layout.preamble) + 1
        dialect = {key: getattr(layout, key) for key in ("delimiter", "decimal", "encoding")}
        lines = {"header_line": line, "units_line": line + 1 if layout.units_line else None}
        blocks.append(_table("[csv]", dialect | lines))
    if layout.time_name:
        blocks.append(_table(f"[channels.{layout.time_name}]", {"quantity": "time", "unit": "s"}))
    blocks += [_channel(sensor) for sensor in rig.instruments.sensors]
    if rotation != ROTATIONS[0]:
        blocks.append(_table("[shaft]", {"rotation": rotation}))
    blocks += [_run(_as_noted(run, rig.faults), layout, rate, rotation) for run in runs]
    return "\n".join(blocks)


def _table(title: str, entries: dict[str, object]) -> str:
    """A table of the manifest; entries without a value are left out."""
    lines = [title] if title else []
    for key, value in entries.items():
        if value is not None:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def _channel(sensor: Sensor) -> str:
    entries: dict[str, object] = {
        "quantity": sensor.quantity,
        "axis": None if sensor.axis is None else _degrees(sensor.axis),
        "pad": sensor.pad,
        "position": sensor.position,
        "unit": sensor.unit,
        **sensor.calibration,
        "polarity": sensor.polarity if sensor.polarity < 0 else None,
        "uncertainty": f"{100 * sensor.uncertainty:g} %" if sensor.uncertainty else None,
    }
    return _table(f"[channels.{sensor.name}]", entries)


def _run(run: PlannedRun, layout: Layout, rate: float, rotation: str) -> str:
    test, point = run.test, run.point
    entries: dict[str, object] = {
        "id": run.id,
        "file": f"runs/{run.record}.csv" if isinstance(layout, CsvLayout) else None,
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
    return _table("[[runs]]", entries)


def _as_noted(run: PlannedRun, faults: tuple[Fault, ...]) -> PlannedRun:
    """Give the run as somebody noted it, with that person's mistakes."""
    for fault in faults:
        point, value = run.point, fault.size(0.0)
        if not fault.affects(run.id):
            continue
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
