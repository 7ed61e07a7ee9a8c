"""What a record may be: by its file's name, by how the forces move, by its lines."""

import contextlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigdata.readers.series import Series
from rigdata.survey.channels import OPEN, PAD, Entry, Guesses, named, part_means, usable_unit
from rigdata.survey.exports import Export
from rigdata.survey.spectrum import Peaks, amplitude_spectrum, strongest
from rigdata.units import UnitError, unit_factor

#: Share of slow movement above which a record is a quasi-static test, and of one direction for load steps.
_SLOW, _STRAIGHT = 0.9, 0.97
#: Variance of equal readings, as a share of their square.
_ROUNDING = 1e-20
#: Blocks of which the means are the slow movement [s].
_BLOCK = 0.25
#: How far a line may lie from a frequency that is stated or known, as a share.
NEAR = 0.02
#: A number and what may be its unit in a file's name; a sign behind a letter is a hyphen.
_NUMBER = r"(?<![\d.,])((?<![a-z0-9])[-+])?(\d+(?:[.,]\d+)?)[ _]?"


@dataclass(frozen=True)
class RunGuess:
    """What a record may be; loads in N, directions in degrees, frequencies in Hz."""

    export: Export
    kind: Entry
    lines: Peaks = ()
    load: Entry = OPEN
    direction: Entry = OPEN
    pad: Entry = OPEN
    speed: Entry = OPEN
    excitation: Entry = OPEN

    @property
    def file(self) -> str:
        """Name of the record's file."""
        return self.export.name


def guess_run(export: Export, channels: Guesses) -> RunGuess:
    """Guess what a record is, as far as it tells alone."""
    forces = of_quantity(export, channels, "force")
    moves = of_quantity(export, channels, "displacement")
    lines = strongest_lines(forces) or strongest_lines(moves)
    stem = Path(export.name).stem
    by_name = named("kinds", stem)
    kind = Entry(by_name, "guess", "the file's name") if by_name else OPEN
    # movement beats a misleading name, but a name tells a constant load from none
    movement, reason = _by_movement(forces, moves, lines)
    if movement and movement == (by_name or movement):
        kind = Entry(movement, "records", reason)
    elif movement and {movement, by_name} != {"dynamic", "locus"}:
        kind = Entry(movement, "records", f"{reason} (its name says {by_name})")
    pad = re.search(rf"(?:^p|{PAD})[-_ #]?(\d{{1,2}})(?!\d)", stem, re.IGNORECASE)
    angles = _numbers_before(stem, r"deg(?:ree)?s?|°|grad")
    # a frequency that the name states counts where one of the record's lines confirms it
    measured = np.array([line.frequency for line in lines])
    confirmed = []
    for frequency in map(abs, _numbers_before(stem, "Hz")):
        if np.any(np.abs(measured - frequency) <= NEAR * frequency):
            confirmed.append(frequency)
    return RunGuess(
        export=export,
        kind=kind,
        lines=lines,
        load=_load_of(stem),
        direction=Entry(angles[0], "file") if angles else OPEN,
        pad=Entry(int(pad[1]), "file") if pad and int(pad[1]) else OPEN,
        speed=_speed(export, channels, stem),
        excitation=Entry(confirmed[0], "file") if len(confirmed) == 1 else OPEN,
    )


def of_quantity(export: Export, channels: Guesses, quantity: str) -> list[Series]:
    """Channels of a record that measure a quantity."""
    return [s for s in export.series if channels[s.name].quantity.value == quantity]


def _numbers_before(stem: str, unit: str) -> list[float]:
    """Numbers before a unit in a file's name: ``-90deg``, ``1320_rpm``."""
    numbers = []
    for match in re.finditer(rf"{_NUMBER}(?:{unit})(?![a-z])", stem, re.IGNORECASE):
        size = float(match[2].replace(",", "."))
        numbers.append(-size if match[1] == "-" else size)
    return numbers


def _load_of(stem: str) -> Entry:
    """Static load [N] that a file's name states: ``5kN``, ``1349lbf``, or a bare number of newtons."""
    for _, number, letters in re.findall(rf"{_NUMBER}([a-z]+)", stem, re.IGNORECASE):
        unit, size = usable_unit(letters), float(number.replace(",", "."))
        with contextlib.suppress(UnitError):
            return Entry(size * unit_factor(unit, "force"), "file", text=f"{size:g} {unit}")
    for bare in re.findall(r"(?<![\d.])(\d{3,6})(?![\d.a-z])", stem, re.IGNORECASE):
        if 100.0 <= float(bare) <= 200_000.0:
            return Entry(float(bare), "guess", "a number in the file's name", f"{float(bare) / 1e3:g} kN")
    return OPEN


def _speed(export: Export, channels: Guesses, stem: str) -> Entry:
    """Shaft speed [Hz] by a tachometer in engineering units, else by the file's name."""
    for series in of_quantity(export, channels, "speed"):
        factor = channels[series.name].gain / (2.0 * math.pi)
        good = series.values[np.isfinite(series.values)]
        mean = np.median(good) * factor if len(good) else 0.0
        if mean > 0:
            return Entry(mean, "records", f"{mean:.4g} Hz by {series.name}")
    turns = _numbers_before(stem, r"rpm|u[-_]?min|1[-_]min")
    return Entry(turns[0] / 60.0, "file") if turns else OPEN


def _by_movement(forces: list[Series], moves: list[Series], lines: Peaks) -> tuple[str, str]:
    pair = [s for s in forces if s.rate > 0][:2] or [s for s in moves if s.rate > 0][:2]
    total = sum(np.nanvar(s.values) for s in pair)
    if total <= 0:
        return "", ""
    slow = part_means(pair, max(1, int(len(pair[0]) / (_BLOCK * pair[0].rate))))
    slow = slow[np.isfinite(slow).all(axis=1)]
    moved = slow.var(axis=0).sum() if len(slow) else 0.0
    share = moved / total if moved > _ROUNDING * np.mean(slow**2) else 0.0
    if share > _SLOW:
        if len(pair) == 2 and len(slow) > 3:
            spread = np.linalg.eigvalsh(np.cov(slow.T))
            if spread[-1] < _STRAIGHT * spread.sum():
                return "clearance", "the force goes around"
        return "dry_pivot", "the force climbs slowly along one line"
    return ("dynamic", "the force oscillates") if lines else ("locus", "the force is constant")


def strongest_lines(channels: Sequence[Series]) -> Peaks:
    """Lines of the channel that oscillates most, strongest first."""
    best: Peaks = ()
    for series in channels:
        frequency, amplitude = amplitude_spectrum(series.values, series.rate)
        peaks = strongest(frequency, amplitude, most=4)
        if peaks and (not best or peaks[0].amplitude > best[0].amplitude):
            best = peaks
    return best
