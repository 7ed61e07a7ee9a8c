"""Writing a campaign as a folder of CSV files in a given dialect."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil, log10
from pathlib import Path

import numpy as np

from rigdata.virtual_rig.faults import Fault
from rigdata.virtual_rig.instruments import Sensor
from rigdata.virtual_rig.layout import CsvLayout
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig
from rigdata.virtual_rig.sensing import converter_step

UNQUANTISED_BITS = 36  # without a converter, digits are written as if it had this many bits


def write_csv(folder: Path, rig: VirtualRig, manifest: str, records: Iterable[SimulatedRun], layout: CsvLayout) -> None:
    """Write manifest, bearing and all records into an existing, empty folder.

    Parameters
    ----------
    folder : Path
    rig : VirtualRig
    manifest : str
        Text of the manifest.
    records : iterable of SimulatedRun
    layout : CsvLayout
    """
    (folder / "campaign.toml").write_bytes(manifest.encode())
    (folder / rig.truth.bearing_name).write_bytes(rig.truth.bearing_text.encode())
    (folder / "runs").mkdir()
    for record in records:
        faults = rig.faults_of(record.run.id)
        if any(f.kind == "missing_file" for f in faults):
            continue
        text = _record_text(record, rig, layout, faults)
        (folder / "runs" / f"{record.run.id}.csv").write_bytes(text.encode(layout.encoding))


def _record_text(record: SimulatedRun, rig: VirtualRig, layout: CsvLayout, faults: tuple[Fault, ...]) -> str:
    sensors = [s for s in rig.instruments.sensors if not _struck("missing_channel", faults, s.name)]
    twice = [s for s in sensors if _struck("duplicate_column", faults, s.name)]
    names = [s.name for s in (*sensors, *twice)]
    units = [s.unit for s in (*sensors, *twice)]
    columns = [record.readings.columns[name] for name in names]
    forms = [f"%.{decimals(s, rig.noise.bits)}f" for s in (*sensors, *twice)]
    if layout.time_name is not None:
        names, units = [layout.time_name, *names], ["s", *units]
        columns = [record.readings.time, *columns]
        forms = [_time_form(record.readings.rate), *forms]
    count = 0 if any(f.kind == "empty_file" for f in faults) else len(record.readings.time)
    tail = layout.delimiter if layout.trailing_delimiter else ""
    head = [line.format(rate=f"{record.readings.rate:g}", count=count) for line in layout.preamble]
    head.append(layout.delimiter.join(names) + tail)
    if layout.units_line:
        head.append(layout.delimiter.join(units) + tail)
    body = _rows(np.stack(columns, axis=1)[:count], forms, layout, tail)
    if any(f.kind == "truncated_line" for f in faults) and body:
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


def decimals(sensor: Sensor, bits: int | None) -> int:
    """Decimals that keep a hundredth of a converter step.

    Parameters
    ----------
    sensor : Sensor
    bits : int or None
        Of the converter; None for none.
    """
    return max(0, ceil(-log10(converter_step(sensor, bits or UNQUANTISED_BITS))) + 2)


def _time_form(rate: float) -> str:
    return "%.6f" if (1e6 / rate).is_integer() else "%.9f"


def _struck(kind: str, faults: tuple[Fault, ...], channel: str) -> bool:
    return any(f.kind == kind and f.strikes("*", channel) for f in faults)
