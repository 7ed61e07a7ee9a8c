"""What a channel may measure, by its unit and its name, and where it points, concluded from the records.

Two sensors of a kind at right angles read the same vector, so the angle of their readings follows its direction, turned
by where the first one points and mirrored where the second is clockwise from it: directions that are known tell both,
and signs with them.
"""

import contextlib
import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import VECTOR_QUANTITIES, reading_gain
from rigdata.manifest.fields import MARK
from rigdata.problem import tables_beside
from rigdata.readers.series import Series, is_time
from rigdata.units import UnitError, measured_in, parse_quantity

#: Tables of `words.toml`.
WORDS: dict[str, dict[str, str]] = tables_beside(__file__, "words.toml")
_SPELLINGS = str.maketrans(WORDS["spellings"])
#: Units that a name may end with after an underscore; V, H and A there are directions and numbers of sensors.
_SUFFIXES = "um|mm|mils?|k?N|lbf|m_s2|m/s2|mps2|g|deg[CF]|rpm|Hz|mV|bar|k?Pa|MPa|psi"
_UNIT_IN_NAME = re.compile(rf"^(.*?)(?:\s*[(\[]([^)\]]{{1,12}})[)\]]|_({_SUFFIXES}))\s*$")
#: What rigs call a pad.
PAD = "(?:pad|shoe|segment|schuh|klotz|patin)"
#: Directions further off than this in the mean [deg] are not what these two sensors see: no proposal.
_MOST_OFF = 12.0
#: By so much worse the mirror image must be.
_MIRROR = 3.0
#: People mount sensors at multiples of this [deg]; a figure so near, or within its interval, was meant to be one.
_MOUNTED, _NEAR = 15.0, 2.0
#: Names of two sensors of a kind.
Pair = tuple[str, str]


@dataclass(frozen=True)
class Entry:
    """A value of a draft and its source: "file", what it or its name states; "records", concluded; "guess"; ""."""

    value: Any = None
    source: str = ""
    reason: str = ""
    text: str = ""  #: the value with a unit of its own

    @property
    def number(self) -> float:
        """The value where it is a number; else NaN."""
        return float(self.value) if isinstance(self.value, (int, float)) else math.nan


OPEN = Entry()


@dataclass(frozen=True)
class ChannelGuess:
    """What a channel may be; `gain` [SI per reading] is NaN until it is calibrated, `axis` in degrees."""

    quantity: Entry
    unit: str
    axis: Entry = OPEN
    polarity: int = 1
    gain: float = math.nan
    hint: float = math.nan  #: direction [deg] that the name hints at
    typed: bool = False  #: whether the axis stands in the manifest
    sign: int = 0  #: polarity that stands in the manifest
    sensitivity: Entry = OPEN


#: What channels may be, by name.
Guesses = dict[str, ChannelGuess]
#: Tables of a manifest, by channel.
Tables = Mapping[str, Mapping[str, Any]]


def guess_channel(name: str, unit: str) -> ChannelGuess:
    """Guess what a channel measures, by its unit first."""
    parts = _UNIT_IN_NAME.match(name.strip())
    bare, in_name = (parts[1], parts[2] or parts[3]) if parts else (name.strip(), "")
    usable = usable_unit(unit) or usable_unit(in_name)
    if is_time(name):
        return ChannelGuess(Entry("time", "file"), usable or "s")
    if quantity := quantity_of_unit(usable):
        gain = reading_gain(quantity, usable, None)
        return ChannelGuess(Entry(quantity, "file"), usable, gain=gain, **_hinted(bare, quantity))
    if quantity := named("quantities", bare):
        return ChannelGuess(Entry(quantity, "guess", "its name"), usable, **_hinted(bare, quantity))
    return ChannelGuess(Entry(), usable)


def named(table: str, text: str) -> str:
    """Key of the first pattern in a table of `words.toml` that is in a text; "" where none is."""
    return next((key for key, pattern in WORDS[table].items() if re.search(pattern, text, re.IGNORECASE)), "")


def usable_unit(unit: str) -> str:
    """Write a logger's unit so that a manifest can hold it; "" if it is none."""
    text = re.sub(r"\s*/\s*", "/", unit.strip().translate(_SPELLINGS))
    text = WORDS["units"].get(text.lower(), text)
    return text if measured_in(text) else ""


def quantity_of_unit(unit: str) -> str:
    """Quantity that an engineering unit belongs to; "" for volts and for nothing known."""
    quantity = measured_in(unit)
    return "" if quantity in ("signal", "time") else quantity


def _hinted(name: str, quantity: str) -> dict[str, Any]:
    """Direction [deg] that the end of a name hints at, for quantities that have one, and an open axis that says so."""
    angle = named("directions", name)
    if not angle or quantity not in VECTOR_QUANTITIES:
        return {}
    return {"hint": float(angle), "axis": Entry(reason=f"its name hints at {angle} deg")}


def as_described(guess: ChannelGuess, table: Mapping[str, Any]) -> ChannelGuess:
    """A guess with what the manifest says of the channel in its place, as far as it does."""
    quantity, unit, axis = (_text(table, key) for key in ("quantity", "unit", "axis"))
    if quantity and quantity != guess.quantity.value:
        guess = ChannelGuess(Entry(quantity, "file"), guess.unit)
    quantity = guess.quantity.value or ""
    unit = unit or guess.unit
    gain = math.nan
    with contextlib.suppress(UnitError, KeyError):
        gain = reading_gain(quantity, unit, *(table.get(key) for key in ("sensitivity", "full_scale", "excitation")))
    sign = table["polarity"] if table.get("polarity") in (1, -1) else 0
    guess = replace(guess, unit=unit, gain=gain, sign=sign)
    with contextlib.suppress(UnitError):
        angle = math.degrees(parse_quantity(axis, "angle"))
        return replace(guess, axis=Entry(angle, "file"), polarity=sign or 1, typed=True)
    return guess


def _text(table: Mapping[str, Any], key: str) -> str:
    value = table.get(key, "")
    return value if isinstance(value, str) and MARK not in value else ""


@dataclass(frozen=True)
class Frame:
    """Two sensors of a kind: names, where the first points [rad], and the sense in which the second follows."""

    names: Pair
    angle: float
    sense: int
    source: str
    reason: str
    error: float = 0.0  #: standard error of the angle [deg]

    def direction(self, readings: FloatArray) -> FloatArray:
        """Directions (n,) [rad] of readings (n, 2)."""
        return self.angle + self.sense * np.arctan2(readings[..., 1], readings[..., 0])


def pairs(channels: Guesses, quantity: str) -> list[Pair]:
    """Channels of a quantity and unit, two by two as they follow each other."""
    names = defaultdict(list)
    for name, guess in channels.items():
        if guess.quantity.value == quantity:
            names[guess.unit].append(name)
    pairs_of_units: list[Pair] = []
    for alike in names.values():
        pairs_of_units += zip(alike[::2], alike[1::2])
    return pairs_of_units


def stated_frame(pair: Pair, channels: Guesses) -> Frame | None:
    """The frame of two sensors whose axes are in the manifest, or which their names hint at."""
    first, second = (channels[name] for name in pair)
    if first.typed and second.typed:
        angles = [g.axis.number + (180.0 if g.polarity < 0 else 0.0) for g in (first, second)]
        source, reason = "file", ""
    else:
        angles, source, reason = [first.hint, second.hint], "guess", "its name"
    turn = math.sin(math.radians(angles[1] - angles[0]))
    if not abs(turn) > math.cos(math.radians(_MOST_OFF)):
        return None
    return Frame(pair, math.radians(angles[0]), 1 if turn > 0 else -1, source, reason)


def fitted_frame(
    pair: Pair, readings: FloatArray, directions: FloatArray, reason: str, shared: float = 0.0
) -> Frame | None:
    """Fit the frame of two sensors to readings (n, 2) of known directions (n,) [rad]; None where they contradict.

    All directions may be off by as much alike, `shared` [deg].
    """
    if len(readings) < 2:
        return None
    turned = np.arctan2(readings[:, 1], readings[:, 0])
    fits = []
    for sense in (1, -1):
        offsets = np.exp(1j * (directions - sense * turned))
        mean = offsets.mean()
        residual = math.degrees(np.sqrt(np.mean(np.angle(offsets * np.conj(mean)) ** 2)))
        fits.append((residual, sense, np.angle(mean)))
    (residual, sense, angle), (mirrored, _, _) = sorted(fits)
    if residual > _MOST_OFF or mirrored < _MIRROR * max(residual, 1.0):
        return None
    reason = f"{reason}, residual {residual:.1f} deg"
    return Frame(pair, angle, sense, "records", reason, math.hypot(shared, residual / math.sqrt(len(readings))))


def with_axes(channels: Guesses, frame: Frame, source: str = "") -> None:
    """Give two channels the axes of their frame: 0 to 180 deg, and the sign as a polarity; guesses if `source` is."""
    for number, name in enumerate(frame.names):
        if channels[name].typed:
            continue
        angle = math.degrees(frame.angle) + 90.0 * frame.sense * number
        mounted = _MOUNTED * round(angle / _MOUNTED)
        if abs(mounted - angle) > max(_NEAR, 2.0 * frame.error):
            mounted = angle
        polarity = channels[name].sign or (-1 if mounted % 360.0 >= 180.0 else 1)
        turn = 180.0 if polarity < 0 else 0.0
        mark, reason = frame.source, frame.reason
        if mark == "records":
            reason = f"{folded(angle + turn):g} deg by {reason}"
            if source == "guess":
                mark, reason = source, f"{reason}, if the cells' axes hold"
        axis = Entry(folded(mounted + turn), mark, reason)
        channels[name] = replace(channels[name], axis=axis, polarity=polarity)


def folded(angle: float) -> float:
    """An angle [deg] from above -180 to 180, to a tenth."""
    return round(180.0 - (180.0 - angle) % 360.0, 1) + 0.0  # no minus before zero


def part_means(series: Sequence[Series], parts: int = 10) -> FloatArray:
    """Means (parts, n_channels) over equal shares of a record; NaN where a share has no value."""
    columns = []
    for channel in series:
        shares = [share[np.isfinite(share)] for share in np.array_split(channel.values, parts)]
        columns.append([share.mean() if len(share) else math.nan for share in shares])
    return np.array(columns).T


def line_phasors(series: Sequence[Series], frequency: float) -> ComplexArray:
    """Phasors (2,) of two channels at a frequency [Hz], at their own times."""
    phasors = []
    for channel in series:
        time = np.arange(len(channel)) / channel.rate if channel.time is None else channel.time
        values = np.nan_to_num(channel.values - np.nanmean(channel.values))
        window = np.hanning(len(values))
        wave = np.exp(-2j * np.pi * frequency * time) * window
        phasors.append(2.0 * (values @ wave) / window.sum())
    return np.array(phasors)


def along(cells: ComplexArray, housing: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Readings (2,) of cells and of accelerometers when the force is largest; the housing follows it."""
    phase = 0.5 * np.angle(np.sum(cells**2))
    turn = np.exp(-1j * phase)
    return (cells * turn).real, -(housing * turn).real
