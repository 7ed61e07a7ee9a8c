"""Accelerometers held against load cells over a band, by the judgement of the sine's path.

The housing is a mass on springs at every line, so neighbouring lines tell the same ratio once each is brought to one
frequency by its square. A period's line counts by its repeats, a bin of a whole record by what the others scatter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.spectra.run_spectra import RunSpectra
from tpjb_ident.dynamic.instruments.housing_balance import BalanceRun, balances

#: Parts of the band that are judged one by one: a lag shows at the top, a sign everywhere.
PARTS = 8
#: Lines that a part has at least.
LEAST = 6


def band_balance(spectra: Sequence[RunSpectra]) -> tuple[float, tuple[Condition, ...]]:
    """By how much the cells are late [s], zero where that is not clear, and what to say of the accelerometers.

    Parameters
    ----------
    spectra : sequence of RunSpectra
        Of the runs of one operating point, with the same bins.
    """
    if spectra[0].phasors.acceleration is None:
        return 0.0, ()
    free = np.flatnonzero(~np.any([s.taken for s in spectra], axis=0))
    parts = np.array_split(free, min(PARTS, max(len(free) // LEAST, 1)))
    found = balances([run for part in parts for s in spectra for run in _lines(s, part.tolist())])
    told = merged(*(found[f].conditions for f in sorted(found, reverse=True)))
    if "accelerometers-contradict-cells" in told:  # where the housing's inertia is larger
        told = tuple(c for c in told if c != "accelerometers-doubtful")
    lags = [verdict.phase / (2 * np.pi * f) for f, verdict in found.items()]
    return max(lags, default=0.0), told


def _lines(spectra: RunSpectra, part: Sequence[int]) -> list[BalanceRun]:
    """Every line of a part of the band, brought to the part's middle: acceleration grows with the square."""
    if not len(part):
        return []
    middle = float(np.median(spectra.frequencies[list(part)]))
    mass, windows = spectra.phasors.housing_mass, len(spectra.D)
    found = []
    for k in part:
        every = spectra.A[:, k] * (middle / spectra.frequencies[k]) ** 2
        A, own, F = every.mean(axis=0), spectra.A[:, k].mean(axis=0), spectra.F[:, k].mean(axis=0)
        variance = float(np.sum(np.abs(every - A) ** 2)) / max(4 * (windows - 1), 1)
        share = float(mass * np.linalg.norm(own) / max(float(np.linalg.norm(F)), 1e-300))
        found.append(BalanceRun(middle, F - mass * own, A, share, mass, variance, windows))
    return found
