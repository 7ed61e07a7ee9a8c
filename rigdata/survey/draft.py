"""A commented draft of a manifest: what the exports show is filled in, the remainder is marked."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.manifest.fields import ACQUISITION, CHANNEL, HOUSING, KINDS, MAINS_FREQUENCIES, RUN, draft_line
from rigdata.survey.exports import Export
from rigdata.survey.guess import (
    ChannelGuess,
    RunGuess,
    guess_channel,
    guess_run,
    quantity_of_unit,
    strongest_lines,
)

#: Stands where only the person at the rig knows; no parser takes it for a value.
MARK = "??"
_DIRECTED = ("displacement", "force", "acceleration")
_EXAMPLE = {
    "displacement": '"7.78 mV/um"',
    "force": '"2.0 mV/V", with full_scale and excitation of the bridge, or "1 mV/N"',
    "acceleration": '"10 mV/g"',
    "temperature": '"15 K/V", with zero = "0 degC"',
    "pressure": '"1 V/bar"',
    "speed": '"100 mV/Hz"',
}
_NEAR = 0.02
#: Directions [deg] no farther apart than this are meant to be one.
_ALIKE = 3.0
_MAINS_NEAR = 0.005
#: Speeds that differ by no more than this factor are one set point; a round number so near is meant.
_ONE_SPEED, _ROUND = 1.015, 0.003
#: Share of the running records in which the shaft speed must show.
_MOST_OF = 0.8


@dataclass(frozen=True)
class Survey:
    """What was found in a folder of exports."""

    rates: tuple[float, ...]
    channels: dict[str, ChannelGuess]
    runs: tuple[RunGuess, ...]
    speed_line: float = float("nan")
    clock: str = ""
    nameless: int = 0
    per_hertz: dict[str, float] = field(default_factory=dict)


def survey(exports: Sequence[Export], described: Mapping[str, ChannelGuess] | None = None) -> Survey:
    """Guess channels and runs of a folder of exports."""
    channels: dict[str, ChannelGuess] = {}
    for export in exports:
        for series in export.series:
            if series.name not in channels:
                guess = guess_channel(series.name, series.unit)
                channels[series.name] = _with_manifest(guess, (described or {}).get(series.name))
    quantities = {name: guess.quantity for name, guess in channels.items()}
    runs = _common_speeds(_one_direction([guess_run(export, channels) for export in exports]))
    line = _common_line(exports, quantities, runs)
    return Survey(
        rates=tuple(e.rate for e in exports),
        channels=channels,
        runs=runs,
        speed_line=line,
        per_hertz=_tachometers(exports, channels, runs, line),
        clock=next((e.clock for e in exports if e.clock), ""),
        nameless=max((e.nameless for e in exports), default=0),
    )


def _with_manifest(guess: ChannelGuess, manifest_guess: ChannelGuess | None) -> ChannelGuess:
    if manifest_guess is None:
        return guess
    if manifest_guess.quantity and manifest_guess.quantity != guess.quantity:
        guess = replace(guess, quantity=manifest_guess.quantity, axis="", why=manifest_guess.why)
    return replace(guess, unit=manifest_guess.unit or guess.unit, axis=manifest_guess.axis or guess.axis)


def _one_direction(runs: Sequence[RunGuess]) -> tuple[RunGuess, ...]:
    """Directions within a few degrees of each other become the same: -89 and -91 deg are a load on one pad."""

    def close(group: list[float], angle: float) -> bool:
        return angle - group[-1] <= _ALIKE and angle - group[0] <= 2 * _ALIKE

    def rounded(middle: float) -> float:
        nearby = 45.0 * round(middle / 45.0)  # an axis, or between two; pads may be anywhere
        return nearby if abs(nearby - middle) <= _ALIKE / 2 else middle

    set_points = _common([r.direction for r in runs], close, rounded)
    return tuple(replace(r, direction=set_points.get(r.direction, r.direction)) for r in runs)


def _common_speeds(runs: Sequence[RunGuess]) -> tuple[RunGuess, ...]:
    """Speeds within a per cent or so of each other are one set point: a tachometer shows what came of it."""

    def rounded(middle: float) -> float:
        nearby = float(f"{middle:.2g}")  # 21.99 Hz was meant to be 22 Hz
        return nearby if abs(nearby - middle) <= _ROUND * middle else float(f"{middle:.4g}")

    set_points = _common([r.speed for r in runs], lambda group, speed: speed <= _ONE_SPEED * group[0], rounded)
    return tuple(replace(r, speed=set_points.get(r.speed, r.speed)) for r in runs)


def _common(
    values: Sequence[float], close: Callable[[list[float], float], bool], rounded: Callable[[float], float]
) -> dict[float, float]:
    """What every finite value was meant to be: the middle of its group of values that are alike, rounded."""
    groups: list[list[float]] = []
    for value in sorted({v for v in values if math.isfinite(v)}):
        if groups and close(groups[-1], value):
            groups[-1].append(value)
        else:
            groups.append([value])
    set_points: dict[float, float] = {}
    for group in groups:
        members = sorted(v for v in values if v in group)
        set_points |= dict.fromkeys(group, rounded(members[len(members) // 2]))
    return set_points


def _tachometers(
    exports: Sequence[Export], channels: Mapping[str, ChannelGuess], runs: Sequence[RunGuess], line: float
) -> dict[str, float]:
    """Reading per hertz of speed channels in volts, where it is one in all running records."""
    per_hertz: dict[str, float] = {}
    if not math.isfinite(line):
        return per_hertz
    ratios: dict[str, list[float]] = {}
    for export, run in zip(exports, runs, strict=True):
        for series in export.series if run.kind in ("dynamic", "locus") else ():
            guess = channels[series.name]
            if guess.quantity == "speed" and not quantity_of_unit(guess.unit):
                ratios.setdefault(series.name, []).append(float(np.nanmedian(series.values)) / line)
    for name, values in ratios.items():
        low, high = min(values), max(values)
        if low > 0 and high - low <= _NEAR * high:
            per_hertz[name] = sorted(values)[len(values) // 2]
    return per_hertz


def _is_mains(frequency: float) -> bool:
    return any(abs(frequency - mains) < _MAINS_NEAR * mains for mains in MAINS_FREQUENCIES)


def _common_line(exports: Sequence[Export], quantities: dict[str, str], runs: Sequence[RunGuess]) -> float:
    """Line that every running record's displacement holds, besides its own excitation."""
    running = []
    for export, run in zip(exports, runs, strict=True):
        if run.kind in ("dynamic", "locus"):
            peaks = strongest_lines([s for s in export.series if quantities.get(s.name) == "displacement"])
            driven = run.lines[0].frequency if run.kind == "dynamic" and run.lines else -1.0
            running.append([p.frequency for p in peaks if abs(p.frequency - driven) > _NEAR * p.frequency])
    if len(running) < 2:
        return float("nan")
    frequencies = np.sort(np.concatenate(running))
    # the mains are in every record as well: they are the speed only where nothing else is
    for candidate in sorted(set(frequencies.tolist()), key=lambda f: (_is_mains(f), f)):
        near = frequencies[np.abs(frequencies - candidate) < _NEAR * candidate]
        if len(near) >= _MOST_OF * len(running):
            half = frequencies[np.abs(2 * frequencies - candidate) < _NEAR * candidate]
            speeds = half if 2 * len(half) >= len(near) else near  # an oval shaft shows twice its speed more often
            return float(speeds[len(speeds) // 2])
    return float("nan")


def draft_manifest(surveyed: Survey, name: str, bearing: str | None) -> str:
    """Write the text of a draft."""
    lines = [
        "# Draft by `tpjb init`. Places marked ?? only you can know; what is marked (guess) is worth a look.",
        "# After changes to channels, `tpjb init --update` guesses the rest anew; `tpjb check` lists what is left.",
        "# Signs and frame: docs/guide/mounting.md",
        'schema = "tpjb-rig/1"',
        f"id = {_toml_string(name)}",
        f"bearing = {_toml_string(bearing)}" if bearing else f'bearing = "{MARK}"   # bearing file, in this folder',
        'description = ""',
        "",
        "[housing]",
        draft_line(HOUSING, "mass", f'"{MARK} kg"'),
        "",
    ]
    if not all(rate > 0 for rate in surveyed.rates):
        lines += ["[acquisition]", draft_line(ACQUISITION, "sample_rate", f'"{MARK} Hz"'), ""]
    if surveyed.nameless:
        names = ", ".join(_toml_string(f"column{i + 1}") for i in range(surveyed.nameless))
        lines += ["[csv]", f"names = [{names}]   # the files have none: write yours here and below, then --update", ""]
    if surveyed.clock:
        head = f"[channels.{_key(surveyed.clock)}]"
        unit = 'unit = "s"   # (guess); times of day become seconds'
        lines += [head, 'quantity = "time"   # (guess) by its name', unit, ""]
    for block in channel_blocks(surveyed).values():
        lines += [*block, ""]
    for run in surveyed.runs:
        lines += [*run_lines(run, surveyed), ""]
    return "\n".join(lines).rstrip() + "\n"


def channel_blocks(surveyed: Survey) -> dict[str, list[str]]:
    """Lines of every channel's table; sensors of one kind and unit are described once, the others are `like` it."""
    first: dict[tuple[str, str], str] = {}
    blocks = {}
    for name, guess in surveyed.channels.items():
        kind = (guess.quantity, guess.unit)
        open_still = guess.quantity in _EXAMPLE and quantity_of_unit(guess.unit) == ""
        model = first.setdefault(kind, name) if open_still else name
        blocks[name] = _channel_lines(name, guess, "" if model == name else model)
        if name in surveyed.per_hertz and guess.unit:
            ratio = f"{surveyed.per_hertz[name]:.4g} {guess.unit}/Hz"
            text = f'sensitivity = "{ratio}"   # (guess) the probes show the speed'
            blocks[name] = [text if line.startswith("sensitivity") else line for line in blocks[name]]
    return blocks


def _channel_lines(name: str, guess: ChannelGuess, like: str) -> list[str]:
    head = f"[channels.{_key(name)}]"
    if not guess.quantity or guess.quantity == "ignore":
        return [head, f'quantity = "ignore"   # (guess) {guess.why}; or displacement, force, acceleration, ..']
    lines = [head, f'quantity = "{guess.quantity}"   # (guess) {guess.why}']
    if guess.quantity in _DIRECTED:
        if guess.axis:
            lines.append(f'axis = "{guess.axis}"   # (guess) by its name')
        else:
            lines.append(draft_line(CHANNEL, "axis", f'"{MARK} deg"'))
    if like:
        remark = "(guess) a sensor of the same type; or its own unit, sensitivity, .."
        lines.append(f"like = {_toml_string(like)}   # {remark}")
    else:
        lines.append(f'unit = "{guess.unit or MARK}"')
        if quantity_of_unit(guess.unit) == "":
            lines.append(f'sensitivity = "{MARK}"   # such as {_EXAMPLE.get(guess.quantity, "1 V per unit")}')
        if guess.quantity == "displacement":
            lines.append(f"# {draft_line(CHANNEL, 'polarity', '-1')}")
    if guess.quantity == "temperature":
        pad = re.search(r"(?:pad|t|tc|temp\w*?)[-_ #]*(\d{1,2})(?!\d)", name, re.IGNORECASE)
        lines.append(f"pad = {int(pad[1])}   # (guess) by its name" if pad and int(pad[1]) else "# pad = 1")
        lines.append(f"# {draft_line(CHANNEL, 'position', '0.75')}")
    return lines


def run_lines(run: RunGuess, surveyed: Survey) -> list[str]:
    """Lines of a run's table."""
    stem = run.file.rpartition("/")[2].rpartition(".")[0]
    kind = f'kind = "{MARK}"   # {", ".join(KINDS)}'
    if run.kind:
        kind = f'kind = "{run.kind}"   # (guess) {run.why}'
    lines = ["[[runs]]", f"id = {_toml_string(stem)}", f"file = {_toml_string(run.file)}", kind]
    if run.kind in ("dynamic", "locus", ""):
        if math.isfinite(run.speed):
            lines.append(_line("shaft_speed", run.speed, "Hz", run.why_speed))
        else:
            mains = "; it may be the mains" if _is_mains(surveyed.speed_line) else ""
            lines.append(_line("shaft_speed", surveyed.speed_line, "Hz", f"most records hold this line{mains}"))
        lines.append(_line("static_load", run.load / 1e3, "kN", "by the file's name"))
    if run.kind == "dry_pivot":
        guess = f"pad = {run.pad}   # (guess) by the file's name"
        lines.append(guess if run.pad else draft_line(RUN, "pad", f'"{MARK}"'))
    if run.kind != "clearance":
        lines.append(_line("static_load_direction", run.direction, "deg", "by the cells"))
    if run.kind in ("dynamic", ""):
        frequency, why = run.excitation, "by the file's name, and a line of the record"
        if not math.isfinite(frequency):
            frequency, why = run.lines[0].frequency if run.lines else float("nan"), "strongest line of the record"
        lines.append(_line("excitation_frequency", frequency, "Hz", why))
        lines.append(f'# excitation_direction = "{MARK} deg"')
    return lines


def _line(key: str, value: float, unit: str, why: str) -> str:
    """One line of a run: the guess with its reason, or the mark; and what the key means."""
    if math.isfinite(value):
        return draft_line(RUN, key, f'"{value:.4g} {unit}"').replace("# ", f"# (guess) {why}; ", 1)
    return draft_line(RUN, key, f'"{MARK} {unit}"')


def _toml_string(text: str) -> str:
    """Write text as a TOML string: quoted, controls escaped."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if bare else _toml_string(name)
