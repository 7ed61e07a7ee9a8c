"""What a channel may measure and what a record may be, guessed from units, names and movement; every guess says why."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import DIMENSIONS
from rigdata.readers.series import Series, is_time
from rigdata.survey.exports import Export
from rigdata.survey.spectrum import SpectralPeak, amplitude_spectrum, strongest
from rigdata.units import UnitError, is_signal, parse_unit, unit_factor

#: Words of rigs in several languages -> quantity; the first that fits counts.
_WORDS = (
    ("speed", r"speed|rpm|drehzahl|tach|keyph|vitesse|giri|^n\d*$|^k\d*$"),
    ("temperature", r"temp|^t\d+|thermo|^tc\d*"),
    ("acceleration", r"acc|beschl|^a\d*[a-z]?$|^a\d+[hvxy]$"),
    ("force", r"force|load|kraft|last|forza|^f[xyhv]?\d*$|^l\d+[hvxy]?$|cell"),
    ("pressure", r"press|druck|^p\d+$"),
    ("displacement", r"disp|prox|probe|weg|gap|sonde|^x\d*[ab]?$|^y\d*[ab]?$|^d[xy]?\d*$|^x\d+[a-d]$|^y\d+[a-d]$"),
)
#: How loggers spell units that a manifest spells otherwise.
_SPELT = {"U/min": "rpm", "1/min": "rpm", "min-1": "rpm", "degc": "degC", "C": "degC", "m/s2": "m/s^2", "Volts": "V",
          "volts": "V", "Volt": "V", "Newtons": "N", "newtons": "N", "Newton": "N", "mils": "mil"}  # fmt: skip


@dataclass(frozen=True)
class ChannelGuess:
    """What a channel may be."""

    quantity: str
    unit: str
    axis: str
    why: str


def guess_channel(name: str, unit: str) -> ChannelGuess:
    """Guess quantity and direction of a channel."""
    usable = usable_unit(unit)
    if is_time(name):
        return ChannelGuess("time", usable or "s", "", "by its name")
    by_unit = quantity_of_unit(usable)
    by_name = next((q for q, pattern in _WORDS if re.search(pattern, name.strip(), re.IGNORECASE)), "")
    if by_unit:
        return ChannelGuess(by_unit, usable, _axis(name, by_unit), f"by its unit {usable}")
    if by_name:
        return ChannelGuess(by_name, usable, _axis(name, by_name), "by its name")
    return ChannelGuess("", usable, "", "name and unit are not known")


def usable_unit(unit: str) -> str:
    """Write a logger's unit so that a manifest can hold it; "" if it is none."""
    text = unit.strip().replace("°", "deg").replace("µ", "u").replace("μ", "u")
    text = re.sub(r"\s*/\s*", "/", text)
    text = _SPELT.get(text, text)
    try:
        parse_unit(text)
    except UnitError:
        return ""
    return text


def quantity_of_unit(unit: str) -> str:
    """Quantity that an engineering unit belongs to; "" for volts and for nothing known."""
    with contextlib.suppress(UnitError):
        if not unit or is_signal(unit):
            return ""
    for quantity, dimension in DIMENSIONS.items():
        with contextlib.suppress(UnitError):
            unit_factor(unit, dimension)
            if quantity != "time":
                return quantity
    return ""


def _axis(name: str, quantity: str) -> str:
    """Direction from the letters at a name's end, for quantities that have one."""
    if quantity not in ("displacement", "force", "acceleration"):
        return ""
    end = re.search(r"(?:^|[\d_\-. ]|^[fdal])([xyhv])$", name.strip(), re.IGNORECASE)
    if end is None:
        return ""
    return "0 deg" if end[1].lower() in "xh" else "90 deg"


#: Share of slow movement above which a record is a quasi-static test, and of one direction for load steps.
_SLOW, _STRAIGHT = 0.9, 0.97
#: Above this share too, where no line carries that much of the movement: steps that follow each other quickly.
_MOSTLY, _DRIVEN = 0.5, 0.05
_BLOCK = 0.25
#: How far a line may lie from the frequency that a file's name states, as a share.
_CONFIRMS = 0.02
#: Units of a tachometer, in Hz.
_TURNS = {"rpm": 1.0 / 60.0, "Hz": 1.0, "1/s": 1.0, "rad/s": 1.0 / (2.0 * math.pi)}
_BY_NAME = (
    ("dry_pivot", r"pivot|dry|trocken|steps?|^p-"),
    ("clearance", r"clear|spiel|^c-"),
    ("locus", r"locus|locat|^l-"),
    ("dynamic", r"dyn|excit|shake|^d-"),
)


@dataclass(frozen=True)
class RunGuess:
    """What a record may be."""

    file: str
    kind: str
    why: str
    lines: tuple[SpectralPeak, ...] = ()
    load: float = float("nan")
    direction: float = float("nan")
    pad: int = 0
    speed: float = float("nan")
    excitation: float = float("nan")
    why_speed: str = ""


def guess_run(export: Export, channels: Mapping[str, ChannelGuess]) -> RunGuess:
    """Guess what a record is."""
    quantities = {name: guess.quantity for name, guess in channels.items()}
    forces = [s for s in export.series if quantities.get(s.name) == "force"]
    moves = [s for s in export.series if quantities.get(s.name) == "displacement"]
    lines = strongest_lines(forces) or strongest_lines(moves)
    stem = export.name.rpartition("/")[2]
    name_kind = next((k for k, pattern in _BY_NAME if re.search(pattern, stem, re.IGNORECASE)), "")
    movement, why = _by_movement(forces, moves, lines)
    kind, reason = name_kind or movement, "by its name" if name_kind else "not known"
    if movement == kind and movement:
        reason = why
    elif movement and {movement, name_kind} != {"dynamic", "locus"}:
        kind, reason = movement, f"{why} (its name says {name_kind})"
    pad = re.search(r"(?:^p|pad)[-_ #]?(\d{1,2})(?!\d)", stem, re.IGNORECASE)
    direction = _direction(forces, channels, steps=kind == "dry_pivot")
    speed, why_speed = _speed(export, channels, stem)
    return RunGuess(
        file=export.name,
        kind=kind,
        why=reason,
        lines=lines,
        load=_load_of(stem),
        direction=direction if math.isfinite(direction) else _number_before(stem, r"deg(?:ree)?s?|°|grad"),
        pad=int(pad[1]) if pad else 0,
        speed=speed,
        excitation=_confirmed(stem, lines),
        why_speed=why_speed,
    )


def _number_before(stem: str, unit: str) -> float:
    """Number before a unit in a file's name: ``-90deg``, ``1320_rpm``; NaN without one."""
    match = re.search(rf"(?<![\d.,])((?<![a-z0-9])[-+])?(\d+(?:[.,]\d+)?)[ _]?(?:{unit})(?![a-z])", stem, re.IGNORECASE)
    if match is None:
        return float("nan")
    size = float(match[2].replace(",", "."))
    return -size if match[1] == "-" else size  # behind a letter it is a hyphen


def _speed(export: Export, channels: Mapping[str, ChannelGuess], stem: str) -> tuple[float, str]:
    """Shaft speed [Hz] by a tachometer in engineering units, else by the file's name, and which of them said so."""
    for series in export.series:
        guess = channels.get(series.name)
        if guess is not None and guess.quantity == "speed" and guess.unit in _TURNS:
            good = series.values[np.isfinite(series.values)]
            mean = float(np.median(good)) * _TURNS[guess.unit] if len(good) else 0.0
            if mean > 0:
                return mean, f"by the tachometer {series.name}"
    turns = _number_before(stem, r"rpm|u[-_]?min|1[-_]min") / 60.0
    return turns, "by the file's name" if math.isfinite(turns) else ""


def _confirmed(stem: str, lines: tuple[SpectralPeak, ...]) -> float:
    """Frequency [Hz] that a file's name states and one of the record's lines confirms; NaN without one."""
    numbers = re.findall(r"(\d+(?:[.,]\d+)?)[ _]?Hz(?![a-z])", stem, re.IGNORECASE)
    frequencies = [float(number.replace(",", ".")) for number in numbers]
    confirmed = []
    for frequency in frequencies:
        nearest = min((abs(line.frequency - frequency) for line in lines), default=math.inf)
        if nearest <= _CONFIRMS * frequency:
            confirmed.append(frequency)
    return confirmed[0] if len(confirmed) == 1 else math.nan


def _direction(forces: list[Series], channels: Mapping[str, ChannelGuess], steps: bool) -> float:
    """Direction [deg] from two cells at right angles whose axes are known and whose units agree."""
    axes = {channels[s.name].axis: s for s in forces}
    if not {"0 deg", "90 deg"} <= set(axes):
        return float("nan")
    pair = (axes["0 deg"], axes["90 deg"])
    if channels[pair[0].name].unit != channels[pair[1].name].unit:
        return float("nan")
    parts = []
    for series in pair:
        good = series.values[np.isfinite(series.values)]
        tenth = max(1, len(good) // 10)
        mean = float(good.mean()) if len(good) else 0.0
        if steps and len(good):
            mean = float(good[-tenth:].mean() - good[:tenth].mean())
        parts.append(mean)
    horizontal, vertical = parts
    return float(round(math.degrees(math.atan2(vertical, horizontal)))) if any(parts) else float("nan")


def _by_movement(forces: list[Series], moves: list[Series], lines: tuple[SpectralPeak, ...]) -> tuple[str, str]:
    pair = [s for s in forces if s.rate > 0][:2] or [s for s in moves if s.rate > 0][:2]
    if not pair:
        return "", ""
    slow = [_slow(s) for s in pair]
    total = sum(float(np.nanvar(s.values)) for s in pair)
    if total <= 0:
        return "", ""
    share = sum(float(np.var(b)) for b in slow) / total
    driven = bool(lines) and 0.5 * lines[0].amplitude ** 2 > _DRIVEN * total  # mains pick-up drives nothing
    if share > _SLOW or (share > _MOSTLY and not driven):
        if len(slow) == 2 and len(slow[0]) == len(slow[1]) > 3:
            spread = np.linalg.eigvalsh(np.cov(np.stack(slow)))
            if spread[-1] < _STRAIGHT * spread.sum():
                return "clearance", "the force goes around"
        return "dry_pivot", "the force climbs slowly along one line"
    return ("dynamic", "the force oscillates") if lines else ("locus", "the force is constant")


def _slow(series: Series) -> FloatArray:
    """Means over blocks of a quarter of a second."""
    step = max(1, round(_BLOCK * series.rate))
    count = len(series.values) // step
    blocks = series.values[: count * step].reshape(count, step)
    means = []
    for block in blocks:
        finite = block[np.isfinite(block)]
        if len(finite):
            means.append(float(np.mean(finite)))
    return np.array(means)


def strongest_lines(channels: list[Series]) -> tuple[SpectralPeak, ...]:
    """Lines of the channel that oscillates most, strongest first."""
    best: tuple[SpectralPeak, ...] = ()
    for series in channels:
        frequency, amplitude = amplitude_spectrum(series.values, series.rate)
        peaks = strongest(frequency, amplitude, most=4)
        if peaks and (not best or peaks[0].amplitude > best[0].amplitude):
            best = peaks
    return best


def _load_of(stem: str) -> float:
    """Static load that a file name states: ``5kN``, ``5_kN``, or a bare number of newtons such as ``05000``."""
    kilo = re.search(r"(\d+(?:[.,]\d+)?)[ _]?kN", stem, re.IGNORECASE)
    if kilo:
        return 1e3 * float(kilo[1].replace(",", "."))
    bare = [float(n) for n in re.findall(r"(?<![\d.])(\d{3,6})(?![\d.])", stem)]
    return next((n for n in bare if 100.0 <= n <= 200_000.0), float("nan"))
