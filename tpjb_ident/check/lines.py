"""What a record shows at the excitation: by the phasors of identification; lines of a band, other lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.run import Run
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.run_data import RunPhasors

#: Lines of a band that are looked at, the strongest of as many parts of it.
_BAND_LINES = 8
#: Bins to either side of a disturbing line that are left alone.
_CLEAR_OF = 5
#: Noise is looked at from this many times the band's top on.
_ABOVE = 1.3


@dataclass(frozen=True)
class RecordLines:
    """What a run's channels show of the excitation, for m channels."""

    mean: FloatArray  #: (m,)
    phasor: ComplexArray  #: (m,) complex: at the excitation; ``Re(phasor exp(i omega t))``
    floor: FloatArray  #: (m,): amplitude that lines beside it reach by noise alone
    scatter: FloatArray  #: (m,): standard deviation of what is left


def excitation_line(phasors: RunPhasors, line: int, channels: Sequence[Channel]) -> RecordLines:
    """One excitation line as identification has it; NaN where it has nothing of a channel."""
    known = {c.name: k for k, c in enumerate(phasors.channels)}
    rows = [k for k, c in enumerate(channels) if c.name in known]
    places = [known[channels[k].name] for k in rows]
    table = np.full((3, len(channels)), np.nan)
    phasor = np.full(len(channels), np.nan + 0j)
    phasor[rows] = phasors.record[line, places]
    floor = np.abs(phasors.residual[line])
    for values, windows in zip(table, (phasors.mean, floor, phasors.scale)):
        for k, place in zip(rows, places):
            present = windows[np.isfinite(windows[:, place]), place]
            values[k] = np.median(present) if len(present) else np.nan
    return RecordLines(table[0], phasor, table[1], table[2])


def steady_level(values: FloatArray, rate: float, frequencies: Sequence[float]) -> RecordLines:
    """Mean and scatter of a run without an excitation line, others taken off; `values` (n, m)."""
    known = np.array([f for f in frequencies if f > 0])
    fit = LineFitter(len(values), rate, known).fit(np.ascontiguousarray(values.T)[:, None], np.zeros(1))
    missing = np.full(values.shape[1], np.nan)
    return RecordLines(fit.mean[0], missing + 0j, missing, fit.scale[0])


def other_line(phasors: RunPhasors | None, astray: Sequence[int] = ()) -> float:
    """Frequency of the line that nobody mentioned and that is strongest in the cells [Hz]; NaN where there is none.

    Excitation lines that are `astray`, by number, are not where they were said to be: nobody mentioned them either.
    """
    strongest, frequency = 0.0, float("nan")
    known = phasors.lines.excitation + phasors.lines.nuisance if phasors is not None else ()
    for k, line in enumerate(known):
        if (line.name == "found" or k in astray) and phasors is not None:
            sizes = np.linalg.norm(phasors.cell_force.phasors[:, k], axis=1)
            size = float(np.max(sizes, initial=0.0, where=np.isfinite(sizes)))
            if size > strongest:
                strongest, frequency = size, line.frequency
    return frequency


def band_lines(
    run: Run, values: FloatArray, force: Sequence[int], disturbing: Sequence[float]
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Phasors (k, m) at strong lines of an excitation over a band, what noise makes of a line (m,), the lines [Hz].

    What channels owe one another (two planes of probes, cells and accelerometers) holds at every line, so a few that
    stand clear of the noise, away from shaft and mains, serve the checks as the one line of a sine does.

    `values` (n, m).
    """
    none = np.empty((0, values.shape[1]), complex), np.full(values.shape[1], np.nan), np.empty(0)
    finite = np.isfinite(values)
    if run.band is None or not len(force) or len(values) < 64 or not finite.any(axis=0).all():
        return none
    middle = np.nanmedian(values, axis=0)
    window = np.hanning(len(values))
    spectrum = np.fft.rfft(np.where(finite, values - middle, 0.0) * window[:, None], axis=0) * (2 / window.sum())
    frequency = np.fft.rfftfreq(len(values), 1 / run.sample_rate)
    free = np.ones(len(frequency), dtype=bool)
    for line in disturbing:
        free &= np.abs(frequency - line * np.maximum(np.round(frequency / line), 1)) > _CLEAR_OF * frequency[1]
    inside = np.flatnonzero(free & (frequency >= run.band[0]) & (frequency <= run.band[1]))
    above = free & (frequency > _ABOVE * run.band[1]) & (frequency < 0.45 * run.sample_rate)
    if len(inside) < _BAND_LINES or above.sum() < _BAND_LINES:
        return none
    power = np.sum(np.abs(spectrum[:, list(force)]) ** 2, axis=1)
    chosen = [part[np.argmax(power[part])] for part in np.array_split(inside, _BAND_LINES)]
    floor = np.asarray(np.median(np.abs(spectrum[above]), axis=0))
    return np.asarray(spectrum[chosen]), floor, np.asarray(frequency[chosen])
