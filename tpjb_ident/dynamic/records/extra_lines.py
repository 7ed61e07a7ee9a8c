"""Lines in a record that nobody mentioned: other excitations, a neighbouring machine, a loose cable.

They are found in what the fit of the known lines leaves of the forces and displacements, and fitted
along. Several excitation frequencies in one record show up here too: each run of the manifest then
gives its own line, the others are fitted beside it.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.run_data import MeasuredRun, RunPhasors
from tpjb_ident.dynamic.records.windows import line_design

#: Samples that are looked at.
_LOOK = 2**15
#: A line stands this many times above the noise floor around it,
_PROMINENCE = 15.0
#: has at least this share of the excitation's amplitude (less cannot bend its phasor),
MIN_SHARE = 2e-3
#: and lies below this many times the highest excitation frequency.
REACH = 4.0
MAX_LINES = 10
#: Bins of the Hann window's main lobe about a known line that tell nothing.
_LOBE = 4.0


def unexpected_lines(run: MeasuredRun, result: RunPhasors) -> tuple[tuple[float, ...], tuple[Condition, ...]]:
    """Frequencies of lines beside the known ones [Hz], and what to say about them."""
    n = min(run.length, _LOOK)
    known = result.lines.frequencies
    frequencies: list[float] = []
    lines = None
    for quantity, block in (("force", result.cell_force), ("displacement", result.displacement)):
        record = run.vector(quantity, 0, n)
        sizes = np.linalg.norm(block.phasors[:, : len(result.lines.excitation)], axis=2)
        if not np.isfinite(record.values).all() or not np.isfinite(sizes).any():
            continue
        smallest = MIN_SHARE * float(np.nanmedian(sizes))
        if lines is None or frequencies:
            lines = _KnownLines(n, run.sample_rate, np.append(known, frequencies))
        frequencies += lines.beside(record.values, smallest)
    top = REACH * max(line.frequency for line in result.lines.excitation)
    extra = tuple(sorted(f for f in frequencies if f < top))[:MAX_LINES]
    if not extra:
        return (), ()
    conditions = [Condition("unexpected lines", f"lines at {', '.join(f'{f:.4g}' for f in extra)} Hz; fitted along")]
    for line in result.lines.excitation:
        coincident = [f for f in extra if abs(2 * f - line.frequency) < 0.05]
        if coincident:
            conditions.append(
                Condition(
                    "harmonic on excitation line",
                    f"the second harmonic of the line at {coincident[0]:.4g} Hz falls on the excitation",
                )
            )
    return extra, tuple(conditions)


class _KnownLines:
    """Known lines on an even grid, and the peaks that they leave."""

    def __init__(self, length: int, rate: float, frequencies: FloatArray) -> None:
        self.rate, self.frequencies = rate, frequencies
        self._design = line_design(np.arange(length) / rate, frequencies, 3)
        # normal equations: a peak's place and size need no more digits
        self._inverse = np.linalg.pinv(self._design.T @ self._design, rcond=1e-12, hermitian=True)

    def beside(self, values: FloatArray, smallest: float) -> list[float]:
        """Frequencies [Hz] of the peaks above `smallest` in the residual's amplitude spectrum."""
        n = len(values)
        residual = values - values.mean(axis=0)
        residual = residual - self._design @ (self._inverse @ (self._design.T @ residual))
        # Glitches are broad-band and would drown every line: what is far out is cut to the noise's edge.
        edge = 5 * 1.4826 * np.median(np.abs(residual), axis=0)
        residual = np.clip(residual, -edge, edge)
        window = np.hanning(n)
        spectrum = np.abs(np.fft.rfft(residual * window[:, None], axis=0)) * 2 / window.sum()
        amplitude = np.linalg.norm(spectrum, axis=1)
        frequency = np.fft.rfftfreq(n, 1 / self.rate)
        floor = median_filter(amplitude, size=min(61, max(n // 20, 3)), mode="nearest")
        step = self.rate / n
        candidate = amplitude > np.maximum(_PROMINENCE * floor, smallest)
        candidate[frequency < _LOBE * step] = False
        for f in self.frequencies:
            candidate[np.abs(frequency - f) < _LOBE * step] = False
        candidate[1:-1] &= (amplitude[1:-1] >= amplitude[:-2]) & (amplitude[1:-1] > amplitude[2:])
        candidate[[0, -1]] = False
        return [float(frequency[i] + step * _vertex(amplitude[i - 1 : i + 2])) for i in np.flatnonzero(candidate)]


def _vertex(three: FloatArray) -> float:
    """Offset of the top of the parabola through the logarithms of three neighbours [bins]."""
    a, b, c = np.log(np.maximum(three, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0
