"""Lines in a record that nobody mentioned: other excitations, a neighbouring machine, a loose cable, a beat of drives.

They are found in what the fit of the known lines leaves of the forces and displacements, and fitted along. Several
excitation frequencies in one record show up here too: each run of the manifest then gives its own line, the others are
fitted beside it. Within the resolution of a window windows see a beat, which looks like a drive that wanders, or like
clocks that differ. The whole record tells a line from that down to one resolution cell: beside the excitation and its
slow change, one more line explains what is left.
"""

import numpy as np
from scipy.signal import find_peaks

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.run_data import RunPhasors, phasor_noise
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
    listed_lines = result.lines.whole_frequencies
    frequencies: list[float] = []
    for quantity in ("force", "displacement"):
        places = result.pick(quantity)
        sizes = np.linalg.norm(result.z[:, : len(result.lines.excitation)][:, :, places], axis=2)
        if np.isfinite(sizes).any():
            smallest = MIN_SHARE * float(np.nanmedian(sizes))
            for record in records:
                columns = [k for k, place in enumerate(record.places) if place in places]
                if columns:
                    frequencies += _peaks(record, columns, np.append(listed_lines, frequencies), smallest)
    top = REACH * max(result.lines.driven)
    lobe = _LOBE / records[0].duration
    frequencies = [f for f in frequencies if f < top and np.abs(images - f).min(initial=np.inf) > lobe]
    strange = tuple(sorted(f for f in frequencies if f not in listed_lines))[:MAX_LINES]
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


def _peaks(record: WholeRecord, columns: list[int], lines: FloatArray, smallest: float) -> list[float]:
    """Frequencies [Hz] of lines above `smallest` in some channels: faint ones fitted, and peaks of the residual."""
    amplitude = np.linalg.norm(hann_amplitude(record.spectrum[:, columns]), axis=1)
    step = 1 / record.duration
    frequency = np.arange(len(amplitude)) * step
    least = np.maximum(_PROMINENCE * noise_floor(amplitude), smallest)
    candidate = amplitude > least
    candidate[frequency < _LOBE * step] = False
    for f in lines:
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


#: Windows that tell a line beside the excitation from its slow change, at least.
_LEAST = 8
#: Windows that its slow change and a line take of them,
_TAKEN = 4
#: distances from the excitation at which a line is looked for [1 / record length],
_NEAREST, _FARTHEST, _STEP = 1.0, 4.5, 0.1
#: power over that of the noise that it must explain, a channel,
_CLEAR_POWER = 25.0
#: and share of it that may be left a window: sidebands of a drive that changes come in pairs, steps leave more.
_LEFT = 0.004


def near_line(result: RunPhasors, driven: int, duration: float, rate: float) -> float | None:
    """Frequency [Hz] of a line close beside an excitation line of a record of `duration` [s]; None where there is none.

    Its beat shows in the windows' phasors.
    """
    frequency = result.lines.excitation[driven].frequency
    distances = np.abs(np.delete(result.lines.frequencies, driven) - frequency) * duration
    noise = phasor_noise(result, rate)
    live = np.isfinite(noise)
    z = result.z[:, driven, live] / noise[live]
    good = np.isfinite(z).all(axis=1)
    if (distances < _FARTHEST).any() or good.sum() < _LEAST or not live.any():
        return None
    windows, time = z[good], (result.start[good] + 0.5 * result.length) / duration
    remainder, shift, power = _best(windows, time)
    count, channels = windows.shape
    amplitude = float(np.median(np.linalg.norm(windows, axis=1)))
    spare = count - _TAKEN
    clear = power > _CLEAR_POWER * channels and remainder - count * channels < _LEFT * spare * power
    return frequency + shift / duration if clear and power > count * (MIN_SHARE * amplitude) ** 2 else None


def _best(windows: ComplexArray, time: FloatArray) -> tuple[float, float, float]:
    """Power that is left beside the line that explains most, its distance [1 / record length], its power.

    `windows` (n, m), `time` (n,) over the record's length.
    """
    steady = np.linalg.qr(np.vander(time - 0.5, 3) + 0j)[0]
    unsteady = windows - steady @ (steady.conj().T @ windows)
    total = float(np.sum(np.abs(unsteady) ** 2))

    def explained(shifts: FloatArray) -> FloatArray:
        waves = np.exp(2j * np.pi * np.multiply.outer(time, shifts))
        waves -= steady @ (steady.conj().T @ waves)
        power = np.sum(np.abs(waves.conj().T @ unsteady) ** 2, axis=1)
        return np.asarray(power / np.sum(np.abs(waves) ** 2, axis=0))

    shifts = np.arange(_NEAREST, _FARTHEST, _STEP)
    shifts = np.concatenate([-shifts, shifts])
    for step in _STEP / 4.0 ** np.arange(5):
        powers = explained(shifts)
        best, power = float(shifts[np.argmax(powers)]), float(powers.max())
        shifts = best + step * np.linspace(-1.0, 1.0, 9)
    return total - power, best, power
