"""Laws fitted to the blocks of each pad, and which law it is, the pads of one bearing learning from each other.

What is measured is x = x0 + delta(W) - a exp(-F / F0): the reading at zero load x0 is unknown (the probes' gap
voltage), W = F (1 -+ mu) is the load that reaches the pivot when friction holds back the share mu (minus
loading, plus unloading), and the last term is the way that the shaft has still to go until it is fully in
contact. Damped Gauss-Newton in whitened residuals finds the posterior mode, Laplace's method the evidence.

The pads of a bearing are of one make, so a law that four pads favour is likely on the fifth. The prior share of
each law on a pad is therefore the mean of the other pads' posterior shares (an empirical-Bayes mixture, iterated),
with half a pseudo-pad spread over the laws, so that a pad of its own kind keeps its own law. Contact loss is each
pad's own affair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.pivot.laws import Law

OFFSET, FRICTION, SCALE = 0, 1, 2  # places of the parameters that every law has; the shape follows
CONTACT_GAP = 3.0e-6  # [m], plausible size of the missing contact (prior standard deviation)
CONTACT_LOAD_SPREAD = 0.6  # of ln F0 about a tenth of the largest load
_ITERATIONS = 60  # a law far from its prior, such as an exponent of 0.4, takes 40
_LONGEST_STEP = 1.0  # in any shape parameter or logarithm
_CONVERGED = 3e-3  # change of the misfit (chi-square) that no longer matters
_PSEUDO_PADS = 0.5
_CONTACT_VOTE = 0.3  # what a pad with incomplete contact says of the law counts: it saw the upper loads only
_CONTACT_LOSS_PRIOR = 0.3  # share of pads with incomplete contact at low load: two of five in the paper
_SPLINE_PRIOR = 0.02  # of a physical law's prior: a spline takes contact loss for a soft pivot, so physics goes first
_SMALLEST_WEIGHT = 1e-3  # laws below it are dropped
ALIKE = 0.25  # spread of the shape among pads of one make, as a share of what is plausible for any pivot
SMALLEST_SHARE = 0.05  # that the other pads give a law, together, for its shape to be asked for
HOPELESS = 25.0  # below the pad's best log-evidence: no prior makes up for that


@dataclass(frozen=True)
class FitData:
    """What a law is fitted to: m blocks of one pad."""

    load: FloatArray  #: (m,) as applied [N]
    deflection: FloatArray  #: (m,) reading from that at the lowest load [m]
    branch: FloatArray  #: (m,) +1 loading, -1 unloading
    whitener: FloatArray  #: (m, m) inverse Cholesky factor of the deflections' covariance [1/m]
    reference_load: float  #: [N]
    friction: tuple[float, float]  #: share that friction holds back, standard deviation: prior


@dataclass(frozen=True)
class LawFit:
    """A law with its parameters and their covariance."""

    law: Law
    reference_load: float  #: [N]
    contact: bool
    theta: FloatArray  #: (p,) offset [m], friction share, ln scale [m/N], shape, and with contact a [m], ln F0 [N]
    covariance: FloatArray  #: (p, p)
    log_evidence: float
    chi_square: float
    freedom: int

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.law.name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of `theta`."""
        contact = ("contact gap [m]", "ln contact load") if self.contact else ()
        return ("zero reading [m]", "friction share", "ln scale", *self.law.parameters, *contact)

    @property
    def shape(self) -> FloatArray:
        """Shape parameters q (k,)."""
        return self.theta[_shape(self.law)]

    def deflection(self, load: FloatArray) -> FloatArray:
        """Deflection (n,) [m] of the pivot alone at pad loads (n,) [N]."""
        u = np.maximum(load, 0.0) / self.reference_load
        return np.asarray(np.exp(self.theta[SCALE]) * self.reference_load * self.law.phi(u, self.shape)[0])

    def compliance(self, load: FloatArray) -> FloatArray:
        """Tangent compliance d delta / dW (n,) [m/N] at pad loads (n,) [N]."""
        u = np.maximum(load, 0.0) / self.reference_load
        return np.asarray(np.exp(self.theta[SCALE]) * self.law.psi(u, self.shape)[0])

    def log_softness(self, load: FloatArray, secant: bool) -> tuple[FloatArray, FloatArray]:
        """Logarithm (n,) of deflection (`secant`) or compliance at loads (n,) [N], its derivative (n, p) by `theta`."""
        shape = self.law.phi if secant else self.law.psi
        value, derivative = shape(np.maximum(load, 0.0) / self.reference_load, self.shape)
        gradient = np.zeros((len(load), len(self.theta)))
        gradient[:, SCALE] = 1.0
        gradient[:, _shape(self.law)] = derivative / np.maximum(value, 1e-300)[:, None]
        return np.log(self.deflection(load) if secant else self.compliance(load)), gradient

    def reading(self, load: FloatArray, branch: FloatArray) -> FloatArray:
        """Expected displacement reading (n,) [m] at applied loads (n,) [N], contact loss included."""
        return self.reading_gradient(load, branch)[0]

    def reading_gradient(self, load: FloatArray, branch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expected reading (n,) [m] at applied loads (n,) [N] and its derivative (n, p) with respect to `theta`."""
        theta, law = self.theta, self.law
        scale = np.exp(theta[SCALE])
        u = np.maximum(load * (1.0 - theta[FRICTION] * branch), 0.0) / self.reference_load
        phi, phi_q = law.phi(u, self.shape)
        psi, _ = law.psi(u, self.shape)
        jacobian = np.zeros((len(load), len(theta)))
        jacobian[:, OFFSET] = 1.0
        jacobian[:, FRICTION] = -scale * psi * load * branch
        jacobian[:, SCALE] = scale * self.reference_load * phi
        jacobian[:, _shape(law)] = scale * self.reference_load * phi_q
        value = theta[OFFSET] + scale * self.reference_load * phi
        if self.contact:
            load_0 = np.exp(theta[-1])
            decay = np.exp(-load / load_0)
            value = value - theta[-2] * decay
            jacobian[:, -2] = -decay
            jacobian[:, -1] = -theta[-2] * decay * load / load_0
        return np.asarray(value), jacobian


def _shape(law: Law) -> slice:
    """Places of the law's shape in `theta`."""
    return slice(SCALE + 1, SCALE + 1 + len(law.parameters))


@dataclass(frozen=True)
class ShapePrior:
    """Gaussian prior of a law's shape parameters: mean (k,) and precision (k, k)."""

    mean: FloatArray
    precision: FloatArray


@dataclass(frozen=True)
class _Prior:
    """Gaussian prior and bounds of all p parameters; flat ones have zero precision."""

    mean: FloatArray  #: (p,)
    precision: FloatArray  #: (p, p)
    low: FloatArray  #: (p,)
    high: FloatArray  #: (p,)


def _prior(law: Law, contact: bool, data: FitData, shape_prior: ShapePrior | None) -> _Prior:
    p = SCALE + 1 + len(law.parameters) + (2 if contact else 0)
    mean, precision = np.zeros(p), np.zeros((p, p))
    low, high = np.full(p, -np.inf), np.full(p, np.inf)
    mean[FRICTION], precision[FRICTION, FRICTION] = data.friction[0], data.friction[1] ** -2
    low[FRICTION], high[FRICTION] = -0.2, 0.2
    shape = _shape(law)
    mean[shape] = law.prior_mean if shape_prior is None else shape_prior.mean
    precision[shape, shape] = law.prior_precision if shape_prior is None else shape_prior.precision
    low[shape], high[shape] = law.bounds
    if contact:
        largest = float(np.max(data.load))
        precision[-2, -2] = CONTACT_GAP**-2
        low[-2] = 0.0
        mean[-1], precision[-1, -1] = np.log(0.1 * largest), CONTACT_LOAD_SPREAD**-2
        low[-1], high[-1] = np.log(0.01 * largest), np.log(largest)
    return _Prior(mean, precision, low, high)


def fit_law(
    law: Law, contact: bool, data: FitData, shape_prior: ShapePrior | None = None, start: FloatArray | None = None
) -> LawFit:
    """Fit one law by its posterior mode; `start` (p,) as `LawFit.theta`."""
    prior = _prior(law, contact, data, shape_prior)
    theta = _start(prior, contact, data) if start is None else np.clip(start, prior.low, prior.high)
    unit = np.ones(len(theta))
    unit[OFFSET] = np.ptp(data.deflection)  # metres and pure numbers in one matrix: scale the metres
    if contact:
        unit[-2] = CONTACT_GAP
    freedom = len(data.load) - len(theta)
    initial = LawFit(law, data.reference_load, contact, theta, np.zeros_like(prior.precision), 0.0, 0.0, freedom)
    theta, hessian, chi_square = _minimise(initial, data, prior, unit)
    difference = theta - prior.mean
    quadratic = float(difference @ prior.precision @ difference)
    proper = np.diag(prior.precision) > 0.0  # the part of the prior that is not flat
    log_prior = float(np.linalg.slogdet(prior.precision[np.ix_(proper, proper)])[1])
    # the offset's unit enters every law alike; the others' units cancel against the prior's determinant
    log_hessian = float(np.linalg.slogdet(hessian)[1]) - 2.0 * float(np.sum(np.log(unit[1:])))
    evidence = 0.5 * (log_prior - log_hessian - chi_square - quadratic)
    covariance = np.linalg.inv(hessian) * np.outer(unit, unit)
    return replace(initial, theta=theta, covariance=covariance, log_evidence=evidence, chi_square=chi_square)


def _start(prior: _Prior, contact: bool, data: FitData) -> FloatArray:
    """Prior shape; a straight line through the upper loads, where contact is complete, for scale and zero."""
    theta = prior.mean.copy()
    upper = data.load >= 0.3 * np.max(data.load)
    slope, zero = np.polyfit(data.load[upper], data.deflection[upper], 1)
    theta[SCALE] = np.log(max(slope, 1e-3 * np.ptp(data.deflection) / np.ptp(data.load)))
    theta[OFFSET] = zero
    if contact:
        theta[-2] = 0.3 * CONTACT_GAP
    return theta


def _minimise(initial: LawFit, data: FitData, prior: _Prior, unit: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Levenberg-Marquardt to the posterior mode: theta (p,), Hessian (p, p) in units of `unit` (p,), chi-square."""
    precision = prior.precision * np.outer(unit, unit)
    whitened = data.whitener @ data.deflection

    def evaluate(theta: FloatArray) -> tuple[float, float, FloatArray, FloatArray]:
        value, jacobian = replace(initial, theta=theta).reading_gradient(data.load, data.branch)
        residual = whitened - data.whitener @ value
        difference = (theta - prior.mean) / unit
        chi_square = float(residual @ residual)
        cost = chi_square + float(difference @ precision @ difference)
        return cost, chi_square, residual, data.whitener @ (jacobian * unit)

    damping = 1e-3
    theta = initial.theta
    cost, chi_square, residual, jacobian = evaluate(theta)
    for _ in range(_ITERATIONS):
        hessian = jacobian.T @ jacobian + precision
        gradient = jacobian.T @ residual - precision @ ((theta - prior.mean) / unit)
        # a parameter that stands at its bound and wants to go on takes no part in the step
        at_bound = ((theta <= prior.low) & (gradient < 0.0)) | ((theta >= prior.high) & (gradient > 0.0))
        damped = hessian + damping * np.diag(np.diag(hessian))
        damped[at_bound] = damped[:, at_bound] = 0.0
        damped[at_bound, at_bound] = 1.0
        step = np.linalg.solve(damped, np.where(at_bound, 0.0, gradient)) * unit
        # shapes and logarithms: a contact gap near zero leaves its decay load free to run away
        step *= min(1.0, _LONGEST_STEP / max(float(np.max(np.abs(step[SCALE:] / unit[SCALE:]))), 1e-300))
        trial = np.clip(theta + step, prior.low, prior.high)
        trial_state = evaluate(trial)
        if trial_state[0] <= cost:
            gain = cost - trial_state[0]
            theta, (cost, chi_square, residual, jacobian) = trial, trial_state
            damping = max(damping * 0.2, 1e-9)
            if gain < _CONVERGED:
                break
        else:
            damping *= 8.0
            if damping > 1e9:
                break
    return theta, jacobian.T @ jacobian + precision, chi_square


def posterior_weights(fits: Sequence[Sequence[LawFit]]) -> tuple[FloatArray, ...]:
    """Posterior shares (n,) of the n fits of every pad."""
    names = np.array(sorted({fit.name for candidates in fits for fit in candidates}))
    prior = np.where(names == "spline", _SPLINE_PRIOR, 1.0)
    prior *= _PSEUDO_PADS / prior.sum()
    # the fits of a pad by rows, the laws by columns
    of_law = [(np.array([[fit.name] for fit in candidates]) == names).astype(float) for candidates in fits]
    heard = [np.array([_CONTACT_VOTE if fit.contact else 1.0 for fit in candidates]) for candidates in fits]
    weights = [_pad_weights(*pad, prior) for pad in zip(fits, of_law, strict=True)]
    for _ in range(30):
        votes = np.array([(w * h) @ laws for w, h, laws in zip(weights, heard, of_law, strict=True)])
        # the other pads only: a pad's own evidence must not count twice
        law_priors = prior + votes.sum(axis=0) - votes
        updated = [_pad_weights(*pad) for pad in zip(fits, of_law, law_priors, strict=True)]
        change = max(float(np.max(np.abs(a - b))) for a, b in zip(updated, weights, strict=True))
        weights = updated
        if change < 1e-4:
            break
    return tuple(weights)


def _pad_weights(candidates: Sequence[LawFit], of_law: FloatArray, law_prior: FloatArray) -> FloatArray:
    contact_prior = [_CONTACT_LOSS_PRIOR if fit.contact else 1 - _CONTACT_LOSS_PRIOR for fit in candidates]
    logs = np.log(of_law @ law_prior * contact_prior) + [fit.log_evidence for fit in candidates]
    weights = np.exp(logs - np.max(logs))
    return np.asarray(weights / weights.sum())


def keep_likely(fits: Sequence[LawFit], weights: FloatArray) -> tuple[tuple[LawFit, ...], FloatArray]:
    """The fits that count, most likely first, with shares (n,) that sum to one."""
    order = [k for k in np.argsort(-weights, kind="stable") if weights[k] >= _SMALLEST_WEIGHT]
    shares = weights[order]
    return tuple(fits[k] for k in order), np.asarray(shares / shares.sum())


def shared_priors(fits: Sequence[Sequence[LawFit]], weights: Sequence[FloatArray], pad: int) -> dict[str, ShapePrior]:
    """Prior of each law's shape on one pad, from all other pads.

    Laws without a shape, and laws that no other pad likes, are not in it.
    """
    priors = {}
    others = [k for k in range(len(fits)) if k != pad]
    for law in {fit.name: fit.law for fit in fits[pad] if fit.law.parameters and fit.name != "spline"}.values():
        law_precision = law.prior_precision
        spread = np.linalg.inv(law_precision) * ALIKE**2
        spread_precision = np.linalg.inv(spread)
        precision, pull, support = law_precision.copy(), law_precision @ law.prior_mean, 0.0
        for k in others:
            for fit, share in zip(fits[k], weights[k], strict=True):
                if fit.name != law.name or share < 1e-6:
                    continue
                posterior = np.linalg.inv(fit.covariance[_shape(law), _shape(law)])
                information = posterior - law_precision
                # the data know a pad's own shape with `information`; it differs from the common one by `spread`
                gain = spread_precision @ np.linalg.inv(information + spread_precision)
                precision += share * (gain @ information)
                pull += share * (gain @ (posterior @ fit.shape - law_precision @ law.prior_mean))
                support += float(share)
        if support > SMALLEST_SHARE:
            common = np.linalg.inv(precision)
            priors[law.name] = ShapePrior(common @ pull, np.linalg.inv(common + spread))
    return priors


def with_shared_shape(
    fits: Sequence[Sequence[LawFit]], weights: Sequence[FloatArray], data: Sequence[FitData]
) -> list[list[LawFit]]:
    """All fits, each with the better of two priors of its shape: the law's own, and what the other pads say.

    The pads are of one make: what makes one pivot's law bend (its contact, the housing behind it) makes the others'
    bend alike, though each has its own stiffness. On the upper pads the lowest loads go to the way into contact, and
    the shape is read from the upper half of the loads alone: there a sphere on a compliant housing looks like a plain
    sphere, which is simpler, and the curve comes out 3 % wrong at its lower end. So every law is fitted a second time
    with the shape that the other pads show, give or take what pads of one make may differ by, and both fits count
    alike: a pad of its own kind loses nothing but a factor of two in evidence.
    """
    shared = []
    for pad, candidates in enumerate(fits):
        priors = shared_priors(fits, weights, pad)
        best = max(fit.log_evidence for fit in candidates)
        improved = []
        for fit in candidates:
            if fit.name in priors and fit.log_evidence > best - HOPELESS:
                again = fit_law(fit.law, fit.contact, data[pad], priors[fit.name], start=fit.theta)
                mean = float(np.logaddexp(fit.log_evidence, again.log_evidence) - np.log(2.0))
                fit = replace(again if again.log_evidence > fit.log_evidence else fit, log_evidence=mean)
            improved.append(fit)
        shared.append(improved)
    return shared
