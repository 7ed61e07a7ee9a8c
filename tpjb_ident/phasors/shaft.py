"""The shaft of a run: its speed by tachometer and record, and where it stands against a drive that turns with it."""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.run import Run, pulse_times
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.lines import NAMED_HARMONICS, SPEED_DRIFT
from tpjb_ident.phasors.run_data import RunPhasors

#: Samples from which the speed of the run is taken.
FIRST_LOOK = 2**17
#: A tachometer this far from the set point is not believed.
MAX_DEPARTURE = 0.05
#: Mean of the unit phasors of pulses or windows below which drive and shaft are not locked.
_LOCKED = 0.98
#: The 1X line stands so many times above its scatter over the windows, or tells no phase.
_CLEAR = 10.0
#: Samples of the keyphasor that are looked at.
_LOOK = 2**17
#: Unit phasors where nothing tells the shaft's turning.
_NO_TURNS = np.empty(0, complex)


@dataclass(frozen=True)
class ShaftCourse:
    """Shaft speed over a run, whatever windows it was found in: a second fit may cut the run otherwise."""

    time: FloatArray  #: (n,), s: middle of the windows in which it was found
    speed: FloatArray  #: (n,)

    def at(self, time: FloatArray) -> FloatArray:
        """Speed at `time` (m,) [s], [Hz]."""
        return np.interp(time, self.time, self.speed)


def shaft_speed(run: Run) -> tuple[float, tuple[Condition, ...]]:
    """Shaft speed of a run [Hz]: the tachometer's, or the set point where it gives nothing usable."""
    nominal = run.point.shaft_speed_hz
    record = run.speed(0, FIRST_LOOK)
    if record is None:
        return nominal, ()
    values = record.values[np.isfinite(record.values)]
    measured = float(values.mean()) / (2 * np.pi) if len(values) else np.nan
    if abs(measured - nominal) <= MAX_DEPARTURE * max(nominal, 1.0):
        return measured, ()
    return nominal, (
        Condition("tach off set point", f"tachometer says {measured:.4g} Hz, set point {nominal:g} Hz; set point used"),
    )


def shaft_order(frequency: float, speed: float) -> int:
    """Harmonic of the shaft that an excitation stands on; 0 where it stands on none."""
    n = round(frequency / speed) if speed > 0 else 0
    near = 0 < n <= NAMED_HARMONICS and abs(frequency - n * speed) <= n * SPEED_DRIFT
    return n if near else 0


def shaft_phases(run: Run, phasors: RunPhasors) -> ComplexArray:
    """Unit phasor of what turns with the shaft at every excitation line, (n_lines,); NaN where that is not known.

    What turns with the shaft (runout of the probes, unbalance in the cells) then has the drive's frequency, and its
    phasor is the same in all runs of a point but for this phase.
    """
    phases = np.full(len(phasors.lines.excitation), np.nan + 0j)
    for i, line in enumerate(phasors.lines.excitation):
        n = shaft_order(line.frequency, phasors.lines.speed)
        turns = _by_keyphasor(run, line.frequency / n) if n else _NO_TURNS
        if n > 1 and not len(turns):
            turns = _by_first_line(phasors, line.frequency / n)
        mean = complex(np.sum(turns**n)) / max(len(turns), 1)
        if abs(mean) > _LOCKED:
            phases[i] = mean / abs(mean)
    return phases


def _by_keyphasor(run: Run, turning: float) -> ComplexArray:
    """Unit phasors at the frequency `turning` [Hz] of the shaft as every pulse of the keyphasor shows it."""
    pulses = np.empty(0)
    for channel in run.of("keyphasor")[:1]:
        record = run.record(channel.name, 0, min(run.length, _LOOK))
        pulses = pulse_times(record.values, record.time)
        pulses = pulses[np.isfinite(pulses)]
    return np.exp(-2j * np.pi * turning * pulses) if len(pulses) > 2 else _NO_TURNS


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
