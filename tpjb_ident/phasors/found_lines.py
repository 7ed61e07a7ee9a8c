"""Lines in a record that nobody mentioned: other excitations, a neighbouring machine, a loose cable, a beat of drives.

They are found in what the fit of the known lines leaves of the forces and displacements, and fitted along. Several
excitation frequencies in one record show up here too: each run of the manifest then gives its own line, the others are
fitted beside it. Within the resolution of a window windows see a beat, which looks like a drive that wanders, or like
clocks that differ. The whole record tells a line from that down to one resolution cell: beside the excitation and its
slow change, one more line explains what is left.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import find_peaks

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.whole_record import WholeRecord, hann_amplitude, noise_floor

#: A line stands this many times above the noise floor around it,
_PROMINENCE = 15.0
#: has at least this share of the excitation's amplitude (less cannot bend its phasor),
MIN_SHARE = 2e-3
#: and lies below this many times the highest excitation frequency.
REACH = 4.0
MAX_LINES = 10
#: Bins of the Hann window's main lobe about a known line that tell nothing.
_LOBE = 4.0


def unexpected_lines(
    records: tuple[WholeRecord, ...], result: RunPhasors, images: FloatArray
) -> tuple[tuple[float, ...], tuple[Condition, ...]]:
    """Frequencies of lines beside those of the windows [Hz], and what to say about the ones that nobody expects.

    `images` (m,): frequencies at which lines stand that are none [Hz].
    """
    whole = result.lines.whole_frequencies
    frequencies: list[float] = []
    for quantity in ("force", "displacement"):
        places = result.pick(quantity)
        sizes = np.linalg.norm(result.z[:, : len(result.lines.excitation)][:, :, places], axis=2)
        if np.isfinite(sizes).any():
            smallest = MIN_SHARE * float(np.nanmedian(sizes))
            for record in records:
                columns = [k for k, place in enumerate(record.places) if place in places]
                if columns:
                    frequencies += _peaks(record, columns, np.append(whole, frequencies), smallest)
    top = REACH * max(result.lines.driven)
    apart = _LOBE / records[0].duration
    frequencies = [f for f in frequencies if f < top and np.abs(images - f).min(initial=np.inf) > apart]
    strange = tuple(sorted(f for f in frequencies if f not in whole))[:MAX_LINES]
    if not strange:  # what leaks from lines that nobody expects makes faint ones stand out
        return tuple(sorted(set(frequencies))), ()
    conditions = [lines_beside(strange)]
    for line in result.lines.excitation:
        coincident = [f for f in strange if abs(2 * f - line.frequency) < 0.05]
        if coincident:
            conditions.append(
                Condition(
                    "harmonic on excitation line",
                    f"the second harmonic of the line at {coincident[0]:.4g} Hz falls on the excitation",
                )
            )
    return strange, tuple(conditions)


def lines_beside(frequencies: tuple[float, ...]) -> Condition:
    """What to say of lines that nobody expects."""
    listed = ", ".join(f"{f:.4g}" for f in frequencies)
    return Condition("unexpected lines", f"lines at {listed} Hz; fitted along")


def _peaks(record: WholeRecord, columns: list[int], known: FloatArray, smallest: float) -> list[float]:
    """Frequencies [Hz] of lines above `smallest` in some channels: faint ones fitted, and peaks of the residual."""
    amplitude = np.linalg.norm(hann_amplitude(record.spectrum[:, columns]), axis=1)
    step = 1 / record.duration
    frequency = np.arange(len(amplitude)) * step
    least = np.maximum(_PROMINENCE * noise_floor(amplitude), smallest)
    candidate = amplitude > least
    candidate[frequency < _LOBE * step] = False
    for f in known:
        candidate[np.abs(frequency - f) < _LOBE * step] = False
    tops = [i for i in find_peaks(amplitude)[0] if candidate[i]]
    peaks = [float(frequency[i] + step * vertex(amplitude[i - 1 : i + 2])) for i in tops]
    faint = record.lines.faint
    sizes = np.linalg.norm(record.z[len(record.z) - len(faint) :, columns], axis=1)
    at = np.minimum(np.round([line.frequency * record.duration for line in faint]).astype(int), len(least) - 1)
    return peaks + [line.frequency for line, size, limit in zip(faint, sizes, least[at]) if size > limit]


def vertex(three: FloatArray) -> float:
    """Offset of the top of the parabola through the logarithms of three neighbours [bins]."""
    a, b, c = np.log(np.maximum(three, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0


#: Parts of the record whose phasors at the excitation are looked at.
_PARTS = 64
#: Distances from the excitation at which a line is looked for [1 / record length],
_NEAREST, _FARTHEST, _STEP = 1.0, 4.5, 0.1
#: power over that of the noise that it must explain, a channel,
_CLEAR_POWER = 25.0
#: and share of what is left besides it that there may be: sidebands of a drive that changes come in pairs.
_LEFT = 0.25


def near_line(records: tuple[WholeRecord, ...], result: RunPhasors, driven: int) -> float | None:
    """Frequency [Hz] of a line close beside an excitation line; None where there is none."""
    frequency, duration = result.lines.excitation[driven].frequency, records[0].duration
    known = np.abs(np.delete(result.lines.frequencies, driven) - frequency) * duration
    if (known < _FARTHEST).any():
        return None
    parts, size = [], []
    for record in records:
        phasors, noise = _part_phasors(record, frequency)
        live = (record.used > 0.5) & (noise > np.finfo(float).tiny)
        parts.append(phasors[:, live] / noise[live])
        size.append(np.abs(result.z[:, driven, np.array(record.places)[live]]) / noise[live])
    if not sum(part.shape[1] for part in parts):
        return None
    left, shift, power = _best(np.concatenate(parts, axis=1))
    amplitude = np.nanmedian(np.linalg.norm(np.concatenate(size, axis=1), axis=1))
    channels = sum(len(record.places) for record in records)
    clear = power > _CLEAR_POWER * channels and left - _PARTS * channels < _LEFT * power
    return frequency + shift / duration if clear and power > _PARTS * (MIN_SHARE * amplitude) ** 2 else None


def _part_phasors(record: WholeRecord, frequency: float) -> tuple[ComplexArray, FloatArray]:
    """Phasors of the residual at a frequency in equal parts (n_parts, n_channels), and their noise (n_channels,)."""
    length = record.residual.shape[1] // _PARTS
    time = record.start + np.arange(length * _PARTS) / record.rate
    wave = np.exp(-2j * np.pi * frequency * time).reshape(_PARTS, length)
    rows = record.residual[:, : length * _PARTS].reshape(-1, _PARTS, length)
    phasors = np.einsum("cpl,pl->pc", rows, wave) * (2 / length)
    scale = 1.4826 * np.median(np.abs(record.residual[:, :: max(1, length // 8)]), axis=1)
    return phasors, np.maximum(2 * scale / np.sqrt(length), np.finfo(float).tiny)


def _best(parts: ComplexArray) -> tuple[float, float, float]:
    """Power that is left beside the line that explains most, its distance [1 / record length], its power."""
    time = (np.arange(_PARTS) + 0.5) / _PARTS
    steady = np.linalg.qr(np.vander(time - 0.5, 3) + 0j)[0]
    unsteady = parts - steady @ (steady.conj().T @ parts)
    total = float(np.sum(np.abs(unsteady) ** 2))

    def explained(shift: float) -> float:
        wave = np.exp(2j * np.pi * shift * time)
        wave = wave - steady @ (steady.conj().T @ wave)
        return float(np.sum(np.abs(wave.conj() @ unsteady) ** 2) / np.vdot(wave, wave).real)

    if total < _CLEAR_POWER * parts.shape[1] + _PARTS * parts.shape[1]:
        return total, 0.0, 0.0
    shifts = np.arange(_NEAREST, _FARTHEST, _STEP)
    shifts = np.concatenate([-shifts, shifts])
    step = _STEP
    while step > 1e-3:
        powers = [explained(shift) for shift in shifts]
        best = float(shifts[int(np.argmax(powers))])
        shifts, step = best + step * np.linspace(-1.0, 1.0, 9), step / 4
    power = explained(best)
    return total - power, best, power
