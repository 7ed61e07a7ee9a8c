"""Where sensors point, concluded from the records: two of a kind at right angles, held against known directions.

Both read the same vector, so the angle of their readings follows its direction, turned by where the first one points
and mirrored where the second is clockwise from it: directions that are known tell both, and signs with them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.readers.series import Series
from rigdata.survey.channels import Entry, Guesses

#: Directions further off than this in the mean [deg] are not what these two sensors see: no proposal.
_MOST_OFF = 12.0
#: By so much worse the mirror image must be.
_MIRROR = 3.0
#: People mount sensors at multiples of this [deg]; a figure so near, or within its interval, was meant to be one.
_MOUNTED, _NEAR = 15.0, 2.0


#: Names of two sensors of a kind.
Pair = tuple[str, str]


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
    names: dict[str, list[str]] = {}
    for name, guess in channels.items():
        if guess.quantity.value == quantity:
            names.setdefault(guess.unit, []).append(name)
    return [pair for alike in names.values() for pair in zip(alike[::2], alike[1::2], strict=False)]


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
    pair: Pair, readings: FloatArray, directions: FloatArray, reason: str, most: float = _MOST_OFF
) -> Frame | None:
    """Fit the frame of two sensors to readings (n, 2) of known directions (n,) [rad]; None where they contradict."""
    if len(readings) < 2:
        return None
    turned = np.arctan2(readings[:, 1], readings[:, 0])
    fits = []
    for sense in (1, -1):
        offsets = np.exp(1j * (directions - sense * turned))
        mean = offsets.mean()
        residual = math.degrees(float(np.sqrt(np.mean(np.angle(offsets * np.conj(mean)) ** 2))))
        fits.append((residual, sense, float(np.angle(mean))))
    (residual, sense, angle), (mirrored, _, _) = sorted(fits)
    if residual > most or mirrored < _MIRROR * max(residual, 1.0):
        return None
    reason = f"{reason}, residual {residual:.1f} deg"
    return Frame(pair, angle, sense, "records", reason, residual / math.sqrt(len(readings)))


def with_axes(channels: Guesses, frame: Frame, source: str = "") -> None:
    """Give two channels the axes of their frame: 0 to 180 deg, and the sign as a polarity; guesses if `source` is."""
    for number, name in enumerate(frame.names):
        if channels[name].typed:
            continue
        angle = math.degrees(frame.angle) + (90.0 * frame.sense if number else 0.0)
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
        columns.append([float(share.mean()) if len(share) else math.nan for share in shares])
    return np.array(columns).T


def line_phasors(series: Sequence[Series], frequency: float) -> ComplexArray:
    """Phasors (2,) of two channels at a frequency [Hz], at their own times."""
    phasors = []
    for channel in series:
        time = np.arange(len(channel)) / channel.rate if channel.time is None else channel.time
        values = np.nan_to_num(channel.values - np.nanmean(channel.values))
        window = np.hanning(len(values))
        wave = np.exp(-2j * np.pi * frequency * time) * window
        phasors.append(2.0 * complex(values @ wave) / float(window.sum()))
    return np.array(phasors)


def along(cells: ComplexArray, housing: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Readings (2,) of cells and of accelerometers when the force is largest; the housing follows it."""
    phase = 0.5 * np.angle(np.sum(cells**2))
    turn = np.exp(-1j * phase)
    return (cells * turn).real, -(housing * turn).real
