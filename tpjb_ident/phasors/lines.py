"""The spectral lines that a dynamic record is known to contain.

A record at running speed holds the excitation and its second harmonic (the actuators are not
linear), 1X and 2X of the shaft (runout, unbalance) and the mains. They are fitted together, so
that none leaks into the excitation line, however short the window.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.errors import BadInputError

#: How far the mains and the shaft's speed may be from what is stated [Hz].
_MAINS_DRIFT, SPEED_DRIFT = 0.15, 0.08
#: Harmonics of the shaft that are named where they coincide with the excitation.
NAMED_HARMONICS = 3


@dataclass(frozen=True)
class Line:
    """One sinusoid at a known frequency."""

    name: str
    frequency: float
    wander: float = 0.0


@dataclass(frozen=True)
class LineSet:
    """Excitation lines first, then what disturbs them."""

    excitation: tuple[Line, ...]
    nuisance: tuple[Line, ...]
    conditions: tuple[Condition, ...] = ()
    speed: float = 0.0

    @property
    def frequencies(self) -> FloatArray:
        """All frequencies [Hz], excitation first, shape (n_lines,)."""
        return np.array([line.frequency for line in self.excitation + self.nuisance])

    def at_speed(self, speed: float) -> LineSet:
        """The same lines with 1X, 2X.. at another shaft speed [Hz]."""
        moved = tuple(
            replace(line, frequency=speed * int(line.name[:-1])) if re.fullmatch(r"\d+X", line.name) else line
            for line in self.nuisance
        )
        return replace(self, nuisance=moved, speed=speed)


@dataclass(frozen=True)
class LineSettings:
    """Which disturbing lines to expect."""

    mains: float = 50.0
    shaft_harmonics: int = 2
    drive_harmonics: int = 2
    mains_harmonics: int = 1


def known_lines(
    excitation: tuple[float, ...],
    speed: float,
    rate: float,
    settings: LineSettings | None = None,
    extra: tuple[float, ...] = (),
) -> LineSet:
    """Collect the lines of one run; those that coincide are merged and reported."""
    settings = settings or LineSettings()
    top = 0.45 * rate
    if not excitation or not all(0.0 < f < top for f in excitation):
        raise BadInputError(
            f"excitation frequencies must lie between 0 and {top:g} Hz (0.45 of the sample rate), got {excitation}"
        )
    driven = tuple(Line("excitation", float(f)) for f in sorted(set(excitation)))
    conditions: list[Condition] = []
    nuisance: list[Line] = []
    others = [Line("found", f, 1e-6) for f in extra]
    for n in range(settings.shaft_harmonics + 1, NAMED_HARMONICS + 1):
        line = Line(f"{n}X", n * speed)
        coincident = [e for e in driven if speed > 0 and abs(e.frequency - n * speed) <= n * SPEED_DRIFT]
        conditions += [_on_excitation(line, e) for e in coincident[:1]]
    for line in _candidates(driven, speed, settings) + others:
        if not 0.0 < line.frequency < top:
            continue
        coincident = [e for e in driven if abs(e.frequency - line.frequency) <= line.wander]
        if coincident:
            conditions.append(_on_excitation(line, coincident[0]))
        elif all(abs(o.frequency - line.frequency) > max(o.wander, line.wander) for o in nuisance):
            nuisance.append(line)
    return LineSet(driven, tuple(nuisance), tuple(conditions), speed)


def _candidates(driven: tuple[Line, ...], speed: float, settings: LineSettings) -> list[Line]:
    shaft = [Line(f"{n}X", n * speed, n * SPEED_DRIFT) for n in range(1, settings.shaft_harmonics + 1) if speed > 0]
    drive = [
        Line(f"harmonic {n}", n * e.frequency, 1e-6) for e in driven for n in range(2, settings.drive_harmonics + 1)
    ]
    mains = [
        Line("mains" if n == 1 else f"mains {n}", n * settings.mains, _MAINS_DRIFT)
        for n in range(1, settings.mains_harmonics + 1)
        if settings.mains > 0
    ]
    return shaft + mains + drive


def _on_excitation(line: Line, excitation: Line) -> Condition:
    return Condition(
        f"{line.name} on excitation line",
        f"{line.name} at {line.frequency:g} Hz cannot be told from the excitation at "
        f"{excitation.frequency:g} Hz; move the excitation by a few Hz",
    )
