"""Which law: evidence per pad, with the pads of one bearing learning from each other.

The pads of a bearing are of one make, so a law that four pads favour is likely on the fifth. The prior
share of each law is therefore itself estimated, as the mean of the pads' posterior shares (expectation-
maximisation of a mixture), with one pseudo-pad spread evenly over the laws, so that a pad of its own kind
keeps its own law. Contact loss is each pad's own affair.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.pivot.law_fit import LawFit

FloatArray = NDArray[np.float64]

PSEUDO_PADS = 1.0
CONTACT_LOSS_PRIOR = 0.3  # share of pads with incomplete contact at low load: two of five in the paper
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
    share = {name: 1.0 / len(names) for name in names}
    weights: list[FloatArray] = []
    for _ in range(30):
        weights = [_pad_weights(pad, share) for pad in fits]
        counted = {
            name: PSEUDO_PADS / len(names)
            + sum(float(w[[fit.name == name for fit in pad]].sum()) for pad, w in zip(fits, weights, strict=True))
            for name in names
        }
        total = sum(counted.values())
        new = {name: value / total for name, value in counted.items()}
        if max(abs(new[name] - share[name]) for name in names) < 1e-4:
            break
        share = new
    return tuple(weights)


def _pad_weights(pad: Sequence[LawFit], share: dict[str, float]) -> FloatArray:
    prior = np.array([share[fit.name] * (CONTACT_LOSS_PRIOR if fit.contact else 1 - CONTACT_LOSS_PRIOR) for fit in pad])
    logs = np.log(prior) + np.array([fit.log_evidence for fit in pad])
    weights = np.exp(logs - np.max(logs))
    return np.asarray(weights / weights.sum())


def keep_likely(fits: Sequence[LawFit], weights: FloatArray) -> tuple[tuple[LawFit, ...], FloatArray]:
    """The fits worth keeping, most likely first, with shares that sum to one."""
    order = [k for k in np.argsort(-weights, kind="stable") if weights[k] >= SMALLEST_WEIGHT]
    kept = weights[order]
    return tuple(fits[k] for k in order), np.asarray(kept / kept.sum())
