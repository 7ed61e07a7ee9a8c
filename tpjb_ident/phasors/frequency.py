"""Frequencies of a run beside what is stated: the shaft's by tachometer and record, the lines' by a first fit.

Set points are not frequencies: the shaft creeps and the generator has a clock of its own. The phase
advance from window to window tells a frequency error to a fraction of the line's width. And where the shaft stands
against a drive that turns with it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from rigdata.run import Run, pulse_times
from tpjb_ident.conditions import Condition, Conditions, holding
from tpjb_ident.phasors.line_fit import robust_deviation
from tpjb_ident.phasors.lines import NAMED_HARMONICS, SPEED_DRIFT, LineSet, known_lines
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors

#: Samples of a tachometer that are looked at.
FIRST_LOOK = 2**17
#: A tachometer this far from the set point is not believed.
MAX_DEPARTURE = 0.05
#: The 1X line stands so many times above its scatter over the windows, or tells no phase.
_CLEAR = 10.0
#: Unit phasors where nothing tells the shaft's turning.
_NO_TURNS = np.empty(0, complex)


class ShaftCourse(NamedTuple):
    """Shaft speed over a run, whatever windows it was found in: a second fit may cut the run otherwise."""

    time: FloatArray  #: (n,), s: middle of the windows in which it was found
    speed: FloatArray  #: (n,), Hz


def shaft_speed(run: Run) -> tuple[float, Conditions]:
    """Shaft speed of a run [Hz]: the tachometer's, or the set point where it gives nothing usable."""
    nominal = run.point.shaft_speed_hz
    record = run.speed(0, FIRST_LOOK)
    if record is None:
        return nominal, ()
    values = record.values[np.isfinite(record.values)]
    measured = values.mean() / (2 * np.pi) if len(values) else np.nan
    if abs(measured - nominal) <= MAX_DEPARTURE * max(nominal, 1.0):
        return (measured if nominal else 0.0), ()  # at standstill a tachometer shows noise
    return nominal, (
        Condition("tach off set point", f"tachometer says {measured:.4g} Hz, set point {nominal:g} Hz; set point used"),
    )


def shaft_order(frequency: float, speed: float) -> int:
    """Harmonic of the shaft that an excitation stands on; 0 where it stands on none."""
    n = round(frequency / speed) if speed > 0 else 0
    near = 0 < n <= NAMED_HARMONICS and abs(frequency - n * speed) <= n * SPEED_DRIFT
    return n if near else 0


def shaft_phases(run: Run, phasors: RunPhasors) -> ComplexArray:
    """Mean phasor over the run of what turns with the shaft at every excitation line, (n_lines,); NaN if not known.

    What turns with the shaft (runout of the probes, unbalance in the cells) is the same in all runs of a point but for
    this factor: of size one where the drive is locked to the shaft, else of what their beat leaves of it.
    """
    phases = np.full(len(phasors.lines.excitation), np.nan + 0j)
    for i, line in enumerate(phasors.lines.excitation):
        n = shaft_order(line.frequency, phasors.lines.speed)
        turns = _by_keyphasor(run, line.frequency / n) if n else _NO_TURNS
        if n > 1 and not len(turns):
            turns = _by_first_line(phasors, line.frequency / n)
        if len(turns) > 2:
            phases[i] = np.mean(turns**n)
    return phases


def _by_keyphasor(run: Run, turning: float) -> ComplexArray:
    """Unit phasors at the frequency `turning` [Hz] of the shaft as every pulse of the keyphasor shows it."""
    for channel in run.of("keyphasor")[:1]:
        record = run.record(channel.name)
        pulses = pulse_times(record.values, record.time)
        return np.asarray(np.exp(-2j * np.pi * turning * pulses[np.isfinite(pulses)]))
    return _NO_TURNS


def _by_first_line(phasors: RunPhasors, turning: float) -> ComplexArray:
    """Unit phasors at the frequency `turning` [Hz] of the forward part of the 1X line in every window that has one."""
    place = phasors.lines.place("1X")
    if place is None:
        return _NO_TURNS
    d = phasors.displacement[:, place]
    middle = phasors.start + 0.5 * phasors.length
    z = (d[:, 0] + 1j * d[:, 1]) * np.exp(2j * np.pi * (phasors.lines.frequencies[place] - turning) * middle)
    z = z[np.abs(z) > 0.0]  # a window at rest, or without the line, tells none
    is_clear = len(z) and abs(z.mean()) > _CLEAR * z.std() / np.sqrt(len(z))
    return z / np.abs(z) if is_clear else _NO_TURNS


#: Name of the condition that a shaft's changing speed gives rise to.
DRIFT = "speed drifts"
#: Phase advance over a run [cycles] that a frequency may be off before the fit is repeated.
MAX_SLIP = 0.01
#: Phase advance within a window [cycles] up to which a line's frequency can be put right in the phasors themselves:
#: what the fit has lost of its amplitude (4e-5) is the same for all channels.
MAX_RETUNED = 0.005
#: Phase [cycles] by which a device's clock may run ahead within one window: lines beside the drive would take it up.
MAX_CLOCK_SLIP = 5e-4
#: Phase [cycles] by which the shaft may run ahead or behind within one window.
MAX_WINDOW_SLIP = 0.005
_ALL = slice(None)


class Tuning(NamedTuple):
    """What to do better in a second fit."""

    lines: LineSet
    follow: ShaftCourse | None
    conditions: Conditions
    settled: bool  #: whether the windows told the shaft's course: a drive far off its set point hides it


def retuned(result: RunPhasors, lines: LineSet) -> RunPhasors | None:
    """The fit as it would be with slightly other frequencies, without reading the run again.

    Over a window a line that is off by df turns by pi df T on average; the rest is where its phase is counted from.
    """
    former = result.lines
    names = [line.name for line in former.excitation + former.nuisance]
    if names != [line.name for line in lines.excitation + lines.nuisance]:
        return None
    shift = lines.frequencies - former.frequencies
    if np.abs(shift).max() * result.length > MAX_RETUNED:
        return None
    turn = np.exp(-2j * np.pi * np.multiply.outer(result.start + 0.5 * result.length, shift))
    return replace(result, z=result.z * turn[:, :, None], lines=lines)


class _Advance(NamedTuple):
    """How a line's phase advances from window to window beyond its frequency."""

    windows: IntArray  #: (n,): that show it
    steps: FloatArray  #: (n - 1,), Hz: error of its frequency between neighbours
    doubt: float  #: Hz: standard error of a step between neighbours

    @property
    def slip(self) -> float:
        """Error of the frequency that stands clear of the steps' scatter [Hz], else zero."""
        slip = float(np.median(self.steps))
        spread = robust_deviation(self.steps - slip)
        return slip if abs(slip) > 4 * spread / np.sqrt(len(self.steps)) else 0.0


def phase_advance(phasors: ComplexArray, start: FloatArray, noise: float) -> _Advance | None:
    """Advance of phasors (n, m) of one noise at `start` (n,) [s]; None where they do not stand clear of it."""
    windows = np.flatnonzero(np.isfinite(phasors).all(axis=1))
    if len(windows) < 3:
        return None
    z, spacing = phasors[windows], np.diff(start[windows])
    size = np.median(np.linalg.norm(z, axis=1))
    if not size > 10 * noise:
        return None
    turns = np.angle(np.einsum("ni,ni->n", z[1:], z[:-1].conj())) / (2 * np.pi)
    return _Advance(windows, turns / spacing, noise / size / (2 * np.pi * float(np.median(spacing))))


def _line_slip(result: RunPhasors, line: int | None, places: list[int] | slice = _ALL) -> float:
    """Frequency error of a line by some channels together, each weighted by its power over its noise [Hz]."""
    if line is None:
        return 0.0
    z, noise = result.z[:, line, places], 0.5 * result.noise[places]
    present = np.isfinite(z).any(axis=0) & np.isfinite(noise)
    # a channel without noise must not stand for all
    least = 1e-9 * np.nanmax(np.abs(z[:, present]), axis=0)
    advance = phase_advance(z[:, present] / np.maximum(noise[present], least), result.start, 1.0)
    return 0.0 if advance is None else advance.slip


def tuned(run: Run, result: RunPhasors, driven: tuple[float, ...], settings: PhasorSettings) -> Tuning | None:
    """Compare a first fit with what it assumed; None where it was good enough."""
    span = result.start[-1] - result.start[0] + result.length
    slips = np.array([_line_slip(result, i) for i in range(len(result.lines.excitation))])
    slips[np.abs(slips) * span <= MAX_SLIP] = 0.0
    exact = tuple((np.array(result.lines.driven) + slips).tolist())
    settled = bool(np.all(np.abs(slips) * result.length <= MAX_RETUNED))
    turning, follow = _line_slip(result, result.lines.place("1X")), _drifting(result) if settled else None
    if not slips.any() and follow is None and abs(turning) * span <= 5 * MAX_SLIP:
        return None
    shown, stated = ", ".join(f"{f:.5g}" for f in exact), ", ".join(f"{f:g}" for f in driven)
    text = f"excitation found at {shown} Hz, set point {stated} Hz; the found one was used for the fit"
    conditions = holding((slips.any(), "excitation off set point", text))
    if follow is not None:
        low, high = follow.speed.min(), follow.speed.max()
        conditions += (Condition(DRIFT, f"shaft speed between {low:.4g} and {high:.4g} Hz; followed by window"),)
    rate = run.sample_rate
    speed = result.lines.speed + turning
    lines = known_lines(exact, speed, rate, settings.mains, result.lines.found, run.length / rate)
    return Tuning(lines, follow, conditions, settled)


def device_rates(result: RunPhasors) -> dict[str, float]:
    """How much faster the clocks of several devices let the excitation turn than the lines have it, relative."""
    devices = tuple(dict.fromkeys(result.device))
    if len(devices) < 2:
        return {}
    frequency = result.lines.excitation[0].frequency
    rates = {}
    for device in devices:
        places = [k for k, name in enumerate(result.device) if name == device]
        rates[device] = _line_slip(result, 0, places) / frequency
    ahead = max(abs(value) for value in rates.values()) * frequency * result.length
    return rates if ahead > MAX_CLOCK_SLIP else {}


def exact_frequencies(result: RunPhasors, places: list[int]) -> FloatArray:
    """Frequencies of the whole record's lines by the clock of some channels, (n_whole_lines,) [Hz]."""
    turning = _line_slip(result, result.lines.place("1X"), places)
    frequencies = result.lines.with_slip(turning)
    for k, line in enumerate(result.lines.whole):
        if line.name in ("excitation", "mains"):
            frequencies[k] += _line_slip(result, k, places)
    return frequencies


def _drifting(result: RunPhasors) -> ShaftCourse | None:
    """Course of the speed, where the shaft's phase runs away within a window.

    Where no runout tells it there is nothing to follow; a tachometer's own noise looks like a drift.
    """
    speeds, doubt = speeds_from_runout(result) or (np.empty(0), 0.0)
    good = np.isfinite(speeds)
    if good.sum() < 2 or np.ptp(speeds[good]) / 2 <= max(MAX_WINDOW_SLIP / result.length, 4 * doubt):
        return None
    return ShaftCourse(result.start[good] + 0.5 * result.length, speeds[good])


def speeds_from_runout(result: RunPhasors) -> tuple[FloatArray, float] | None:
    """Shaft speed in every window (n,) from the turning of its 1X phasors in the probes, and its standard error [Hz].

    Runout and unbalance draw the same 1X from window to window; between the middles of two windows its phase
    advances by what the shaft is ahead of the frequency fitted.
    """
    line = result.lines.place("1X")
    if line is None:
        return None
    noise = 0.5 * np.median(result.noise[result.pick("displacement")])
    advance = phase_advance(result.displacement[:, line], result.start, noise)
    if advance is None:
        return None
    speeds = np.full(len(result.start), np.nan)
    steps = np.concatenate([advance.steps[:1], advance.steps, advance.steps[-1:]])
    speeds[advance.windows] = result.lines.frequencies[line] + 0.5 * (steps[1:] + steps[:-1])
    return speeds, advance.doubt
