"""Mains frequency of a campaign: as the manifest states it, else as the records show it.

It matters where an excitation stands on 50 or 60 Hz; elsewhere a mains line of either frequency is found like any
other. So only then a few records are looked at, those in which nothing else stands there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import RigDataError
from rigdata.run import Run

#: Excitations this near to one of them make the question matter [Hz].
_NEAR = 0.3
#: Runs and samples that are looked at.
_MAX_RUNS, _LOOK = 6, 2**14
#: A line stands this many times above what is around it,
_CLEAR = 6.0
#: other lines are farther away than this [Hz].
_APART = 1.0


def mains_frequency(campaign: Campaign, usual: float) -> float:
    """Frequency of the mains [Hz]."""
    nominal = getattr(campaign, "mains", None)
    if nominal is not None:
        return float(nominal)
    dynamic = campaign.of_kind("dynamic")
    coincident = [c for c in MAINS_FREQUENCIES if any(abs(run.point.excitation_hz - c) < _NEAR for run in dynamic)]
    if not coincident or usual not in MAINS_FREQUENCIES:
        return usual
    votes = {c: _votes(campaign.runs, c) for c in MAINS_FREQUENCIES}
    best = max(MAINS_FREQUENCIES, key=lambda c: (votes[c], c == usual))
    if votes[best] == 0 and len(coincident) == 1:
        return coincident[0]  # it cannot be ruled out, and must be named
    return best


def _votes(runs: Sequence[Run], choice: float) -> int:
    """In how many runs a line stands at `choice` where nothing else does."""
    count = visible = 0
    for run in runs:
        if visible >= _MAX_RUNS:
            break
        point = run.point
        others = [k * point.excitation_hz for k in (1, 2, 3)] + [k * point.shaft_speed_hz for k in range(1, 7)]
        if any(abs(f - choice) < _APART for f in others):
            continue
        shown = _stands_out(run, choice)
        if shown is not None:
            visible += 1
            count += shown
    return count


def _stands_out(run: Run, choice: float) -> bool | None:
    try:
        length = min(run.length, _LOOK)
        records = [run.vector(q, 0, length) for q in ("displacement", "force")]
    except RigDataError:  # the run's own reading says so
        return None
    usable = [record for record in records if record.rate >= 3 * choice and len(record) >= record.rate]
    return any(_line_in(record.values, record.rate, choice) for record in usable) if usable else None


def _line_in(values: FloatArray, rate: float, choice: float) -> bool:
    if not np.isfinite(values).all():
        return False
    n = len(values)
    spectrum = np.abs(np.fft.rfft((values - values.mean(axis=0)) * np.hanning(n)[:, None], axis=0))
    amplitude = np.linalg.norm(spectrum, axis=1)
    frequency = np.fft.rfftfreq(n, 1 / rate)
    width = max(0.2, 2 * rate / n)
    line = np.abs(frequency - choice) <= width
    around = (np.abs(frequency - choice) > 2 * width) & (np.abs(frequency - choice) < 2 * width + 4.0)
    return bool(amplitude[line].max() > _CLEAR * np.median(amplitude[around]))
