"""A line within the resolution of a window beside the excitation: a second machine, the mains, a beat of two drives.

Windows see a beat, which looks like a drive that wanders, or like clocks that differ. The whole record tells a line
from that down to one resolution cell: beside the excitation and its slow change, one more line explains what is left.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.whole_record import WholeRecord

#: Parts of the record whose phasors at the excitation are looked at.
_PARTS = 64
#: Distances from the excitation at which a line is looked for [1 / record length],
_NEAREST, _FARTHEST, _STEP = 1.0, 4.5, 0.1
#: power over that of the noise that it must explain, a channel,
_CLEAR = 25.0
#: and share of what is left besides it that there may be: sidebands of a drive that changes come in pairs.
_LEFT = 0.25
#: A line with less than this share of the excitation cannot bend its phasor.
_SHARE = 2e-3


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
    clear = power > _CLEAR * channels and left - _PARTS * channels < _LEFT * power
    return frequency + shift / duration if clear and power > _PARTS * (_SHARE * amplitude) ** 2 else None


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

    if total < _CLEAR * parts.shape[1] + _PARTS * parts.shape[1]:
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
