"""Which law, from which load on, and what pads tell each other: held against sums that can be done by hand."""

import math

import numpy as np
import pytest

from tpjb_ident.pivot import law_fit
from tpjb_ident.pivot.fit import CONTACT_TOLERANCE, contact_onset
from tpjb_ident.pivot.law_fit import (
    ALIKE,
    HOPELESS,
    SMALLEST_SHARE,
    FitData,
    LawFit,
    informed_law,
    keep_likely,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import LAWS

REFERENCE = 2000.0


def fitted(name, evidence=0.0, contact=False, shape=(), gap=0.0, decay=500.0, scale=4e-9, covariance=None):
    """A fit with stated numbers."""
    theta = [0.0, 0.0, math.log(scale), *shape, *((gap, math.log(decay)) if contact else ())]
    spread = np.eye(len(theta)) if covariance is None else covariance
    return LawFit(LAWS[name], REFERENCE, contact, np.array(theta), spread, evidence, 0.0, 10)


TRIED = (("linear", False), ("linear", True), ("power", False), ("power", True), ("spline", False))
EVIDENCE = ((0.3, 0.9, 0.0, -9.0, 1.0), (0.5, 0.1, 1.2, 1.1, -9.0), (1.4, -9.0, 0.2, -9.0, 2.0))
PADS = [[(*variant, size) for variant, size in zip(TRIED, sizes)] for sizes in EVIDENCE]


def test_pads_of_one_bearing_vote_for_each_other():
    """The shares are the fixed point that is stated: half a pad spread over the laws, and the other pads' votes."""
    pads = [[fitted(n, e, c) for n, c, e in pad] for pad in PADS]
    weights = posterior_weights(pads)
    vote = {True: 0.3, False: 1.0}
    for own, pad in enumerate(PADS):
        share = {"linear": 0.5 / 2.02, "power": 0.5 / 2.02, "spline": 0.5 * 0.02 / 2.02}
        for other, candidates in enumerate(PADS):
            if other != own:
                for (name, contact, _), weight in zip(candidates, weights[other]):
                    share[name] += vote[contact] * weight
        by_hand = np.array([share[n] * (0.3 if c else 0.7) * math.exp(e) for n, c, e in pad])
        np.testing.assert_allclose(weights[own], by_hand / by_hand.sum(), atol=3e-4)
        assert weights[own].sum() == pytest.approx(1.0, abs=1e-14)
    alone = [posterior_weights([pad])[0] for pad in pads]
    assert weights[0][:2].sum() > 1.1 * alone[0][:2].sum()  # the other pads' word for a straight line is heard


def test_what_is_kept_is_sorted_and_sums_to_one():
    fits = [fitted(name) for name in ("linear", "power", "hertz-point", "spline")]
    kept, shares = keep_likely(fits, np.array([0.25, 0.0005, 0.7385, 0.011]))
    assert [fit.name for fit in kept] == ["hertz-point", "linear", "spline"]
    np.testing.assert_allclose(shares, np.array([0.7385, 0.25, 0.011]) / 0.9995)
    even, _ = keep_likely(fits[:2], np.array([0.5, 0.5]))
    assert [fit.name for fit in even] == ["linear", "power"]


def test_the_onset_of_a_straight_pivot_is_a_logarithm():
    """gap / F0 exp(-F / F0) = tolerance times the compliance, which is constant."""
    gap, decay, scale = 3e-6, 400.0, 4e-9
    covariance = np.diag([1e-14, 1e-6, 0.02, 1e-7, 0.05]) ** 2
    covariance[3, 4] = covariance[4, 3] = -0.3e-7 * 0.05
    fit = fitted("linear", contact=True, gap=gap, decay=decay, scale=scale, covariance=covariance)
    onset = decay * math.log(gap / (decay * CONTACT_TOLERANCE * scale))
    slope = np.array([0.0, 0.0, -decay, decay / gap, onset - decay])
    load, error = contact_onset(fit)
    assert load == pytest.approx(onset, rel=1e-5)
    assert error == pytest.approx(math.sqrt(slope @ covariance @ slope), rel=0.01)


@pytest.mark.parametrize(("name", "shape"), [("power", (0.6,)), ("hertz-point", ()), ("hertz-line", (0.1,))])
def test_at_the_onset_the_missing_contact_adds_its_share(name, shape):
    fit = fitted(name, contact=True, shape=shape, gap=4e-6)
    at, decay = np.array([contact_onset(fit)[0]]), np.exp(fit.theta[-1])
    assert at[0] > 0.0
    missing = fit.theta[-2] / decay * np.exp(-at / decay)
    assert missing == pytest.approx(CONTACT_TOLERANCE * fit.compliance(at), rel=1e-4)


def test_contact_that_lacks_nothing_has_no_onset():
    assert contact_onset(fitted("linear")) == (0.0, 0.0)
    # the last gap is so small that even at no load it adds less than the share
    for gap in (0.0, -1e-6, 1e-9):
        assert contact_onset(fitted("linear", contact=True, gap=gap))[0] == 0.0


def with_information(information, own, shape, law="power", share_evidence=0.0):
    """Fit whose shape the data know with `information` beside the law's prior `own`."""
    k = len(shape)
    covariance = np.eye(3 + k)
    covariance[3:, 3:] = np.linalg.inv(information + own)
    return fitted(law, share_evidence, shape=tuple(shape), covariance=covariance)


@pytest.mark.parametrize("name", ["power", "bilinear"])
def test_a_shape_known_from_other_pads_is_a_mean_of_random_effects(name):
    """Each pad tells the common shape with its own variance and the spread among pads; the prior counts as one more."""
    law = LAWS[name]
    own, k = law.prior_precision, len(law.parameters)
    rng = np.random.default_rng(4)
    spread = ALIKE**2 * np.linalg.inv(own)
    estimates = law.prior_mean + 0.05 * rng.standard_normal((3, k))
    precision, pull = own.copy(), own @ law.prior_mean
    fits, shares = [], (np.array([0.9, 0.1]), np.array([0.4, 0.6]), np.array([1.0, 0.0]))
    for estimate, share in zip(estimates, shares):
        root = rng.standard_normal((k, k))
        information = 2000.0 * (root @ root.T + np.eye(k))
        mode = np.linalg.solve(information + own, information @ estimate + own @ law.prior_mean)
        fits += [(with_information(information, own, mode, name), share[0]), (fitted("linear"), share[1])]
        told = share[0] * np.linalg.inv(np.linalg.inv(information) + spread)
        precision, pull = precision + told, pull + told @ estimate
    told = informed_law(law, fits)
    np.testing.assert_allclose(told.prior_mean, np.linalg.solve(precision, pull), rtol=1e-9)
    np.testing.assert_allclose(told.prior_precision, np.linalg.inv(np.linalg.inv(precision) + spread), rtol=1e-9)


@pytest.mark.parametrize(("share", "asked"), [(0.9 * SMALLEST_SHARE, False), (1.1 * SMALLEST_SHARE, True)])
def test_a_law_that_no_other_pad_likes_has_no_shape_to_share(share, asked):
    law = LAWS["power"]
    fit = with_information(np.array([[900.0]]), law.prior_precision, [0.7])
    assert (informed_law(law, [(fit, share), (fitted("linear"), 1.0 - share)]) is not None) is asked


@pytest.mark.parametrize(
    ("told", "behind", "shape", "evidence"),
    [
        (2.0, 0.0, 0.66, math.log(0.5 * (1.0 + math.exp(2.0)))),  # both priors count alike, the better fit stays
        (-2.0, 0.0, 0.7, math.log(0.5 * (1.0 + math.exp(-2.0)))),
        (2.0, HOPELESS + 1.0, 0.7, -HOPELESS - 1.0),  # a hopeless law is not fitted again
    ],
)
def test_both_priors_count_alike_and_the_better_fit_stays(monkeypatch, told, behind, shape, evidence):
    own, many = LAWS["power"].prior_precision, np.array([[900.0]])
    first, other = (with_information(many, own, [0.7], share_evidence=size) for size in (-behind, 0.0))
    again = with_information(many, own, [0.66], share_evidence=told)
    monkeypatch.setattr(law_fit, "fit_law", lambda *_, **__: again)
    pads = [[first, fitted("linear")], [other, fitted("linear")]]
    shared = with_shared_shape(pads, np.array([[0.8, 0.2]] * 2), [None, None])
    assert (shared[0][0].shape[0], shared[0][0].log_evidence) == pytest.approx((shape, evidence))
    assert shared[0][1] is pads[0][1]


NAMES = ("hertz-point", "point-in-series", "power")


def blocks_of_a_sphere(lam, low=250.0, seed=0, noise=1.5e-8):
    """Blocks of a sphere on a housing with linear share `lam`, from `low` [N] up."""
    load = np.linspace(low, 5000.0, 120)
    deflection = 3e-9 * REFERENCE * LAWS["point-in-series"].phi(load / REFERENCE, np.array([lam]))[0]
    deflection = deflection + noise * np.random.default_rng(seed).standard_normal(120)
    return FitData(load, deflection - deflection[0], np.ones(120), np.eye(120) / noise, REFERENCE, (0.0, 1e-4))


def test_a_pad_that_shows_half_its_law_takes_the_shape_from_the_others():
    pads = [blocks_of_a_sphere(0.12, seed=k) for k in range(4)]
    pads.append(blocks_of_a_sphere(0.12, low=2600.0, seed=11, noise=4e-8))
    found = [[law_fit.fit_law(LAWS[name], False, one) for name in NAMES] for one in pads]
    weights = posterior_weights(found)
    shared = with_shared_shape(found, weights, pads)
    series = NAMES.index("point-in-series")
    assert abs(shared[4][series].shape[0] - 0.12) < abs(found[4][series].shape[0] - 0.12)
    assert posterior_weights(shared)[4][NAMES.index("hertz-point")] < weights[4][NAMES.index("hertz-point")]
