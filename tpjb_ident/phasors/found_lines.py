"""Lines in a record that nobody mentioned: other excitations, a neighbouring machine, a loose cable, a beat of drives.

They are found in what the fit of the known lines leaves of the forces and displacements, and fitted along. Several
excitation frequencies in one record show up here too: each run of the manifest then gives its own line, the others are
fitted beside it. Within the resolution of a window windows see a beat, which looks like a drive that wanders, or like
clocks that differ. The whole record tells a line from that down to one resolution cell: beside the excitation and its
slow change, one more line explains what is left.
"""

import numpy as np
from scipy.optimize import minimize
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
    least = np.maximum(_PROMINENCE * noise_floor(amplitude), smallest)
    tops = find_peaks(amplitude, height=least)[0]
    tops = tops[np.abs(tops[:, None] * step - [0.0, *lines]).min(axis=1) >= _LOBE * step]
    peaks = [float(i * step + step * vertex(amplitude[i - 1 : i + 2])) for i in tops]
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
_LEAST = 6
#: Windows that its slow change and a line take of them,
_TAKEN = 4
#: distances from the excitation at which a line is looked for [1 / record length],
_NEAREST, _FARTHEST, _STEP = 1.0, 4.5, 0.1
#: power over that of the noise that it must explain, a channel,
_CLEAR_POWER = 25.0
#: and share of it that may be left a window: sidebands of a drive that changes come in pairs, steps leave more.
_LEFT = 0.004


def near_line(result: RunPhasors, driven: int, duration: float, rate: float) -> tuple[float, float] | None:
    """Frequencies [Hz] of an excitation line of a record of `duration` [s] and of a line close beside it, if there is.

    Its beat shows in the windows' phasors. A drive that is off its set point, or changes slowly, has none.
    """
    frequency = result.lines.excitation[driven].frequency
    others = (np.delete(result.lines.frequencies, driven) - frequency) * duration
    noise = phasor_noise(result, rate)
    live = np.isfinite(noise)
    z = result.z[:, driven, live] / noise[live]
    good = np.isfinite(z).all(axis=1)
    if good.sum() < _LEAST:
        return None
    windows, time = z[good], (result.start[good] + 0.5 * result.length) / duration
    count, channels = windows.shape
    smallest = max(
        _CLEAR_POWER * channels, count * (MIN_SHARE * float(np.median(np.linalg.norm(windows, axis=1)))) ** 2
    )
    if float(_left(windows, time, np.zeros((1, 1)))[0]) < smallest:
        return None
    # beyond half a turn from window to window phases say nothing
    alone = _least(windows, time, np.arange(-0.45 * count, 0.45 * count, _STEP)[:, None])
    distances = np.arange(-_FARTHEST, _FARTHEST, _STEP)
    for drive in (0.0, float(alone[0])):
        apart = np.abs(np.subtract.outer(drive + distances, np.append(drive, others))).min(axis=1) >= _NEAREST
        pair = _least(windows, time, drive + np.multiply.outer(distances[apart], [0.0, 1.0]))
        if drive:
            pair = minimize(lambda places: _left(windows, time, places[None])[0], pair, method="Nelder-Mead").x
        remainder = float(_left(windows, time, pair[None])[0])
        power = float(_left(windows, time, np.array([alone, pair[:1]])).min()) - remainder
        if power > smallest and remainder - count * channels < _LEFT * (count - _TAKEN) * power:
            exact, near = (frequency + pair / duration).tolist()
            return exact, near
    return None


def _left(windows: ComplexArray, time: FloatArray, places: FloatArray) -> FloatArray:
    """Power that a drive which changes slowly, and a steady line beside it, leave of windows (n, m), (k,).

    `time` (n,) over the record's length, `places` (k, 1 or 2) of drive and line from the set point [1 / record length].
    """
    waves = np.exp(2j * np.pi * time[:, None] * places[:, None, :])
    basis = np.linalg.qr(np.concatenate([np.vander(time - 0.5, 3) * waves[..., :1], waves[..., 1:]], axis=2))[0]
    explained = np.sum(np.abs(basis.conj().swapaxes(1, 2) @ windows) ** 2, axis=(1, 2))
    return np.sum(np.abs(windows) ** 2) - explained


def _least(windows: ComplexArray, time: FloatArray, places: FloatArray) -> FloatArray:
    """Places (1 or 2,) that leave least: of some (k, 1 or 2), then with the last one between these."""
    for step in _STEP / 4.0 ** np.arange(5):
        best = places[np.argmin(_left(windows, time, places))]
        places = np.tile(best, (9, 1))
        places[:, -1] += step * np.linspace(-1.0, 1.0, 9)
    return np.asarray(best)
