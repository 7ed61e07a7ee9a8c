"""The spectral lines that a dynamic record is known to contain, and windows long enough to tell them apart.

A record at running speed holds the excitation and what an actuator or a film that is not linear makes of it (2f, 3f),
what turns with the shaft (1X to 10X: runout, unbalance), what the film makes of both (2X - f, 2f - X), and the mains.
What is strong is fitted together in every window, so that none leaks into the excitation line, however short the
window; what is faint in the whole record alone, unless it stands out there.

Windows are many enough to be robust. The joint fit of the lines separates 22 Hz from 25 Hz in any window, in principle;
what a short window costs is variance. The variance inflation of the excitation line (against a fit of that line alone)
is the criterion: 1.0 for orthogonal lines, 1.3 is accepted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.errors import TpjbError

#: Highest line that a record shows, over its sample rate.
HIGHEST = 0.45
#: How far the mains and the shaft's speed may be from what is stated [Hz].
MAINS_DRIFT, SPEED_DRIFT = 0.15, 0.08
#: Harmonics of the shaft that are named where they coincide with the excitation.
NAMED_HARMONICS = 3
_NAMED = tuple(f"{n}X" for n in range(1, NAMED_HARMONICS + 1))
#: Lines that follow the drive or were found wander no farther than rounding [Hz].
_EXACT = 1e-6
#: Lines closer than this are one [1 / record length].
ONE_LINE = 0.6
#: Harmonics of the shaft that are fitted in every window, and that are looked at in the whole record: run-out has them.
_STRONG_SHAFT, _FAINT_SHAFT = 2, 10


@dataclass(frozen=True)
class Line:
    """One sinusoid at a known frequency."""

    name: str
    frequency: float
    wander: float = 0.0
    order: float = 0.0  #: by which its frequency follows the shaft's speed


@dataclass(frozen=True)
class LineSet:
    """Excitation lines first, then what disturbs them, then what only the whole record shows."""

    excitation: tuple[Line, ...]
    nuisance: tuple[Line, ...]
    conditions: Conditions = ()
    speed: float = 0.0
    faint: tuple[Line, ...] = ()

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies of the windows' lines [Hz], excitation first, shape (n_lines,)."""
        return np.array([line.frequency for line in self.excitation + self.nuisance])

    @property
    def whole_frequencies(self) -> FloatArray:
        """Frequencies of the whole record's lines [Hz], (n_whole_lines,)."""
        return self.with_slip(0.0)

    @property
    def driven(self) -> tuple[float, ...]:
        """Frequencies of the excitation [Hz]."""
        return tuple(line.frequency for line in self.excitation)

    @property
    def found(self) -> tuple[float, ...]:
        """Frequencies of lines that stood out, of faint ones that every window fits along too [Hz]."""
        names = {"found", *(line.name for line in _faint_lines(self.excitation, self.speed))}
        return tuple(line.frequency for line in self.nuisance if line.name in names)

    def place(self, name: str) -> int | None:
        """Place of a disturbing line among those of the windows; None where it is not fitted apart."""
        names = [line.name for line in self.nuisance]
        return len(self.excitation) + names.index(name) if name in names else None

    @property
    def whole(self) -> tuple[Line, ...]:
        """Lines of the whole record: those of the windows, then the faint ones."""
        return self.excitation + self.nuisance + self.faint

    def with_slip(self, slip: float) -> FloatArray:
        """Frequencies of the whole record's lines where the shaft turns faster by `slip` [Hz], (n_whole_lines,)."""
        return np.array([line.frequency + line.order * slip for line in self.whole])


def known_lines(
    excitation: tuple[float, ...],
    speed: float,
    rate: float,
    mains: float = 50.0,
    extra: tuple[float, ...] = (),
    duration: float = np.inf,
) -> LineSet:
    """Collect the lines of one run; coinciding ones are one, named in the order excitation, shaft, mains, others."""
    top, spacing = HIGHEST * rate, ONE_LINE / duration
    driven = tuple(Line("excitation", float(f)) for f in sorted(set(excitation)))
    faint = _faint_lines(driven, speed)
    strong = strong_lines(driven, speed, mains)
    for f in extra:
        strong.append(next((line for line in faint if abs(line.frequency - f) < spacing), Line("found", f, _EXACT)))
    conditions = []
    nuisance: list[Line] = []
    resolved: list[Line] = []
    level = Line("level", 0.0)
    for line in strong + faint:
        coincident = [e for e in driven if abs(e.frequency - line.frequency) <= line.wander]
        if not 0.0 < line.frequency < top:
            continue
        if coincident:
            if line in strong or line.name in _NAMED:
                text = f"{line.name} at {line.frequency:g} Hz cannot be told from the excitation at "
                text += f"{coincident[0].frequency:g} Hz; move the excitation by a few Hz"
                conditions.append(Condition(f"{line.name} on excitation line", text))
        elif line in strong:
            if _is_apart(line, nuisance, 0.0 if line.name == "found" else spacing):
                nuisance.append(line)
        elif _is_apart(line, [level, *driven, *nuisance, *resolved], 2 * spacing):
            resolved.append(line)
    return LineSet(driven, tuple(nuisance), tuple(conditions), speed, tuple(resolved))


def _is_apart(line: Line, lines: list[Line], least: float) -> bool:
    return all(abs(o.frequency - line.frequency) > max(o.wander, line.wander, least) for o in lines)


def _shaft_lines(speed: float, first: int, last: int) -> list[Line]:
    orders = range(first, last + 1) if speed > 0 else ()
    return [Line(f"{n}X", n * speed, n * SPEED_DRIFT, n) for n in orders]


def strong_lines(
    driven: tuple[Line, ...], speed: float, mains: float, of_shaft: int = _STRONG_SHAFT, of_mains: int = 1
) -> list[Line]:
    """What turns with the shaft, the mains, what the actuator makes of the drive; harmonics of the first two."""
    orders = range(1, of_mains + 1) if mains > 0 else ()
    supply = [Line("mains" if n == 1 else f"mains {n}", n * mains, MAINS_DRIFT) for n in orders]
    drive = [Line("harmonic 2", 2 * line.frequency, _EXACT) for line in driven]
    return _shaft_lines(speed, 1, of_shaft) + supply + drive


def _faint_lines(driven: tuple[Line, ...], speed: float) -> list[Line]:
    """Further harmonics, and what a film that is not linear makes of the shaft's and the drive's motion."""
    faint = _shaft_lines(speed, _STRONG_SHAFT + 1, _FAINT_SHAFT)
    for e in driven:
        twice, half = 2 * speed - e.frequency, 2 * e.frequency - speed
        faint.append(Line("harmonic 3", 3 * e.frequency, _EXACT))
        faint.append(Line("2X-f", abs(twice), _EXACT, 2 * np.sign(twice)))
        faint.append(Line("2f-X", abs(half), _EXACT, -np.sign(half)))
    return faint


#: Windows of a record that is long enough, cycles of the excitation in one, at least, and its variance inflation.
_COUNT, _CYCLES, MAX_INFLATION = 20, 4.0, 1.3
#: Samples per window, where a shorter one resolves the lines.
MAX_SAMPLES = 2**16
#: Even samples that tell how well a window separates its lines, at most.
_EVEN = 2**14


class RecordTooShortError(TpjbError):
    """The record cannot resolve its lines."""


def line_design(time: FloatArray, frequencies: FloatArray, drift_order: int = 1) -> FloatArray:
    """Columns of the joint least-squares problem, (n, 2 n_lines + drift_order + 1).

    `time` (n,), `frequencies` (n_lines,) [Hz].
    """
    phase = 2 * np.pi * np.multiply.outer(time, frequencies)
    middle, half = 0.5 * (time[0] + time[-1]), 0.5 * (time[-1] - time[0]) or 1.0
    slow = np.polynomial.legendre.legvander((time - middle) / half, drift_order)
    waves = np.empty((len(time), 2 * len(frequencies)))
    waves[:, 0::2] = np.cos(phase)
    waves[:, 1::2] = -np.sin(phase)
    return np.concatenate([waves, slow], axis=1)


def variance_inflation(frequencies: FloatArray, n_driven: int, length: float, rate: float) -> float:
    """Worst variance of an excitation phasor against a fit of that line alone; `frequencies` (n_lines,)."""
    # A few hundred samples carry the whole geometry as long as no line aliases.
    step = max(1, int(rate / (8.0 * frequencies.max())))
    even = range(0, round(length * rate), step)
    # beyond some thousand, scattered ones do that too, however long the window
    time = np.array(even) / rate if len(even) <= _EVEN else length * np.random.default_rng(0).random(_EVEN)
    design = line_design(time, frequencies)
    if design.shape[0] <= design.shape[1]:
        return math.inf
    r = np.linalg.qr(design, mode="r")
    if np.abs(np.diag(r)).min() < 1e-9 * np.abs(np.diag(r)).max():
        return math.inf
    inverse = np.linalg.inv(r)
    variance = np.einsum("ij,ij->i", inverse, inverse)[: 2 * n_driven]
    return float((variance * 0.5 * design.shape[0]).max())


def shortest_window(lines: LineSet, rate: float) -> float:
    """Shortest window [s] that keeps the excitation lines within the accepted inflation."""
    frequencies = lines.frequencies
    n_driven = len(lines.excitation)
    length = start = _CYCLES / min(lines.driven)
    # A dozen beats between neighbours separate any two lines; what is not resolved then never is.
    longest = max(start, 12.0 / _gap(lines))
    while length <= longest:
        if variance_inflation(frequencies, n_driven, length, rate) <= MAX_INFLATION:
            return length
        length *= 1.05
    raise RecordTooShortError(
        f"lines {np.array2string(frequencies, precision=4)} Hz cannot be told apart by any window"
    )


def plan_windows(n_samples: int, rate: float, lines: LineSet, length: float | None = None) -> tuple[int, int]:
    """Choose window length and count for one run; windows of a stated length [s] need no more than a cycle."""
    shortest = shortest_window(lines, rate) if length is None else 1 / min(lines.driven)
    available = n_samples / rate
    # Very long records are cut into more windows, not into windows that fill the memory.
    wanted = length or max(shortest, min(available / _COUNT, MAX_SAMPLES / rate))
    for name, seconds in [("a window", length or math.inf), ("the record", available)]:
        if seconds < shortest * 0.999:
            raise RecordTooShortError(
                f"{name} of {seconds:.3g} s cannot tell the lines apart: the nearest to the excitation is "
                f"{_gap(lines):.3g} Hz away; it takes at least {shortest:.3g} s"
            )
    count = max(1, int(available / wanted + 1e-9))
    return n_samples // count if length is None else round(wanted * rate), count


def _gap(lines: LineSet) -> float:
    f = lines.frequencies
    gaps = np.abs(np.subtract.outer(f[: len(lines.excitation)], f))
    return float(gaps[gaps > 0].min(initial=math.inf))
