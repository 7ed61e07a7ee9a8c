"""The arrow's normal equations against a dense least-squares solve with priors, and its budget against the sum."""

import numpy as np
import pytest

from tests.estimate.block_cases import Case, made, solved
from tpjb_ident.estimate.arrowhead import CONSIDERED, NUMBERS, Prior, Sums, step

POINTS, PARAMETERS, BLOCKS, ROWS = 3, 5, 12, 6


def problem(seed, weak=()):
    """Weighted rows of blocks, priors, and the parameters of which the rows tell next to nothing."""
    rng = np.random.default_rng(seed)
    point = np.repeat(np.arange(POINTS), BLOCKS // POINTS)
    r = rng.standard_normal((BLOCKS, ROWS))
    J_h = rng.standard_normal((BLOCKS, ROWS, NUMBERS))
    J_t = rng.standard_normal((BLOCKS, ROWS, PARAMETERS))
    J_t[:, :, list(weak)] *= 1e-3
    return point, r, J_h, J_t, rng.standard_normal(PARAMETERS), rng.uniform(0.2, 2.0, PARAMETERS)


def taken(point, r, J_h, J_t):
    sums = Sums.empty(POINTS, PARAMETERS)
    for places in (slice(0, 5), slice(5, 12)):
        sums.add(point[places], np.ones(len(point[places])), r[places], J_h[places], J_t[places])
    return sums


def shared(to_prior, precision, always=False):
    return Prior(to_prior, precision, np.broadcast_to(always, to_prior.shape), np.zeros(to_prior.shape, dtype=bool))


def none(points):
    """Points without parameters of their own."""
    return Prior(np.zeros((points, 0)), np.zeros((points, 0)), *np.zeros((2, points, 0), dtype=bool))


@pytest.mark.parametrize("weak", [(), (1,), (0, 4)])
def test_what_the_rows_do_not_tell_is_considered(weak):
    """All else is the dense solve; its own value stays at its prior, and what it is off by is in the covariance."""
    point, r, J_h, J_t, to_prior, precision = problem(7, weak)
    found = step(taken(point, r, J_h, J_t), shared(to_prior, precision), none(POINTS))
    np.testing.assert_array_equal(np.flatnonzero(~found.estimated), weak)
    np.testing.assert_array_equal(found.theta[list(weak)], to_prior[list(weak)])
    np.testing.assert_allclose(found.deviation[list(weak)], 1 / np.sqrt(precision[list(weak)]))
    kept = np.flatnonzero(found.estimated)
    remaining = r - J_t[:, :, list(weak)] @ to_prior[list(weak)]
    rows = np.zeros((BLOCKS * ROWS + len(kept), NUMBERS * POINTS + len(kept)))
    for b in range(BLOCKS):
        place = slice(b * ROWS, (b + 1) * ROWS)
        rows[place, NUMBERS * point[b] : NUMBERS * (point[b] + 1)] = J_h[b]
        rows[place, NUMBERS * POINTS :] = J_t[b][:, kept]
    root = np.sqrt(precision[kept])
    rows[BLOCKS * ROWS :, NUMBERS * POINTS :] = np.diag(root)
    unknowns = np.linalg.lstsq(rows, np.concatenate([remaining.ravel(), root * to_prior[kept]]), rcond=None)[0]
    numbers = NUMBERS * POINTS
    np.testing.assert_allclose(found.h.ravel(), unknowns[:numbers], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found.theta[kept], unknowns[numbers:], rtol=1e-10, atol=1e-10)
    inverse = np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(found.S_inverse[np.ix_(kept, kept)], inverse[numbers:, numbers:], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.deviation[kept], np.sqrt(np.diag(inverse)[numbers:]), rtol=1e-10)
    wrong = np.concatenate([J_t[:, :, list(weak)].reshape(BLOCKS * ROWS, len(weak)), np.zeros((len(kept), len(weak)))])
    passed = inverse @ rows.T @ wrong / np.sqrt(precision[list(weak)])
    covariance = inverse + passed @ passed.T
    factors = found.factors()
    for p in range(POINTS):
        part = slice(NUMBERS * p, NUMBERS * (p + 1))
        total = found.records[p] + factors[:, p].T @ factors[:, p]
        np.testing.assert_allclose(total, covariance[part, part], rtol=1e-9, atol=1e-10)
    across = np.einsum("qa,qb->ab", factors[:, 0], factors[:, 1])[np.ix_(range(8), range(8))]
    assert np.isfinite(across).all()


OWN = 3


@pytest.mark.parametrize("weak", [(), (1,), (0, 2)])
def test_parameters_of_single_points_are_those_of_a_border_that_holds_them_all(weak):
    """Value, deviation and every share of the covariance; what tells little is considered in either."""
    point, r, J_h, J_t, to_prior, precision = problem(11, (3,))
    rng = np.random.default_rng(12)
    J_own, distance = rng.standard_normal((BLOCKS, ROWS, OWN)), rng.standard_normal((POINTS, OWN))
    J_own[:, :, list(weak)] *= 1e-3
    never = np.zeros((POINTS, OWN), dtype=bool)
    own = Prior(distance, rng.uniform(0.2, 2.0, (POINTS, OWN)), never, never)
    sums = Sums.empty(POINTS, PARAMETERS, NUMBERS + OWN)
    sums.add(point, np.ones(len(point)), r, np.concatenate([J_h, J_own], axis=2), J_t)
    found = step(sums, shared(to_prior, precision), own)
    everywhere = np.zeros((BLOCKS, ROWS, POINTS, OWN))
    everywhere[np.arange(BLOCKS), :, point] = J_own
    border = np.concatenate([J_t, everywhere.reshape(BLOCKS, ROWS, -1)], axis=2)
    all_sums = Sums.empty(POINTS, PARAMETERS + POINTS * OWN)
    all_sums.add(point, np.ones(len(point)), r, J_h, border)
    joined = (np.concatenate([to_prior, distance.ravel()]), np.concatenate([precision, own.precision.ravel()]))
    bordered = step(all_sums, shared(*joined), none(POINTS))
    np.testing.assert_array_equal(found.by_point.estimated.ravel(), bordered.estimated[PARAMETERS:])
    assert found.by_point.estimated.sum() <= POINTS * (OWN - len(weak))
    for value, other in (
        (found.h, bordered.h),
        (found.theta, bordered.theta[:PARAMETERS]),
        (found.by_point.change.ravel(), bordered.theta[PARAMETERS:]),
        (found.by_point.deviation.ravel(), bordered.deviation[PARAMETERS:]),
        (found.deviation, bordered.deviation[:PARAMETERS]),
        (found.records, bordered.records),
        (found.factors(), bordered.factors()[:PARAMETERS]),
    ):
        np.testing.assert_allclose(value, other, rtol=1e-9, atol=1e-10)
    own_factors = bordered.factors()[PARAMETERS:].reshape(POINTS, OWN, POINTS, NUMBERS)
    for k in range(OWN):
        share = np.einsum("rpa,rpb->pab", own_factors[:, k], own_factors[:, k])
        np.testing.assert_allclose(found.point_share(np.arange(OWN) == np.full((POINTS, 1), k)), share, atol=1e-10)


def test_always_means_always():
    point, r, J_h, J_t, to_prior, precision = problem(8, (2,))
    always = np.arange(PARAMETERS) == 2
    assert step(taken(point, r, J_h, J_t), shared(to_prior, precision, always), none(POINTS)).estimated.all()


def test_never_means_never_and_the_prior_passes_on():
    point, r, J_h, J_t, to_prior, precision = problem(8)
    never = np.arange(PARAMETERS) == 1
    prior = Prior(to_prior, precision, np.zeros(PARAMETERS, dtype=bool), never)
    free, found = (step(taken(point, r, J_h, J_t), p, none(POINTS)) for p in (shared(to_prior, precision), prior))
    assert free.estimated[1]
    np.testing.assert_array_equal(found.estimated, free.estimated & ~never)
    assert found.theta[1] == to_prior[1]
    assert np.abs(found.factors()[1]).max() > 0.0


def test_a_parameter_is_estimated_from_four_fifths_of_its_prior_on():
    """One row of size j tells 1 / sqrt(1 + j^2) of a prior of one."""
    for tells, estimated in ((0.81, False), (0.79, True)):
        assert (tells < CONSIDERED) is estimated
        sums = Sums(np.eye(8)[None], np.zeros((1, 8, 1)), np.zeros((1, 8)), np.array([[tells**-2 - 1]]), np.zeros(1))
        assert step(sums, shared(np.zeros(1), np.ones(1)), none(1)).estimated[0] == estimated


def test_without_any_parameter_the_points_stand_alone():
    point, r, J_h, _, _, _ = problem(9)
    sums = Sums.empty(POINTS, 0)
    sums.add(point, np.ones(len(point)), r, J_h, np.zeros((BLOCKS, ROWS, 0)))
    found = step(sums, shared(np.zeros(0), np.zeros(0)), none(POINTS))
    for p in range(POINTS):
        mine = point == p
        alone = np.linalg.lstsq(J_h[mine].reshape(-1, NUMBERS), r[mine].ravel(), rcond=None)[0]
        np.testing.assert_allclose(found.h[p], alone, rtol=1e-9)
    assert found.factors().shape == (0, POINTS, NUMBERS)


def test_every_share_of_a_campaign_s_budget_is_a_covariance():
    case = Case(
        miss=(0.005, 0.005),
        mass_uncertainty=0.01,
        stated={"displacement": {"uncertainty": 0.01, "axis_uncertainty": 0.005}, "force": {"delay_uncertainty": 1e-4}},
    )
    solution = solved(*made(case))
    assert set(solution.shares) == {
        "calibration", "axis", "delay", "mass", "housing", "load direction", "load miss",
    }  # fmt: skip
    for share in (solution.records, *solution.shares.values()):
        size = np.abs(share).max()
        assert np.linalg.eigvalsh(share / size).min() > -1e-9
    squares = np.einsum("qpa,qpb->pab", solution.factors, solution.factors)
    np.testing.assert_allclose(squares, sum(solution.shares.values()), rtol=1e-9, atol=1e-9 * squares.max())
