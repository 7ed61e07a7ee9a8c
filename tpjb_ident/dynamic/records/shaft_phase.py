"""Where the shaft stands against a drive that turns with it: at 1X, 2X or 3X, by the keyphasor or by the 1X line.

What turns with the shaft (runout of the probes, unbalance in the cells) then has the drive's frequency, and its phasor
is the same in all runs of a point but for this phase.
"""

from __future__ import annotations

import numpy as np

from rigdata.run import Run, pulse_times
from tpjb_ident.arrays import ComplexArray
from tpjb_ident.dynamic.records.run_data import MeasuredRun, RunPhasors
from tpjb_ident.dynamic.spectral_lines.lines import LineSettings

#: Mean of the unit phasors of pulses or windows below which drive and shaft are not locked.
LOCKED = 0.98
#: The 1X line stands so many times above its scatter over the windows, or tells no phase.
CLEAR = 10.0
#: Samples of the keyphasor that are looked at.
LOOK = 2**17


def shaft_order(frequency: float, speed: float, settings: LineSettings | None = None) -> int:
    """Harmonic of the shaft that an excitation stands on; 0 where it stands on none.

    Parameters
    ----------
    frequency, speed : float
        Of the excitation and of the shaft [Hz].
    settings : LineSettings, optional
    """
    settings = settings or LineSettings()
    n = round(frequency / speed) if speed > 0 else 0
    near = 0 < n <= settings.named_harmonics and abs(frequency - n * speed) <= n * settings.speed_wander
    return n if near else 0


def shaft_phases(run: MeasuredRun, phasors: RunPhasors) -> ComplexArray:
    """Unit phasor of what turns with the shaft at every excitation line, (n_lines,); NaN where that is not known.

    Parameters
    ----------
    run : MeasuredRun
    phasors : RunPhasors
        Of the run, with its nuisance lines.
    """
    found = np.full(len(phasors.lines.excitation), np.nan + 0j)
    for i, line in enumerate(phasors.lines.excitation):
        n = shaft_order(line.frequency, phasors.lines.speed)
        if not n:
            continue
        turns = _by_keyphasor(run, line.frequency / n)
        if turns is None and n > 1:
            turns = _by_first_line(phasors, line.frequency / n)
        if turns is None:
            continue
        known = turns[np.isfinite(turns)]
        mean = complex(np.sum(known**n)) / max(len(known), 1)
        if abs(mean) > LOCKED:
            found[i] = mean / abs(mean)
    return found


def _by_keyphasor(run: MeasuredRun, turning: float) -> ComplexArray | None:
    """Unit phasors at the frequency `turning` [Hz] of the shaft as every pulse of the keyphasor shows it."""
    names = [c.name for c in run.channels.values() if c.quantity == "keyphasor"]
    if not names or not isinstance(run, Run):
        return None
    record = run.record(names[0], 0, min(run.length, LOOK))
    pulses = pulse_times(record.values, record.time)
    pulses = pulses[np.isfinite(pulses)]
    return np.exp(-2j * np.pi * turning * pulses) if len(pulses) > 2 else None


def _by_first_line(phasors: RunPhasors, turning: float) -> ComplexArray | None:
    """Unit phasors at the frequency `turning` [Hz] of the forward part of the 1X line in every window."""
    lines = phasors.lines.excitation + phasors.lines.nuisance
    place = [k for k, line in enumerate(lines) if line.name == "1X"]
    if not place:
        return None
    d = phasors.displacement.phasors[:, place[0]]
    middle = phasors.start + 0.5 * phasors.length
    z = (d[:, 0] + 1j * d[:, 1]) * np.exp(2j * np.pi * (lines[place[0]].frequency - turning) * middle)
    good = z[np.isfinite(z)]
    if not len(good) or not abs(good.mean()) > CLEAR * good.std() / np.sqrt(len(good)):
        return None
    return np.asarray(z / np.abs(z))
