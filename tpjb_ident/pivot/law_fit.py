"""One law fitted to one pad's blocks: damped Gauss-Newton in whitened residuals, with the Laplace evidence.

What is measured is x = x0 + delta(W) - a exp(-F / F0): the reading at zero load x0 is unknown (the probes' gap
voltage), W = F (1 -+ mu) is the load that reaches the pivot when friction holds back the share mu (minus
loading, plus unloading), and the last term is the way that the shaft has still to go until it is fully in
contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.pivot.laws import Law

OFFSET, FRICTION, SCALE = 0, 1, 2  # places of the parameters that every law has; the shape follows
CONTACT_GAP = 3.0e-6  # [m], plausible size of the missing contact (prior standard deviation)
CONTACT_LOAD_SPREAD = 0.6  # of ln F0 about a tenth of the largest load
ITERATIONS = 60  # a law far from its prior, such as an exponent of 0.4, takes 40
LONGEST_STEP = 1.0  # in any shape parameter or logarithm
CONVERGED = 3e-3  # change of the misfit (chi-square) that no longer matters


@dataclass(frozen=True)
class FitData:
    """What a law is fitted to."""

    load: FloatArray
    deflection: FloatArray
    branch: FloatArray
    whitener: FloatArray
    reference_load: float
    friction: tuple[float, float]


@dataclass(frozen=True)
class LawFit:
    """A law with its parameters and their covariance."""

    law: Law
    reference_load: float
    contact: bool
    theta: FloatArray
    covariance: FloatArray
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
        return self.theta[SCALE + 1 : SCALE + 1 + len(self.law.parameters)]

    def deflection(self, load: FloatArray) -> FloatArray:
        """Deflection (n,) [m] of the pivot alone at pad loads (n,) [N]."""
        u = np.maximum(load, 0.0) / self.reference_load
        return np.asarray(np.exp(self.theta[SCALE]) * self.reference_load * self.law.phi(u, self.shape)[0])

    def compliance(self, load: FloatArray) -> FloatArray:
        """Tangent compliance d delta / dW (n,) [m/N]."""
        u = np.maximum(load, 0.0) / self.reference_load
        return np.asarray(np.exp(self.theta[SCALE]) * self.law.psi(u, self.shape)[0])

    def log_compliance_gradient(self, load: FloatArray) -> FloatArray:
        """Derivative (n, p) of ln(compliance) with respect to `theta`."""
        value, shape = self.law.psi(np.maximum(load, 0.0) / self.reference_load, self.shape)
        return self._gradient(value, shape)

    def log_deflection_gradient(self, load: FloatArray) -> FloatArray:
        """Derivative (n, p) of ln(deflection) with respect to `theta`."""
        value, shape = self.law.phi(np.maximum(load, 0.0) / self.reference_load, self.shape)
        return self._gradient(value, shape)

    def _gradient(self, value: FloatArray, shape: FloatArray) -> FloatArray:
        gradient = np.zeros((len(value), len(self.theta)))
        gradient[:, SCALE] = 1.0
        gradient[:, SCALE + 1 : SCALE + 1 + shape.shape[1]] = shape / np.maximum(value, 1e-300)[:, None]
        return gradient

    def missing_compliance(self, load: FloatArray) -> FloatArray:
        """What incomplete contact adds to the measured compliance (n,) [m/N]."""
        if not self.contact:
            return np.zeros_like(load)
        gap, load_0 = self.theta[-2], np.exp(self.theta[-1])
        return np.asarray(gap / load_0 * np.exp(-load / load_0))

    def reading(self, load: FloatArray, branch: FloatArray) -> FloatArray:
        """Expected displacement reading (n,) [m] at applied loads (n,) [N], contact loss included."""
        return self.reading_gradient(load, branch)[0]

    def reading_gradient(self, load: FloatArray, branch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expected reading (n,) [m] and its derivative (n, p) with respect to `theta`."""
        return _predict(self.law, self.theta, self.contact, load, branch, self.reference_load)


def _predict(
    law: Law, theta: FloatArray, contact: bool, load: FloatArray, branch: FloatArray, reference: float
) -> tuple[FloatArray, FloatArray]:
    """Reading (m,) and its Jacobian (m, p)."""
    k = len(law.parameters)
    q = theta[SCALE + 1 : SCALE + 1 + k]
    scale = np.exp(theta[SCALE])
    u = np.maximum(load * (1.0 - theta[FRICTION] * branch), 0.0) / reference
    phi, phi_q = law.phi(u, q)
    psi, _ = law.psi(u, q)
    jacobian = np.zeros((len(load), len(theta)))
    jacobian[:, OFFSET] = 1.0
    jacobian[:, FRICTION] = -scale * psi * load * branch
    jacobian[:, SCALE] = scale * reference * phi
    jacobian[:, SCALE + 1 : SCALE + 1 + k] = scale * reference * phi_q
    value = theta[OFFSET] + scale * reference * phi
    if contact:
        load_0 = np.exp(theta[-1])
        decay = np.exp(-load / load_0)
        value = value - theta[-2] * decay
        jacobian[:, -2] = -decay
        jacobian[:, -1] = -theta[-2] * decay * load / load_0
    return np.asarray(value), jacobian


@dataclass(frozen=True)
class _Prior:
    """Gaussian prior and bounds of all parameters; flat ones have zero precision."""

    mean: FloatArray
    precision: FloatArray
    low: FloatArray
    high: FloatArray

    def log_determinant(self) -> float:
        """Of the part that is not flat."""
        proper = np.diag(self.precision) > 0.0
        return float(np.linalg.slogdet(self.precision[np.ix_(proper, proper)])[1])


@dataclass(frozen=True)
class ShapePrior:
    """Gaussian prior of a law's shape parameters: mean (k,) and precision (k, k)."""

    mean: FloatArray
    precision: FloatArray


def _prior(law: Law, contact: bool, data: FitData, known: ShapePrior | None) -> _Prior:
    k = len(law.parameters)
    p = SCALE + 1 + k + (2 if contact else 0)
    mean, precision = np.zeros(p), np.zeros((p, p))
    low, high = np.full(p, -np.inf), np.full(p, np.inf)
    mean[FRICTION], precision[FRICTION, FRICTION] = data.friction[0], data.friction[1] ** -2
    low[FRICTION], high[FRICTION] = -0.2, 0.2
    shape = slice(SCALE + 1, SCALE + 1 + k)
    mean[shape] = law.prior_mean if known is None else known.mean
    precision[shape, shape] = law.prior_precision if known is None else known.precision
    low[shape], high[shape] = law.bounds
    if contact:
        largest = float(np.max(data.load))
        precision[-2, -2] = CONTACT_GAP**-2
        low[-2] = 0.0
        mean[-1], precision[-1, -1] = np.log(0.1 * largest), CONTACT_LOAD_SPREAD**-2
        low[-1], high[-1] = np.log(0.01 * largest), np.log(largest)
    return _Prior(mean, precision, low, high)


def fit_law(
    law: Law, contact: bool, data: FitData, known: ShapePrior | None = None, start: FloatArray | None = None
) -> LawFit:
    """Fit one law by its posterior mode."""
    prior = _prior(law, contact, data, known)
    theta = _start(prior, contact, data) if start is None else np.clip(start, prior.low, prior.high)
    unit = np.ones(len(theta))
    unit[OFFSET] = np.ptp(data.deflection)  # metres and pure numbers in one matrix: scale the metres
    if contact:
        unit[-2] = CONTACT_GAP
    theta, hessian, chi_square = _descend(law, contact, data, prior, theta, unit)
    gap = theta - prior.mean
    quadratic = float(gap @ prior.precision @ gap)
    # the offset's unit enters every law alike; the others' units cancel against the prior's determinant
    log_hessian = float(np.linalg.slogdet(hessian)[1]) - 2.0 * float(np.sum(np.log(unit[1:])))
    evidence = 0.5 * (prior.log_determinant() - log_hessian - chi_square - quadratic)
    covariance = np.linalg.inv(hessian) * np.outer(unit, unit)
    return LawFit(
        law, data.reference_load, contact, theta, covariance, evidence, chi_square, len(data.load) - len(theta)
    )


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


def _descend(
    law: Law, contact: bool, data: FitData, prior: _Prior, theta: FloatArray, unit: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Levenberg-Marquardt to the posterior mode: theta, Hessian in units of `unit`, chi-square."""
    precision = prior.precision * np.outer(unit, unit)
    whitened = data.whitener @ data.deflection

    def state(at: FloatArray) -> tuple[float, float, FloatArray, FloatArray]:
        value, jacobian = _predict(law, at, contact, data.load, data.branch, data.reference_load)
        residual = whitened - data.whitener @ value
        gap = (at - prior.mean) / unit
        chi_square = float(residual @ residual)
        return chi_square + float(gap @ precision @ gap), chi_square, residual, data.whitener @ (jacobian * unit)

    damping = 1e-3
    cost, chi_square, residual, jacobian = state(theta)
    for _ in range(ITERATIONS):
        hessian = jacobian.T @ jacobian + precision
        gradient = jacobian.T @ residual - precision @ ((theta - prior.mean) / unit)
        # a parameter that stands at its bound and wants to go on takes no part in the step
        held = ((theta <= prior.low) & (gradient < 0.0)) | ((theta >= prior.high) & (gradient > 0.0))
        damped = hessian + damping * np.diag(np.diag(hessian))
        damped[held] = damped[:, held] = 0.0
        damped[held, held] = 1.0
        step = np.linalg.solve(damped, np.where(held, 0.0, gradient)) * unit
        # shapes and logarithms: a contact gap near zero leaves its decay load free to run away
        step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step[SCALE:] / unit[SCALE:]))), 1e-300))
        trial = np.clip(theta + step, prior.low, prior.high)
        trial_state = state(trial)
        if trial_state[0] <= cost:
            gain = cost - trial_state[0]
            theta, (cost, chi_square, residual, jacobian) = trial, trial_state
            damping = max(damping * 0.2, 1e-9)
            if gain < CONVERGED:
                break
        else:
            damping *= 8.0
            if damping > 1e9:
                break
    return theta, jacobian.T @ jacobian + precision, chi_square


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
