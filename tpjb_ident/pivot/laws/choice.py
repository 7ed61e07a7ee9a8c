"""Which law: evidence per pad, with the pads of one bearing learning from each other.

The pads of a bearing are of one make, so a law that four pads favour is likely on the fifth. The prior share of
each law on a pad is therefore the mean of the other pads' posterior shares (an empirical-Bayes mixture, iterated),
with half a pseudo-pad spread over the laws, so that a pad of its own kind keeps its own law. Contact loss is each
pad's own affair.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.pivot.laws.law_fit import LawFit

PSEUDO_PADS = 0.5
CONTACT_VOTE = 0.3  # what a pad with incomplete contact says of the law counts: it saw the upper loads only
CONTACT_LOSS_PRIOR = 0.3  # share of pads with incomplete contact at low load: two of five in the paper
SPLINE_PRIOR = 0.02  # of a physical law's prior: a spline takes contact loss for a soft pivot, so physics goes first
SMALLEST_WEIGHT = 1e-3  # laws below it are dropped


def posterior_weights(fits: Sequence[Sequence[LawFit]]) -> tuple[FloatArray, ...]:
    """Posterior shares of all fits of every pad.

    Parameters
    ----------
    fits : sequence (pads) of sequence (n fits of that pad) of LawFit
        All candidates; a law may stand with and without contact loss.

    Returns
    -------
    tuple (pads) of (n,) ndarray
        Shares that sum to one.
    """
    names = sorted({fit.name for pad in fits for fit in pad})
    prior = {name: SPLINE_PRIOR if name == "spline" else 1.0 for name in names}
    prior = {name: PSEUDO_PADS * value / sum(prior.values()) for name, value in prior.items()}
    weights = [_pad_weights(pad, prior) for pad in fits]
    for _ in range(30):
        held = [
            {name: float(sum(x * _vote(f) for f, x in zip(pad, w, strict=True) if f.name == name)) for name in names}
            for pad, w in zip(fits, weights, strict=True)
        ]
        new = []
        for own, pad in zip(held, fits, strict=True):
            # the other pads only: a pad's own evidence must not count twice
            share = {name: prior[name] + sum(other[name] for other in held) - own[name] for name in names}
            new.append(_pad_weights(pad, share))
        moved = max(float(np.max(np.abs(a - b))) for a, b in zip(new, weights, strict=True))
        weights = new
        if moved < 1e-4:
            break
    return tuple(weights)


def _vote(fit: LawFit) -> float:
    return CONTACT_VOTE if fit.contact else 1.0


def _pad_weights(pad: Sequence[LawFit], share: dict[str, float]) -> FloatArray:
    prior = np.array([share[fit.name] * (CONTACT_LOSS_PRIOR if fit.contact else 1 - CONTACT_LOSS_PRIOR) for fit in pad])
    logs = np.log(prior) + np.array([fit.log_evidence for fit in pad])
    weights = np.exp(logs - np.max(logs))
    return np.asarray(weights / weights.sum())


def keep_likely(fits: Sequence[LawFit], weights: FloatArray) -> tuple[tuple[LawFit, ...], FloatArray]:
    """The fits worth keeping, most likely first, with shares that sum to one.

    Parameters
    ----------
    fits : sequence of LawFit
    weights : (n,) ndarray
        Shares of the fits.
    """
    order = [k for k in np.argsort(-weights, kind="stable") if weights[k] >= SMALLEST_WEIGHT]
    kept = weights[order]
    return tuple(fits[k] for k in order), np.asarray(kept / kept.sum())
