"""Bad steps and slips of a dry test: a knock, a probe that jumped and came back, a shaft that slipped and stays there.

Each hold is tested as a whole against the most flexible law, with the noise as it is correlated. Would a shift of this
hold alone, or of all that comes after a ramp, explain the record better, and by how many standard errors? The most
telling are tried; the one that the evidence likes best is made, then the remainder is tested again.
"""

import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.dry_record import DryRecord
from tpjb_ident.pivot.law_fit import FitData, LawFit, fit_law
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.readings import fit_data, score_of

GROUPS_ON_RAMP = 15
_BAD_LIMIT = 5.0  # standard errors
_MOST_BAD = 0.3  # share of the groups that may be dropped
_TRIALS = 6  # of the changes that the score calls for most


def sound_parts(record: DryRecord, noise: NoiseModel) -> list[DryRecord]:
    """The record without bad steps, in parts wherever the shaft slipped: from there on it has another zero."""
    groups = _groups(record)
    numbers = np.unique(groups)
    # every group by itself, and all that comes after a ramp
    columns = np.hstack([groups[:, None] == numbers, (groups[:, None] > numbers) & (numbers % 2 == 0)])
    trial = _tried(record, np.zeros(len(groups), dtype=int), record.good, noise, ("spline",))
    size = _standard_errors(trial.fit, trial.data, columns[trial.good])
    if np.max(size) < _BAD_LIMIT:
        return [record]
    # what a law with a kink explains is no slip
    best = _tried(record, trial.part, trial.good, noise)
    for _ in range(int(_MOST_BAD * len(numbers))):
        size = _standard_errors(best.fit, best.data, columns[best.good])
        trials = []
        for change in np.argsort(-size)[:_TRIALS]:
            worst = numbers[change % len(numbers)]
            part = best.part + (change >= len(numbers)) * (groups > worst)
            # a hold goes with the ramps on either side: whatever spoilt it need not have kept to its limits
            trials.append(_tried(record, part, best.good & (np.abs(groups - worst) > worst % 2), noise))
        trial = max(trials, key=operator.attrgetter("merit"))
        if trial.merit < best.merit + 0.5 * _BAD_LIMIT**2:
            break
        best = trial
    return _parts(record, best.part, best.good)


@dataclass(frozen=True)
class _Trial:
    """A record in parts, some of it left out, and the law that explains it best."""

    part: IntArray  #: (m,) number of the part that each block belongs to
    good: BoolArray  #: (m,)
    data: FitData
    fit: LawFit

    @property
    def merit(self) -> float:
        """Logarithm of the evidence; a block that is left out counts as one that fits as well as most.

        The zero of another part may be anywhere: what it can be has its price.
        """
        precision = np.log(np.diag(self.data.whitener))
        return self.fit.log_evidence + np.sum(0.5 + precision - np.median(precision))


def _tried(
    record: DryRecord, part: IntArray, good: BoolArray, noise: NoiseModel, laws: Sequence[str] = ("spline", "bilinear")
) -> _Trial:
    data = fit_data(_parts(record, part, good), noise)
    fits = [fit_law(LAWS[name], True, data) for name in laws]
    return _Trial(part, good, data, max(fits, key=operator.attrgetter("log_evidence")))


def _parts(record: DryRecord, part: IntArray, good: BoolArray) -> list[DryRecord]:
    parts = []
    for number in np.unique(part[good]):
        members = part == number
        parts.append(replace(record, blocks=record.blocks.take(members), good=good[members]))
    return parts


def _standard_errors(fit: LawFit, data: FitData, columns: BoolArray) -> FloatArray:
    """By how many standard errors each change (m, k) of the readings is there, (k,)."""
    shift, remainder, score = score_of(fit, data, columns)
    information, whole = np.sum(shift * remainder, axis=0), np.sum(shift**2, axis=0)
    # what the law can take up tells nothing
    return np.where(information > 1e-6 * whole, np.abs(score) / np.sqrt(np.maximum(information, 1e-300)), 0.0)


def _groups(record: DryRecord) -> IntArray:
    """Number (m,) of the stretch that each block belongs to: odd for holds, even for ramps, in order of time."""
    hold = record.blocks.hold
    if not record.holds:
        return 2 * (np.arange(len(hold)) * GROUPS_ON_RAMP // len(hold))
    return np.where(hold >= 0, 2 * hold + 1, 2 * np.maximum.accumulate(hold) + 2)
