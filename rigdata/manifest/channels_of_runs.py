"""One column described otherwise for some runs (``[[channels.X1A.for]]``), and what channels must agree in."""

from __future__ import annotations

import fnmatch
import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.manifest.channels import TextFile, read_channel
from rigdata.manifest.fields import CHANNEL, RUNS_OF, Findings, Table, nearest, shown

#: Keys of a channel that cannot change from run to run.
_FIXED = ("like", "for")
_ENTRY = (RUNS_OF, *(field for field in CHANNEL if field.key not in _FIXED))
#: Patterns with a star are held against every run: more are refused.
_MOST_PATTERNS = 1000
_MOST_PLANES = 2


def channels_by_run(
    table: Table, channels: Mapping[str, Channel], runs: Sequence[str], files: TextFile | None
) -> dict[str, Mapping[str, Channel]]:
    """Channels of the runs that describe one otherwise; what is wrong is noted."""
    findings = table.findings
    _check_together(channels, findings)
    entries: dict[str, list[tuple[str, Table]]] = {}  # of a run: channel and entry, in the manifest's order
    budget = itertools.count(1)
    for name in channels:
        for run, entry in _entries(table.subtable(name), runs, budget):
            entries.setdefault(run, []).append((name, entry))
    described: dict[str, Mapping[str, Channel]] = {}
    known: dict[tuple[int, ...], Mapping[str, Channel]] = {}
    for run, changes in entries.items():
        key = tuple(id(entry) for _, entry in changes)
        if key not in known:
            known[key] = _changed(table, channels, changes, files)
            _check_together(known[key], findings)
        described[run] = known[key]
    return described


def _entries(channel: Table, runs: Sequence[str], budget: Iterator[int]) -> list[tuple[str, Table]]:
    """Run and entry, for every run that an entry names."""
    entries = channel.data.get("for", [])
    if not isinstance(entries, list):
        channel.error("for", f"is {shown(entries)}, not a list of tables", f"Write [[channels.{channel.path[-1]}.for]]")
        return []
    pairs: list[tuple[str, Table]] = []
    for index, data in enumerate(entries):
        entry = Table(data, (*channel.path, "for", index), channel.findings)
        entry.only(_ENTRY, f"[[channels.{channel.path[-1]}.for]]")
        named = _matching(entry, runs, budget)
        pairs += [(run, entry) for run in runs if run in named]
    return pairs


def _matching(entry: Table, runs: Sequence[str], budget: Iterator[int]) -> set[str]:
    """Runs that the patterns of an entry name; `budget` counts the patterns with a star."""
    patterns = entry.value(RUNS_OF)
    if not isinstance(patterns, list) or not patterns or not all(isinstance(p, str) for p in patterns):
        if patterns is not None:
            entry.error("runs", f"runs is {shown(patterns)}, no list of texts", 'Write runs = ["p-*", "c-1"]')
        return set()
    named: set[str] = set()
    known = set(runs)
    for pattern in patterns:
        matches = {pattern} & known
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


def _changed(
    table: Table, channels: Mapping[str, Channel], changes: Sequence[tuple[str, Table]], files: TextFile | None
) -> Mapping[str, Channel]:
    """All channels of a run, some with other entries: the last one counts, key by key."""
    merged: dict[str, Table] = {}
    for name, entry in changes:
        if name not in merged:
            merged[name] = Table(dict(table.data[name]), (*table.path, name), table.findings)
        for key, value in entry.data.items():
            if key not in ("runs", *_FIXED):
                merged[name].data[key] = value
                merged[name].origins[key] = (*entry.path, key)
    described = dict(channels)
    for name, entry in merged.items():
        described[name] = read_channel(name, entry, files) or described[name]
    return described


def _check_together(channels: Mapping[str, Channel], findings: Findings) -> None:
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
            text = f"{quantity} channels are in {len(planes)} planes ({_millimetres(planes)})"
            findings.error(("channels", list(planes.values())[-1], "plane"), text, "Describe two planes at most")


def _millimetres(planes: Mapping[float, str]) -> str:
    return ", ".join(f"{1e3 * plane:g} mm" for plane in list(planes)[:6])
