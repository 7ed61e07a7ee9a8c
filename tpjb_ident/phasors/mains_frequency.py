"""Mains frequency of a campaign: as the manifest states it, else as the records show it.

It matters where an excitation stands on 50 or 60 Hz; elsewhere a mains line of either frequency is found like any
other. So only then a few records are looked at, those in which nothing else stands there.
"""

from collections.abc import Sequence

import numpy as np

from rigdata.campaign import Campaign
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.phasors.whole_record import hann_amplitude

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
    if campaign.mains is not None:
        return campaign.mains
    driven = np.array([run.point.excitation_hz for run in campaign.of_kind("dynamic")])
    coincident = [c for c in MAINS_FREQUENCIES if (np.abs(driven - c) < _NEAR).any()]
    if not coincident or usual not in MAINS_FREQUENCIES:
        return usual
    votes = {c: _votes(campaign.runs, c) for c in MAINS_FREQUENCIES}
    best = max(MAINS_FREQUENCIES, key=lambda c: (votes[c], c == usual))
    if votes[best] == 0 and len(coincident) == 1:
        return coincident[0]  # it cannot be ruled out, and must be named
    return best


def _votes(runs: Sequence[Run], choice: float) -> int:
    """In how many runs a line stands at `choice` [Hz] where nothing else does."""
    lines: list[bool] = []
    for run in runs:
        point = run.point
        multiples = np.outer(np.arange(1, 7), [point.excitation_hz, point.shaft_speed_hz])
        multiples[3:, 0] = np.inf  # higher harmonics of a drive are faint
        if len(lines) < _MAX_RUNS and (np.abs(multiples - choice) >= _APART).all():
            lines += _line_at(run, choice)
    return sum(lines)


def _line_at(run: Run, choice: float) -> list[bool]:
    """Whether forces or displacements of a run show a line at `choice` [Hz]; nothing where they cannot."""
    try:
        records = [run.vector(q, 0, min(run.length, _LOOK)) for q in ("displacement", "force")]
    except RigDataError:  # the run's own reading says so
        return []
    shown = []
    for record in records:
        if record.rate >= 3 * choice and len(record) >= record.rate:
            # a missing value leaves no spectrum, and no line in it
            amplitude = np.linalg.norm(hann_amplitude(np.fft.rfft(record.values, axis=0)), axis=1)
            step = record.rate / len(record)
            away, width = np.abs(step * np.arange(len(amplitude)) - choice), max(0.2, 2 * step)
            around = (away > 2 * width) & (away < 2 * width + 4.0)
            shown.append(bool(amplitude[away <= width].max() > _CLEAR * np.median(amplitude[around])))
    return [any(shown)] if shown else []
