"""The ``[channels.*]`` tables of a manifest."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigdata.calibration import (
    DIMENSIONS,
    UNCALIBRATED,
    VECTOR_QUANTITIES,
    Channel,
    reading_gain,
    reading_zero,
)
from rigdata.channel_response import ChannelResponse, parse_filter, parse_response_table
from rigdata.manifest.table import Findings, Table, nearest, shown
from rigdata.problem import RigDataError
from rigdata.units import UnitError, is_signal

_KEYS = (
    "like",
    "quantity",
    "axis",
    "unit",
    "sensitivity",
    "polarity",
    "uncertainty",
    "full_scale",
    "excitation",
    "pad",
    "position",
    "zero",
    "axis_uncertainty",
    "delay",
    "delay_uncertainty",
    "filter",
    "filter_table",
    "clock",
    "zero_uncertainty",
)
#: Entries that say where a sensor sits: a channel that is `like` another has its own.
_PLACE = ("axis", "pad", "position")
_QUANTITIES = (*DIMENSIONS, *UNCALIBRATED, "ignore")
#: Gives the text of a file of the campaign, by its name in the manifest; raises RigDataError.
TextFile = Callable[[str, str], str]
#: Delays beyond this are another run's [s].
_MAX_DELAY = 10.0
_MAX_CHANNELS = 4096


#: Parts of a name that lead elsewhere in an HDF5 file; "Date/Time" is a name.
_PATH_STEPS = {"", ".", ".."}


def read_channels(table: Table, findings: Findings, files: TextFile | None = None) -> dict[str, Channel]:
    """Read every channel; what is wrong is noted in `findings`, and that channel left out."""
    channels: dict[str, Channel] = {}
    if not table.data:
        findings.error(("channels",), "no channels are described", "Add a [channels.NAME] table per column")
    if len(table.data) > _MAX_CHANNELS:
        findings.error(("channels",), f"more than {_MAX_CHANNELS} channels", "Is it the right file?")
        return channels
    tables = {name: table.subtable(name) for name in table.data}
    for name in sorted(tables, key=lambda n: "like" in tables[n].data):
        own = tables[name]
        if "like" in own.data and not _complete(own, name, tables, channels):
            continue
        before = len(findings.problems)
        channel = _read_channel(name, own, files)
        if not any(p.severity == "error" for p in findings.problems[before:]) and channel is not None:
            channels[name] = channel
    channels = {name: channels[name] for name in tables if name in channels}
    if sum(c.quantity == "time" for c in channels.values()) > 1:
        findings.error(("channels",), "more than one channel is the time", 'Set the others to quantity = "ignore"')
    return channels


def _complete(own: Table, name: str, tables: dict[str, Table], read: dict[str, Channel]) -> bool:
    """Give a channel the entries of the one that it is `like`, but for its place; whether that can be read."""
    model = own.text("like")
    if model is None:
        return False
    if model not in tables or model == name or "like" in tables[model].data:
        known = [n for n, t in tables.items() if "like" not in t.data and n != name]
        own.error("like", f"is no channel that is described in full ({shown(model)})", nearest(model, known))
        return False
    if model not in read:  # what is wrong with it has been said there
        return False
    own.data.update({k: v for k, v in tables[model].data.items() if k not in own.data and k not in _PLACE})
    return True


def _read_channel(name: str, table: Table, files: TextFile | None) -> Channel | None:
    table.only(_KEYS, f"[channels.{name[:40]}]")
    if not name.strip() or len(name) > 200 or not name.isprintable() or _PATH_STEPS & set(name.split("/")):
        table.findings.error(table.path, f"channel name {shown(name)} cannot be used", "Use letters and digits")
        return None
    quantity = table.choice("quantity", _QUANTITIES, required=True)
    if quantity is None or quantity == "ignore":
        return Channel(name, "ignore") if quantity else None
    plain = quantity in UNCALIBRATED
    unit = table.text("unit", required=not plain) or ("" if plain else None)
    directed = quantity in VECTOR_QUANTITIES or quantity == "command"
    axis = table.quantity("axis", "angle", required=directed)
    polarity = table.data.get("polarity", 1)
    if isinstance(polarity, bool) or polarity not in (1, -1):
        table.error("polarity", f"polarity is {shown(polarity)}", "Give 1 or -1, without quotes")
        return None
    position = table.quantity("position", "ratio", low=0.0)
    if position is not None and position > 1.0:
        table.error("position", f"position is {position:g}", "It is the fraction of the arc, 0 to 1")
    gain, zero = (1.0, 0.0) if plain else _calibration(table, quantity, unit)
    if gain is None or zero is None or unit is None:
        return None
    return Channel(
        name=name,
        quantity=quantity,
        unit=unit,
        gain=gain,
        zero=zero,
        polarity=int(polarity),
        axis=axis,
        uncertainty=_uncertainty(table),
        pad=table.integer("pad", low=1, high=100),
        position=position,
        axis_uncertainty=table.quantity("axis_uncertainty", "angle", low=0.0) or 0.0,
        response=_response(table, files),
        delay_uncertainty=table.quantity("delay_uncertainty", "time", low=0.0) or 0.0,
        zero_uncertainty=_zero_uncertainty(table, quantity),
        clock=table.text("clock") or "",
    )


def _zero_uncertainty(table: Table, quantity: str) -> float:
    if "zero_uncertainty" not in table.data:
        return 0.0
    if quantity not in DIMENSIONS:
        table.error("zero_uncertainty", f"a {quantity} channel has no zero", "Delete zero_uncertainty")
        return 0.0
    return table.quantity("zero_uncertainty", DIMENSIONS[quantity], low=0.0) or 0.0


def _response(table: Table, files: TextFile | None) -> ChannelResponse:
    """Filter and delay; what is wrong is noted and left out."""
    delay = table.quantity("delay", "time") or 0.0
    if abs(delay) > _MAX_DELAY:
        table.error("delay", f"delay is {shown(table.data['delay'])}", f"It must be below {_MAX_DELAY:g} s")
    found: list[Any] = []
    stated, file = table.text("filter"), table.text("filter_table")
    try:
        if stated is not None:
            found.append(parse_filter(stated))
    except UnitError as error:
        table.error("filter", f"filter: {error}", "Or give filter_table, a measured response")
    if file is not None and files is None:
        table.error("filter_table", "a table cannot be read here", "Give filter, or a campaign in a folder")
    elif file is not None and files is not None:
        try:
            found.append(parse_response_table(files(file, ".".join(str(p) for p in table.path))))
        except UnitError as error:
            table.error("filter_table", f"{shown(file)}: {error}", "Give lines of frequency_Hz, gain, phase_deg")
        except RigDataError as error:
            table.findings.problems.extend(error.problems)
    return ChannelResponse(tuple(found), delay)


def _uncertainty(table: Table) -> float | None:
    value = table.quantity("uncertainty", "ratio", low=0.0)
    if value is not None and value >= 1.0:
        table.error(
            "uncertainty",
            f"uncertainty is {shown(table.data['uncertainty'])}",
            'Give e.g. "1 %", below 100 %',
        )
    return value


def _calibration(table: Table, quantity: str, unit: str | None) -> tuple[float | None, float | None]:
    gain = zero = None
    if unit is None:
        return None, None
    data = table.data
    try:
        gain = reading_gain(quantity, unit, data.get("sensitivity"), data.get("full_scale"), data.get("excitation"))
    except UnitError as error:
        key = "unit" if "sensitivity" not in data else "sensitivity"
        table.error(key, f"{quantity} channel: {error}", "See the channel tables of the tpjb-rig/1 format")
    else:
        if not 0.0 < gain < 1e30:
            table.error("sensitivity", f"one {unit} would be {gain:g} SI", "Check the calibration")
        _note_unused(table, unit)
    try:
        zero = reading_zero(quantity, unit, data.get("zero"))
    except UnitError as error:
        table.error("zero", f"zero: {error}", f"Give the {quantity} at reading zero")
    return gain, zero


def _note_unused(table: Table, unit: str) -> None:
    """Say which parts of a calibration are not used, so that none is believed to act."""
    if is_signal(unit):
        return
    for key in ("sensitivity", "full_scale", "excitation"):
        if key in table.data:
            table.findings.add(
                "warning",
                (*table.path, key),
                f"{key} is not used: readings in {unit} are already converted",
                f"Delete {key}, or set unit to what the logger recorded",
            )
