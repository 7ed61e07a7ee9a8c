"""Which law: evidence per pad, with the pads of one bearing learning from each other, also the shape of a law.

The pads of a bearing are of one make, so a law that four pads favour is likely on the fifth. The prior share of
each law on a pad is therefore the mean of the other pads' posterior shares (an empirical-Bayes mixture, iterated),
with half a pseudo-pad spread over the laws, so that a pad of its own kind keeps its own law. Contact loss is each
pad's own affair.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.pivot.laws.law_fit import SCALE, LawFit, ShapePrior

PSEUDO_PADS = 0.5
CONTACT_VOTE = 0.3  # what a pad with incomplete contact says of the law counts: it saw the upper loads only
CONTACT_LOSS_PRIOR = 0.3  # share of pads with incomplete contact at low load: two of five in the paper
SPLINE_PRIOR = 0.02  # of a physical law's prior: a spline takes contact loss for a soft pivot, so physics goes first
SMALLEST_WEIGHT = 1e-3  # laws below it are dropped
Refit = Callable[[LawFit, ShapePrior], LawFit]
ALIKE = 0.25  # spread of the shape among pads of one make, as a share of what is plausible for any pivot
SMALLEST_SHARE = 0.05  # that the other pads give a law, together, for its shape to be asked for
HOPELESS = 25.0  # below the pad's best log-evidence: no prior makes up for that


def posterior_weights(fits: Sequence[Sequence[LawFit]]) -> tuple[FloatArray, ...]:
    """Posterior shares of all fits of every pad."""
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
    """The fits worth keeping, most likely first, with shares that sum to one."""
    order = [k for k in np.argsort(-weights, kind="stable") if weights[k] >= SMALLEST_WEIGHT]
    kept = weights[order]
    return tuple(fits[k] for k in order), np.asarray(kept / kept.sum())


def shared_priors(fits: Sequence[Sequence[LawFit]], weights: Sequence[FloatArray], pad: int) -> dict[str, ShapePrior]:
    """Prior of each law's shape on one pad, from all other pads."""
    found = {}
    for law in {fit.name: fit.law for fit in fits[pad] if fit.law.parameters and fit.name != "spline"}.values():
        own = law.prior_precision
        spread = np.linalg.inv(own) * ALIKE**2
        stiff = np.linalg.inv(spread)
        precision, pull, liked = own.copy(), own @ law.prior_mean, 0.0
        for other, (candidates, shares) in enumerate(zip(fits, weights, strict=True)):
            if other == pad:
                continue
            for fit, share in zip(candidates, shares, strict=True):
                if fit.name != law.name or share < 1e-6:
                    continue
                shape = slice(SCALE + 1, SCALE + 1 + len(law.parameters))
                posterior = np.linalg.inv(fit.covariance[shape, shape])
                data = posterior - own
                # a pad's own shape is known with `data`; it differs from the common one by `spread`
                gain = stiff @ np.linalg.inv(data + stiff)
                precision += share * (gain @ data)
                pull += share * (gain @ (posterior @ fit.shape - own @ law.prior_mean))
                liked += float(share)
        if liked > SMALLEST_SHARE:
            common = np.linalg.inv(precision)
            found[law.name] = ShapePrior(common @ pull, np.linalg.inv(common + spread))
    return found


def with_shared_shape(
    fits: Sequence[Sequence[LawFit]], weights: Sequence[FloatArray], refit: Sequence[Refit]
) -> list[list[LawFit]]:
    """All fits, each with the better of two priors of its shape: the law's own, and what the other pads say.

    The pads are of one make: what makes one pivot's law bend (its contact, the housing behind it) makes the others'
    bend alike, though each has its own stiffness. On the upper pads the lowest loads go to the way into contact, and
    the shape is read from the upper half of the loads alone: there a sphere on a housing that gives looks like a plain
    sphere, which is simpler, and the curve comes out 3 % wrong at its lower end. So every law is fitted a second time
    with the shape that the other pads show, give or take what pads of one make may differ by, and both fits count
    alike: a pad of its own kind loses nothing but a factor of two in evidence.
    """
    out = []
    for pad, candidates in enumerate(fits):
        priors = shared_priors(fits, weights, pad)
        best = max(fit.log_evidence for fit in candidates)
        out.append([
            _better(fit, refit[pad](fit, priors[fit.name]))
            if fit.name in priors and fit.log_evidence > best - HOPELESS else fit
            for fit in candidates
        ])  # fmt: skip
    return out


def _better(own: LawFit, shared: LawFit) -> LawFit:
    mean = float(np.logaddexp(own.log_evidence, shared.log_evidence) - np.log(2.0))
    return replace(shared if shared.log_evidence > own.log_evidence else own, log_evidence=mean)
