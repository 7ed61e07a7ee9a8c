"""Scores: the evidence of one more fault beside a fitted model, to first order about the fault's own path.

No prediction is needed: the model's residual and derivatives at its solved point, and the path of every fault from
the baseline. At every scale the numbers that the model has already are integrated out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Levels, Linear
from tpjb_ident.diagnosis.comparison.paths import Path
from tpjb_ident.diagnosis.observations.constants import Deciding

#: Scales of which straight columns give the amplitudes to look at.
_EVERY = 4


@dataclass(frozen=True)
class Score:
    """What a fault would make of a model."""

    path: Path
    total: float  #: log p(y | model and fault) [nats]
    amplitudes: FloatArray = field(repr=False)  #: (k,): most probable, counted from where nothing happens
    scale: float  #: likeliest scale of the model's error
    p: float  #: probability that a tolerance would be as far out as the farthest one


@dataclass(frozen=True)
class Strain:
    """How far combinations of tolerances are out."""

    rows: FloatArray = field(repr=False)  #: (c, k): of prior variance 1
    heard: FloatArray = field(repr=False)  #: (c,): share of that which the data take away

    def significance(self, theta: FloatArray) -> FloatArray:
        """Standard normal where they hold, since a posterior mean scatters so; 0 where data say nothing, (c,)."""
        out, asked = np.zeros(len(self.rows)), self.heard > Deciding.silent
        out[asked] = self.rows[asked] @ theta / np.sqrt(self.heard[asked])
        return out

    def p(self, theta: FloatArray) -> float:
        """Probability that one of them is as far out as the farthest one; `theta` (k,)."""
        farthest = np.max(np.abs(self.significance(theta)), initial=0.0)
        count = max(int(np.sum(self.heard > Deciding.silent)), 1)
        return min(1.0, count * 2.0 * float(ndtr(-farthest)))


def separations(white: FloatArray) -> FloatArray:
    """Standard deviations between every effect, of a size that is seen, and what another can imitate of it, (k, k)."""
    with np.errstate(invalid="ignore", divide="ignore"):  # a signature of nothing has no direction: NaN
        unit = white / np.linalg.norm(white, axis=0)
    return Deciding.seen * np.sqrt(np.maximum(1.0 - (unit.T @ unit) ** 2, 0.0))


def scores(errors: ErrorModel, linear: Linear, paths: Sequence[Path], strain: Strain) -> list[Score]:
    """Score every fault beside a model, the best first."""
    if not paths:
        return []
    levels = Levels.of(errors, linear, np.column_stack([path.columns for path in paths]))
    widths = Strain(strain.rows * linear.width, strain.heard)
    out, start = [], 1
    for path in paths:
        at = slice(start, start + path.columns.shape[1])
        start = at.stop
        out.append(_score(path, at, levels, widths))
    return sorted(out, key=lambda score: -score.total)


def _score(path: Path, at: slice, levels: Levels, strain: Strain) -> Score:
    errors, width = levels.errors, path.fault.width
    product = levels.product(at)
    pull, square = product[:, 0, 1:], product[:, 1:, 1:]
    grids = [path.tried(*pair) for pair in zip(pull[::_EVERY], square[::_EVERY], strict=True)]
    tried = np.unique(np.vstack(grids), axis=0)
    weights, slopes = path.weights(tried), path.slopes(tried) * width
    prior = np.sum((tried / width) ** 2, axis=1)
    change = 2.0 * pull @ weights.T - np.sum((weights @ square) * weights, axis=2) - prior
    inner = np.swapaxes(slopes, 1, 2) @ square[:, None] @ slopes + np.eye(len(width))
    log_det = np.linalg.slogdet(inner)[1] + errors.log_norm[:, None]
    rows = 0.5 * (change - product[:, :1, 0] - log_det) - levels.half_det[:, None] + errors.log_weights[:, None]
    totals = np.logaddexp.reduce(rows, axis=0)
    best = int(np.argmax(totals))
    leading = int(np.argmax(rows[:, best]))
    p = strain.p(levels.mean(leading, at, weights[best]))
    return Score(path, float(totals[best]), tried[best], float(errors.scales[leading]), p)
