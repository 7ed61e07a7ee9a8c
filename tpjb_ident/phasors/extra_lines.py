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
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.whole_record import WholeRecord

#: A line stands this many times above the noise floor around it,
_PROMINENCE = 15.0
#: has at least this share of the excitation's amplitude (less cannot bend its phasor),
MIN_SHARE = 2e-3
#: and lies below this many times the highest excitation frequency.
REACH = 4.0
MAX_LINES = 10
#: Bins of the Hann window's main lobe about a known line that tell nothing.
_LOBE = 4.0


def unexpected_lines(record: WholeRecord, result: RunPhasors) -> tuple[tuple[float, ...], tuple[Condition, ...]]:
    """Frequencies of lines beside those of the windows [Hz], and what to say about the ones that nobody expects."""
    whole = np.array([line.frequency for line in result.lines.whole])
    frequencies: list[float] = []
    for quantity in ("force", "displacement"):
        places = result.pick(quantity)
        sizes = np.linalg.norm(result.z[:, : len(result.lines.excitation)][:, :, places], axis=2)
        if np.isfinite(sizes).any():
            smallest = MIN_SHARE * float(np.nanmedian(sizes))
            frequencies += _peaks(record, places, np.append(whole, frequencies), smallest)
    top = REACH * max(line.frequency for line in result.lines.excitation)
    extra = tuple(sorted(f for f in frequencies if f < top))[:MAX_LINES]
    strange = [f for f in extra if f not in whole]
    if not strange:
        return extra, ()
    listed = ", ".join(f"{f:.4g}" for f in strange)
    conditions = [Condition("unexpected lines", f"lines at {listed} Hz; fitted along")]
    for line in result.lines.excitation:
        coincident = [f for f in strange if abs(2 * f - line.frequency) < 0.05]
        if coincident:
            conditions.append(
                Condition(
                    "harmonic on excitation line",
                    f"the second harmonic of the line at {coincident[0]:.4g} Hz falls on the excitation",
                )
            )
    return extra, tuple(conditions)


def _peaks(record: WholeRecord, places: list[int], known: FloatArray, smallest: float) -> list[float]:
    """Frequencies [Hz] of lines above `smallest` in some channels: faint ones fitted, and peaks of the residual."""
    bins = np.nan_to_num(record.spectrum[:, places])
    # Hann's window, as a sum of neighbours
    windowed = np.zeros(bins.shape)
    windowed[1:-1] = np.abs(bins[1:-1] - 0.5 * (bins[:-2] + bins[2:]))
    amplitude = np.linalg.norm(windowed, axis=1)
    floor = median_filter(amplitude, size=min(61, max(len(amplitude) // 10, 3)), mode="nearest")
    step = 1 / record.duration
    frequency = np.arange(len(amplitude)) * step
    least = np.maximum(_PROMINENCE * floor, smallest)
    candidate = amplitude > least
    candidate[frequency < _LOBE * step] = False
    for f in known:
        candidate[np.abs(frequency - f) < _LOBE * step] = False
    candidate[1:-1] &= (amplitude[1:-1] >= amplitude[:-2]) & (amplitude[1:-1] > amplitude[2:])
    candidate[[0, -1]] = False
    peaks = [float(frequency[i] + step * _vertex(amplitude[i - 1 : i + 2])) for i in np.flatnonzero(candidate)]
    faint = record.lines.faint
    sizes = np.linalg.norm(record.fit.z[0, len(record.lines.whole) - len(faint) :, places], axis=0)
    at = np.minimum(np.round([line.frequency * record.duration for line in faint]).astype(int), len(least) - 1)
    return peaks + [line.frequency for line, size, limit in zip(faint, sizes, least[at]) if size > limit]


def _vertex(three: FloatArray) -> float:
    """Offset of the top of the parabola through the logarithms of three neighbours [bins]."""
    a, b, c = np.log(np.maximum(three, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0
