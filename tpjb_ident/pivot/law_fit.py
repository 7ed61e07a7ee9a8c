"""Laws fitted to the blocks of each pad, and which law it is, the pads of one bearing learning from each other.

What is measured is x = x0 + delta(W) - a exp(-F / F0): the reading at zero load x0 is unknown (the probes' gap
voltage), W = F (1 -+ mu) is the load that reaches the pivot when friction holds back the share mu (minus
loading, plus unloading), and the last term is the way that the shaft has still to go until it is fully in
contact. Least squares of whitened residuals, the prior's among them, find the posterior mode, Laplace's method the
evidence.

The pads of a bearing are of one make, so a law that four pads favour is likely on the fifth. The prior share of
each law on a pad is therefore the mean of the other pads' posterior shares (an empirical-Bayes mixture, iterated),
with half a pseudo-pad spread over the laws, so that a pad of its own kind keeps its own law. Contact loss is each
pad's own affair.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize, special

from rigdata.arrays import FloatArray
from tpjb_ident.pivot.laws import Law, Shape

OFFSET, FRICTION, SCALE = 0, 1, 2  # places of the parameters that every law has; the shape follows
CONTACT_GAP = 3.0e-6  # [m], plausible size of the missing contact (prior standard deviation)
CONTACT_LOAD_SPREAD = 0.6  # of ln F0 about a tenth of the largest load
_ITERATIONS = 60  # a law far from its prior, such as an exponent of 0.4, takes 40
_CONVERGED = 1e-5  # relative change of the misfit (chi-square) that no longer matters
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
        """Deflection [m] of the pivot alone at pad loads [N], of any shape."""
        return self.reference_load * self._at(load, self.law.phi)

    def compliance(self, load: FloatArray) -> FloatArray:
        """Tangent compliance d delta / dW [m/N] at pad loads [N], of any shape."""
        return self._at(load, self.law.psi)

    def _at(self, load: FloatArray, shape: Shape) -> FloatArray:
        u = np.maximum(load, 0.0) / self.reference_load
        return np.asarray(np.exp(self.theta[SCALE]) * shape(np.ravel(u), self.shape)[0]).reshape(np.shape(u))

    def log_softness(self, load: FloatArray, secant: bool) -> tuple[FloatArray, FloatArray]:
        """Logarithm (n,) of deflection (`secant`) or compliance at loads (n,) [N], its derivative (n, p) by `theta`.

        But for a constant, which is that of the reference load.
        """
        shape = self.law.phi if secant else self.law.psi
        value, derivative = shape(np.maximum(load, 0.0) / self.reference_load, self.shape)
        gradient = np.zeros((len(load), len(self.theta)))
        gradient[:, SCALE] = 1.0
        gradient[:, _shape(self.law)] = derivative / np.maximum(value, 1e-300)[:, None]
        return self.theta[SCALE] + np.log(value), gradient

    def reading_gradient(self, load: FloatArray, branch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expected reading (n,) [m] at applied loads (n,) [N], contact loss included, its derivative (n, p)."""
        theta, law = self.theta, self.law
        scale = np.exp(theta[SCALE])
        u = np.maximum(load * (1.0 - theta[FRICTION] * branch), 0.0) / self.reference_load
        phi, phi_q = law.phi(u, self.shape)
        psi, _ = law.psi(u, self.shape)
        deflection = scale * self.reference_load * phi
        jacobian = np.zeros((len(load), len(theta)))
        jacobian[:, OFFSET] = 1.0
        jacobian[:, FRICTION] = -scale * psi * load * branch
        jacobian[:, SCALE] = deflection
        jacobian[:, _shape(law)] = scale * self.reference_load * phi_q
        value = theta[OFFSET] + deflection
        if self.contact:
            ratio = load / np.exp(theta[-1])
            decay = np.exp(-ratio)
            value = value - theta[-2] * decay
            jacobian[:, -2] = -decay
            jacobian[:, -1] = -theta[-2] * decay * ratio
        return value, jacobian


def _shape(law: Law) -> slice:
    """Places of the law's shape in `theta`."""
    return slice(SCALE + 1, SCALE + 1 + len(law.parameters))


def fit_law(law: Law, contact: bool, data: FitData, start: FloatArray | None = None) -> LawFit:
    """Fit one law by its posterior mode; `start` (p,) as `LawFit.theta`."""
    largest, flat = np.max(data.load), (0.0, np.inf, -np.inf, np.inf)
    # mean, standard deviation, lowest and highest of each parameter
    rows = [flat, (*data.friction, -0.2, 0.2), flat]
    rows += zip(law.prior_mean, np.ones(len(law.parameters)), *law.bounds, strict=True)
    if contact:
        ends = np.log(0.01 * largest), np.log(largest)
        rows += [(0.0, CONTACT_GAP, 0.0, np.inf), (np.log(0.1 * largest), CONTACT_LOAD_SPREAD, *ends)]
    mean, spread, low, high = np.array(rows).T
    root = np.diag(1.0 / spread)  # takes the prior to independent unit normals
    root[_shape(law), _shape(law)] = np.linalg.cholesky(law.prior_precision).T
    unit = np.ones(len(mean))
    unit[OFFSET] = np.ptp(data.deflection)  # metres and pure numbers in one matrix: scale the metres
    if contact:
        unit[-2] = CONTACT_GAP
    begin = np.clip(_start(mean, contact, data) if start is None else start, low, high)
    freedom = len(data.load) - len(mean)
    initial = LawFit(law, data.reference_load, contact, begin, np.zeros_like(root), 0.0, 0.0, freedom)

    def misfit(scaled: FloatArray) -> FloatArray:
        value, _ = replace(initial, theta=scaled * unit).reading_gradient(data.load, data.branch)
        return np.r_[data.whitener @ (value - data.deflection), root @ (scaled * unit - mean)]

    def slopes(scaled: FloatArray) -> FloatArray:
        _, gradient = replace(initial, theta=scaled * unit).reading_gradient(data.load, data.branch)
        return np.vstack([data.whitener @ gradient, root]) * unit

    best = optimize.least_squares(
        misfit, begin / unit, slopes, (low / unit, high / unit), "dogbox", _CONVERGED, max_nfev=_ITERATIONS
    )
    hessian = best.jac.T @ best.jac
    diagonal = np.diag(root)  # the part of the prior that is not flat
    log_prior = 2.0 * np.sum(np.log(diagonal[diagonal > 0.0]))
    # the offset's unit enters every law alike; the others' units cancel against the prior's determinant
    log_hessian = np.linalg.slogdet(hessian)[1] - 2.0 * np.sum(np.log(unit[1:]))
    return replace(
        initial,
        theta=best.x * unit,
        covariance=np.linalg.inv(hessian) * np.outer(unit, unit),
        log_evidence=0.5 * (log_prior - log_hessian) - best.cost,
        chi_square=np.sum(best.fun[: len(data.load)] ** 2),
    )


def _start(mean: FloatArray, contact: bool, data: FitData) -> FloatArray:
    """Prior shape; a straight line through the upper loads, where contact is complete, for scale and zero."""
    theta = mean.copy()
    upper = data.load >= 0.3 * np.max(data.load)
    slope, theta[OFFSET] = np.polyfit(data.load[upper], data.deflection[upper], 1)
    theta[SCALE] = np.log(max(slope, 1e-3 * np.ptp(data.deflection) / np.ptp(data.load)))
    if contact:
        theta[-2] = 0.3 * CONTACT_GAP
    return theta


def posterior_weights(fits: Sequence[Sequence[LawFit]]) -> FloatArray:
    """Posterior shares (pads, n) of the n fits of every pad, which are those of the same laws in the same order."""
    names, number = np.unique([fit.name for fit in fits[0]], return_inverse=True)
    contact = np.array([fit.contact for fit in fits[0]])
    evidence = []
    for candidates in fits:
        evidence.append([fit.log_evidence for fit in candidates])
    of_law = np.eye(len(names))[number]
    law_prior = np.where(names == "spline", _SPLINE_PRIOR, 1.0)
    law_prior *= _PSEUDO_PADS / law_prior.sum()
    contact_prior = np.where(contact, _CONTACT_LOSS_PRIOR, 1.0 - _CONTACT_LOSS_PRIOR)
    votes, weights = np.zeros((len(fits), len(names))), np.zeros_like(evidence)
    for _ in range(31):
        # the other pads only: a pad's own evidence must not count twice
        shares = law_prior + votes.sum(axis=0) - votes
        updated = special.softmax(np.log(shares @ of_law.T * contact_prior) + evidence, axis=1)
        change = np.max(np.abs(updated - weights))
        weights = updated
        if change < 1e-4:
            break
        votes = (weights * np.where(contact, _CONTACT_VOTE, 1.0)) @ of_law
    return weights


def keep_likely(fits: Sequence[LawFit], weights: FloatArray) -> tuple[tuple[LawFit, ...], FloatArray]:
    """The fits that count, most likely first, with shares (n,) that sum to one."""
    order = np.argsort(-weights, kind="stable")[: np.sum(weights >= _SMALLEST_WEIGHT)]
    return tuple(fits[k] for k in order), weights[order] / weights[order].sum()


def informed_law(law: Law, others: Sequence[tuple[LawFit, float]]) -> Law | None:
    """A law with the prior of its shape that the fits of other pads give, each with its share; None without support."""
    spread_precision = law.prior_precision / ALIKE**2
    precision, pull, support = law.prior_precision.copy(), law.prior_precision @ law.prior_mean, 0.0
    for fit, share in others:
        if fit.name == law.name and share >= 1e-6:
            posterior = np.linalg.inv(fit.covariance[_shape(law), _shape(law)])
            information = posterior - law.prior_precision
            # the data know a pad's own shape with `information`; it differs from the common one by that spread
            gain = share * spread_precision @ np.linalg.inv(information + spread_precision)
            precision += gain @ information
            pull += gain @ (posterior @ fit.shape - law.prior_precision @ law.prior_mean)
            support += share
    if support <= SMALLEST_SHARE:
        return None
    common = np.linalg.inv(precision)
    shared = np.linalg.inv(common + np.linalg.inv(spread_precision))
    return replace(law, prior_mean=common @ pull, prior_precision=shared)


def with_shared_shape(
    fits: Sequence[Sequence[LawFit]], weights: FloatArray, data: Sequence[FitData]
) -> list[list[LawFit]]:
    """All fits, each with the better of two priors of its shape: the law's own, and what the other pads say.

    The pads are of one make: what makes one pivot's law bend (its contact, the housing behind it) makes the others'
    bend alike, though each has its own stiffness. On the upper pads the lowest loads go to the way into contact, and
    the shape is read from the upper half of the loads alone: there a sphere on a compliant housing looks like a plain
    sphere, which is simpler, and the curve comes out 3 % wrong at its lower end. So every law is fitted a second time
    with the shape that the other pads show, give or take what pads of one make may differ by, and both fits count
    alike: a pad of its own kind loses nothing but a factor of two in evidence.
    """
    told = [list(zip(candidates, shares, strict=True)) for candidates, shares in zip(fits, weights, strict=True)]
    shared = []
    for pad, candidates in enumerate(fits):
        others = list(itertools.chain(*told[:pad], *told[pad + 1 :]))
        laws = {fit.name: fit.law for fit in candidates if fit.law.parameters and fit.name != "spline"}
        informed = {name: informed_law(law, others) for name, law in laws.items()}
        best = max(fit.log_evidence for fit in candidates)
        improved = []
        for fit in candidates:
            law = informed.get(fit.name)
            if law is not None and fit.log_evidence > best - HOPELESS:
                again = fit_law(law, fit.contact, data[pad], start=fit.theta)
                mean = np.logaddexp(fit.log_evidence, again.log_evidence) - np.log(2.0)
                fit = replace(again if again.log_evidence > fit.log_evidence else fit, log_evidence=mean)
            improved.append(fit)
        shared.append(improved)
    return shared
