"""The ``[channels.*]`` tables of a manifest: channels, and one described otherwise for some runs (``[[..for]]``)."""

import fnmatch
import itertools
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from rigdata.calibration import (
    DIMENSIONS,
    VECTOR_QUANTITIES,
    Channel,
    ChannelResponse,
    Channels,
    parse_filter,
    parse_response_table,
    reading_gain,
    reading_zero,
)
from rigdata.manifest.fields import CHANNEL, RUNS_OF, SCHEMA, Findings, Table, nearest
from rigdata.problem import shown
from rigdata.units import UnitError, is_signal

_FIELD = {field.key: field for field in CHANNEL}
#: Entries that say where a sensor sits: a channel that is `like` another has its own.
_PLACE = ("axis", "pad", "position", "plane", "for")
_SENSITIVITY = ("sensitivity", "full_scale", "excitation")
_MAX_CHANNELS = 4096
#: Parts of a name that lead elsewhere in an HDF5 file; "Date/Time" is a name.
_PATH_STEPS = {"", ".", ".."}
#: Keys of a channel that cannot change from run to run.
_FIXED = ("like", "for")
_ENTRY = (RUNS_OF, *(field for field in CHANNEL if field.key not in _FIXED))
#: Patterns with a star are held against every run: more are refused.
_MOST_PATTERNS = 1000
_MOST_PLANES = 2


def read_channels(table: Table) -> dict[str, Channel]:
    """Read every channel; what is wrong is noted."""
    findings = table.findings
    channels: dict[str, Channel] = {}
    if not table.data:
        findings.error(("channels",), "no channels are described", "Add a [channels.NAME] table per column")
    if len(table.data) > _MAX_CHANNELS:
        findings.error(("channels",), f"more than {_MAX_CHANNELS} channels", "Is it the right file?")
        return channels
    tables = {name: table.subtable(name) for name in table.data}
    for name in sorted(tables, key=lambda n: "like" in tables[n].data):
        entry = tables[name]
        if "like" in entry.data and not _complete(entry, name, tables, channels):
            continue
        channel = read_channel(name, entry)
        if channel is not None:
            channels[name] = channel
    return {name: channels[name] for name in tables if name in channels}


def _complete(entry: Table, name: str, tables: dict[str, Table], read: dict[str, Channel]) -> bool:
    """Give a channel the entries of the one that it is `like`, but for its place; whether that can be read."""
    model = entry.value(_FIELD["like"])
    if model is None:
        return False
    if model not in tables or model == name or "like" in tables[model].data:
        described = [n for n, t in tables.items() if "like" not in t.data and n != name]
        entry.error("like", f"is no channel that is described in full ({shown(model)})", nearest(model, described))
        return False
    if model not in read:  # what is wrong with it has been said there
        return False
    for key, value in tables[model].data.items():
        if key not in _PLACE:
            entry.data.setdefault(key, value)
    return True


def read_channel(name: str, table: Table) -> Channel | None:
    """One channel; None where anything is wrong, which is then noted."""
    if not name.strip() or len(name) > 200 or not name.isprintable() or _PATH_STEPS & set(name.split("/")):
        table.only(CHANNEL)
        table.findings.error(table.path, f"channel name {shown(name)} cannot be used", "Use letters and digits")
        return None
    quantity = table.value(_FIELD["quantity"])
    if quantity is None or quantity == "ignore":
        table.only(CHANNEL)
        return Channel(name, "ignore") if quantity else None
    directed = quantity in VECTOR_QUANTITIES or quantity == "command"
    errors = table.findings.errors
    values = table.read(CHANNEL, ["axis"] * directed + ["unit"] * (quantity in DIMENSIONS))
    values |= {"unit": values["unit"] or "", "gain": 1.0, "zero": 0.0}
    if quantity in DIMENSIONS:
        values |= _calibration(table, quantity, values["unit"])
    elif values["zero_uncertainty"]:
        table.error("zero_uncertainty", f"a {quantity} channel has no zero", "Delete zero_uncertainty")
    response = _response(table, values)
    if table.findings.errors > errors:
        return None
    entries = {key: value for key, value in values.items() if key in Channel.__dataclass_fields__}
    return Channel(name, response=response, **entries)


def _response(table: Table, values: dict[str, Any]) -> ChannelResponse:
    """Filter and delay; what is wrong is noted and left out."""
    responses = list[Any]()
    if values["filter"] is not None:
        with table.noted("filter", "Or give filter_table, a measured response"):
            responses.append(parse_filter(values["filter"]))
    file, text_of = values["filter_table"], table.findings.files
    if file is not None:
        with table.noted("filter_table", f"Give lines of frequency_Hz, gain, phase_deg in {shown(file)}"):
            responses.append(parse_response_table(text_of(file, ".".join(map(str, table.path)))))
    return ChannelResponse(tuple(responses), values["delay"])


def _calibration(table: Table, quantity: str, unit: str) -> dict[str, float]:
    """Gain and zero of a channel with a unit, and the uncertainty of the zero; what is wrong is noted."""
    data, values = table.data, dict[str, float]()
    field = replace(_FIELD["zero_uncertainty"], kind=DIMENSIONS[quantity])
    values["zero_uncertainty"] = table.value(field)
    if not unit:
        return values
    sensitivity = [data.get(key) for key in _SENSITIVITY]
    with table.noted("sensitivity" if "sensitivity" in data else "unit", f"See the channel tables of {SCHEMA}"):
        values["gain"] = reading_gain(quantity, unit, *sensitivity)
        if not 0.0 < values["gain"] < 1e30:
            raise UnitError(f"one {unit} would be {values['gain']:g} SI")
        for key in data if not is_signal(unit) else ():
            if key in _SENSITIVITY:  # said, so that none is believed to act
                text = f"{key} is not used: readings in {unit} are already converted"
                remedy = f"Delete {key}, or set unit to what the logger recorded"
                table.findings.error((*table.path, key), text, remedy, severity="warning")
    with table.noted("zero", f"Give the {quantity} at reading zero"):
        values["zero"] = reading_zero(quantity, unit, data.get("zero"))
    return values


def channels_by_run(table: Table, channels: Channels, runs: Sequence[str]) -> dict[str, Channels]:
    """Channels of the runs that describe one otherwise; what is wrong is noted."""
    findings = table.findings
    _check_together(channels, findings)
    entries = defaultdict(list)  # of a run: channel and entry, in the manifest's order
    budget = itertools.count(1)
    for name in channels:
        for run, entry in _entries(table.subtable(name), runs, budget):
            entries[run].append((name, entry))
    described = {}
    variants = {}
    for run, changes in entries.items():
        key = tuple(id(entry) for _, entry in changes)
        if key not in variants:
            variants[key] = _changed(table, channels, changes)
            _check_together(variants[key], findings)
        described[run] = variants[key]
    return described


def _entries(channel: Table, runs: Sequence[str], budget: Iterator[int]) -> list[tuple[str, Table]]:
    """Run and entry, for every run that an entry names."""
    entries = channel.data.get("for", [])
    if not isinstance(entries, list):
        channel.error("for", f"is {shown(entries)}, not a list of tables", f"Write [[channels.{channel.path[-1]}.for]]")
        return []
    pairs = []
    for index, data in enumerate(entries):
        entry = Table(data, (*channel.path, "for", index), channel.findings)
        entry.only(_ENTRY)
        named = _matching(entry, runs, budget)
        pairs += [(run, entry) for run in runs if run in named]
    return pairs


def _matching(entry: Table, runs: Sequence[str], budget: Iterator[int]) -> set[str]:
    """Runs that the patterns of an entry name; `budget` counts the patterns with a star."""
    patterns = entry.value(RUNS_OF)
    named = set()
    run_names = set(runs)
    for pattern in patterns or ():
        matches = {pattern} & run_names
        if "*" in pattern:
            if next(budget) > _MOST_PATTERNS:
                entry.error("runs", f"more than {_MOST_PATTERNS} patterns with a star in all", "Join them")
                return set()
            literal = pattern.replace("[", "[[]").replace("?", "[?]")
            matches = {run for run in runs if fnmatch.fnmatchcase(run, literal)}
        if not matches:
            entry.error("runs", f"no run is named by {shown(pattern)}", nearest(pattern, runs)[:200])
        named.update(matches)
    return named


def _changed(table: Table, channels: Channels, changes: Sequence[tuple[str, Table]]) -> Channels:
    """All channels of a run, some with other entries: the last one counts, key by key."""
    merged = {}
    for name, entry in changes:
        if name not in merged:
            merged[name] = Table(dict(table.data[name]), (*table.path, name), table.findings)
        for key, value in entry.data.items():
            if key not in ("runs", *_FIXED):
                merged[name].data[key] = value
                merged[name].origins[key] = (*entry.path, key)
    described = dict(channels)
    for name, entry in merged.items():
        described[name] = read_channel(name, entry) or described[name]
    return described


def _check_together(channels: Channels, findings: Findings) -> None:
    """Note clocks with two time columns or without a channel, and quantities in more than two planes."""
    used = [channel for channel in channels.values() if channel.quantity != "ignore"]
    clocks = {channel.clock for channel in used if channel.quantity != "time"}
    times = [channel for channel in used if channel.quantity == "time" and channel.clock]
    counts = Counter(channel.clock for channel in times)
    for channel in times:
        path = ("channels", channel.name, "clock")
        if counts[channel.clock] > 1:
            text = f"clock {shown(channel.clock)} has {counts[channel.clock]} time columns"
            findings.error(path, text, "Give every device a letter of its own")
        elif channel.clock not in clocks:
            text = f"no channel has the clock {shown(channel.clock)} of this time column"
            findings.error(path, text, f"Add clock = {shown(channel.clock)} to its channels, or delete it here")
    for quantity in VECTOR_QUANTITIES:
        planes = {channel.plane: channel.name for channel in used if channel.quantity == quantity}
        if len(planes) > _MOST_PLANES:
            listed = ", ".join(f"{1e3 * plane:g} mm" for plane in list(planes)[:6])
            text = f"{quantity} channels are in {len(planes)} planes ({listed})"
            findings.error(("channels", list(planes.values())[-1], "plane"), text, "Describe two planes at most")
