"""Mains on the excitation line: its size is known, its angles are found together with H."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.phasors.phasor_cases import FILM_H as H
from tests.phasors.phasor_cases import complex_normal
from tpjb_ident.phasors.lines import known_lines
from tpjb_ident.phasors.run_data import mains_lines
from tpjb_ident.terms import mains
from tpjb_ident.terms.mains import (
    _LOCKED,
    MAINS_CORRECTED,
    MIN_RUNS,
    MainsEquations,
    Pickup,
    fit_mains,
    force_pickup,
    force_pickup_spread,
    mains_pickup,
)

PATTERN = 1e-7 * np.array([1.0 + 0.5j, -0.6j])
AXES = np.radians([45.0, 135.0])
PROBES = np.stack([np.cos(AXES), np.sin(AXES)], axis=1)


@pytest.fixture(autouse=True)
def _few_starts(monkeypatch):
    """Six runs with little pick-up need neither two thousand starts nor thirty of them polished."""
    monkeypatch.setattr(mains, "_STARTS", 40)
    monkeypatch.setattr(mains, "_POLISHED", 6)


def shaken(n=6, seed=1, force=500.0):
    """Displacement and oil force of runs in n directions, (n, 2) each."""
    rng = np.random.default_rng(seed)
    angle = np.arange(n) * math.pi / n
    F = force * np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.exp(2j * math.pi * rng.random(n))[:, None]
    return np.linalg.solve(H, F.T).T, F


def with_pickup(D, patterns, seed=3):
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, (len(D), len(patterns)))
    vectors = np.exp(1j * angles) @ patterns
    return D + vectors, vectors


def run_with_lines(excitation, z, seed=1):
    lines = known_lines((excitation,), 22.0, 1000.0)
    names = [line.name for line in lines.nuisance]
    phasors = complex_normal(np.random.default_rng(seed), 5, len(lines.frequencies), 2)
    if "mains" in names:
        phasors[:, 1 + names.index("mains")] = z
    return SimpleNamespace(lines=lines, displacement=phasors, force=1e8 * phasors)


def test_the_mains_line_of_a_run_is_its_typical_phasor():
    z = np.array([[1, 1j], [1, 1j], [50, 50j], [1, 1j], [np.nan, 0]])
    displacement, force = mains_lines(run_with_lines(30.0, z))
    np.testing.assert_allclose(displacement, [1, 1j])
    np.testing.assert_allclose(force, [1e8, 1e8j])
    assert mains_lines(run_with_lines(30.0, np.full((5, 2), np.nan))) == (None, None)
    # on the excitation, or under one of its harmonics, it is no mains line
    for excitation in (50.0, 25.0, 50.0 / 3):
        assert mains_lines(run_with_lines(excitation, z[:1]))[0] is None
    lines = known_lines((30.0,), 22.0, 1000.0, 0.0)
    assert mains_lines(SimpleNamespace(lines=lines, displacement=None))[0] is None


def test_pickup_of_probes_that_keep_their_phases_is_one_pattern():
    turns = np.exp(2j * math.pi * np.random.default_rng(2).random(7))
    found = mains_pickup([turn * PATTERN for turn in turns] + [None], AXES)
    np.testing.assert_allclose(found.size, np.abs(PROBES @ PATTERN))
    assert found.runs == 7
    assert found.patterns.shape == (1, 2)
    overlap = np.vdot(found.patterns[0], PATTERN)
    assert abs(overlap) == pytest.approx(np.linalg.norm(PATTERN) ** 2)
    assert np.linalg.norm(found.patterns) == pytest.approx(np.linalg.norm(PATTERN))
    assert mains_pickup([PATTERN] * (MIN_RUNS - 1), AXES) is None
    assert mains_pickup([PATTERN] * MIN_RUNS, AXES) is not None
    # one run far off does not change the size
    odd = mains_pickup([turn * PATTERN for turn in turns] + [20 * PATTERN], AXES)
    np.testing.assert_allclose(odd.size, found.size)


def test_pickup_of_probes_with_phases_of_their_own_is_a_pattern_each():
    rng = np.random.default_rng(4)
    size = np.array([2e-7, 5e-8])
    lines = [np.linalg.solve(PROBES, size * np.exp(2j * math.pi * rng.random(2))) for _ in range(12)]
    found = mains_pickup(lines, AXES)
    np.testing.assert_allclose(found.patterns @ PROBES.T, np.diag(size), atol=1e-20)
    np.testing.assert_allclose(found.size, size)


@pytest.mark.parametrize(("off", "patterns"), [(-0.01, 1), (0.01, 2)])
def test_phases_that_stay_within_eighteen_degrees_are_locked(off, patterns):
    wobble = math.acos(_LOCKED - off)
    probes = [np.exp([0.3j * k, 1j * (0.3 * k + 1.0 + wobble * (-1) ** k)]) for k in range(8)]
    assert len(mains_pickup([np.linalg.solve(PROBES, p) for p in probes], AXES).patterns) == patterns


def problem(patterns, seed=3, sigma=0.5):
    D, F = shaken()
    struck, vectors = with_pickup(D, patterns, seed)
    return MainsEquations(struck, F, patterns, np.full(6, sigma)), vectors


SINGLE, OWN = PATTERN[None], np.linalg.solve(PROBES, np.diag([1.0e-7, 0.7e-7])).T + 0j


@pytest.mark.parametrize("patterns", [SINGLE, OWN])
def test_residuals_vanish_at_the_truth_and_count_in_unit_size(patterns):
    given, vectors = problem(patterns)
    angles = np.angle(vectors @ np.linalg.pinv(patterns))
    scaled = H.ravel() / given.scale
    truth = np.concatenate([scaled.real, scaled.imag, angles.ravel()])
    np.testing.assert_allclose(given.residual(truth), 0.0, atol=1e-6)
    np.testing.assert_allclose(given.h(truth), H)
    np.testing.assert_allclose(given.entries(truth), np.concatenate([H.real.ravel(), H.imag.ravel()]))
    np.testing.assert_allclose(given.vectors(truth), vectors)
    np.testing.assert_allclose(given.start(H), truth, atol=1e-9)
    # real and imaginary part of a residual of unit size count as two standard normal numbers
    off = replace(given, F=given.F + 0.5 * np.exp(0.7j))
    there = np.concatenate([truth[:8] * given.scale / off.scale, truth[8:]])
    assert np.sum(off.residual(there) ** 2) == pytest.approx(2.0 * 12)


@pytest.mark.parametrize("patterns", [SINGLE, OWN])
def test_h_and_the_angles_are_found_together(patterns):
    given, vectors = problem(patterns)
    found = given.solve()
    best = found[0]
    assert best.cost < 1e-8
    np.testing.assert_allclose(given.h(best.x), H, rtol=1e-6, atol=1.0)
    np.testing.assert_allclose(given.vectors(best.x), vectors, atol=1e-13)
    # starts are run down to places that differ, best first, before they are polished
    starts = given._candidates()
    np.testing.assert_allclose(starts[0], H, atol=0.05 * np.abs(H).max())
    size = np.linalg.norm(starts[0])
    assert all(np.linalg.norm(a - b) > 1e-3 * size for i, a in enumerate(starts) for b in starts[:i])
    noisy = replace(given, F=given.F + complex_normal(np.random.default_rng(6), 6, 2))
    for minimum in noisy.solve():
        assert minimum.cost == pytest.approx(np.sum(noisy.residual(minimum.x) ** 2))
    steps = 1e-6 * np.eye(len(best.x))
    slope = np.stack([(given.residual(best.x + e) - given.residual(best.x - e)) / 2e-6 for e in steps], axis=1)
    normal = slope.T @ slope
    expected = np.linalg.inv(normal)[:8, :8] * given.scale**2
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(best.covariance / size, expected / size, atol=1e-4)
    assert best.log_volume == pytest.approx(-0.5 * math.log(np.linalg.det(normal)), rel=1e-3)
    assert [m.cost for m in found] == sorted(m.cost for m in found)
    places = np.array([m.x[:8] for m in found])
    assert all(np.abs(a - b).max() > 1e-6 for i, a in enumerate(places) for b in places[:i])


def test_without_noise_the_pickup_is_found_exactly():
    D, F = shaken()
    struck, vectors = with_pickup(D, SINGLE)
    fit = fit_mains(struck, F, Pickup(SINGLE, np.abs(PROBES @ PATTERN), 9), 1e-3)
    np.testing.assert_allclose(fit.pickup, vectors, atol=1e-11)
    # 24 real equations, 8 entries and 6 angles; eight degrees of freedom come from the other points
    assert fit.dof == 8.0 + 10
    assert fit.chi_square < 1e-3
    found = replace(fit, known=Pickup(SINGLE, np.array([1.23e-7, 4.5e-8]), 9)).condition()
    assert found == MAINS_CORRECTED
    assert "0.123 um, 0.045 um known from 9 other runs" in found.detail


@pytest.mark.parametrize(
    ("n", "patterns", "told"), [(5, OWN, True), (4, OWN, False), (4, SINGLE, True), (3, SINGLE, False)]
)
def test_as_many_equations_are_needed_as_there_are_unknowns_and_one(n, patterns, told):
    """Three runs have an equation to spare as a whole, but not along the pattern: H stays open there."""
    D, F = shaken(n=n)
    fit = fit_mains(with_pickup(D, patterns)[0], F, Pickup(patterns, np.ones(2), 9), 1e-3)
    assert (fit is not None) is told
    if told:
        assert fit.dof == 8.0 + 4 * n - 8 - len(patterns) * n


def test_the_scatter_of_other_points_and_ones_own_misfit_make_the_interval():
    """The prior has eight degrees of freedom; no other minimum is near when runs are many and pick-up small."""
    D, F = shaken(n=8)
    D = with_pickup(D, SINGLE)[0]
    F = F + 2.0 * complex_normal(np.random.default_rng(7), 8, 2)
    pickup = Pickup(SINGLE, np.ones(2), 9)
    small, large = (fit_mains(D, F, pickup, s) for s in (1e-3, 1e-1))
    spare = 4 * 8 - 8 - 8
    assert small.chi_square == pytest.approx(1e4 * large.chi_square, rel=1e-3)
    for fit, scatter in ((small, 1e-3), (large, 1e-1)):
        own = MainsEquations(D, F, SINGLE, scatter * np.linalg.norm(F, axis=1))
        best = own.solve()[0]
        assert fit.chi_square == pytest.approx(best.cost / spare, rel=1e-3)
        inflation = (8.0 + best.cost) / (8.0 + spare)
        if scatter == 1e-3:
            np.testing.assert_allclose(np.diag(fit.covariance), inflation * np.diag(best.covariance), rtol=0.01)
            np.testing.assert_allclose(fit.shift, 0.0, atol=1e-3 * np.abs(H).max())


@pytest.mark.parametrize("off", [0.0, -2000.0, 900.0])
def test_two_answers_that_are_equally_good_share_by_their_breadth(monkeypatch, off):
    """Mean and covariance of a mixture: within and between; hundreds of angles make volumes beyond floats."""
    D, F = shaken()
    shares, entries = np.array([0.75, 0.25]), np.array([np.zeros(8), 4e6 * np.ones(8)])

    def minimum(cost, k):
        x = np.concatenate([entries[k] / scale, np.zeros(6)])
        return mains.Minimum(cost, x, (k + 1) * 1e10 * np.eye(8), (math.log(3.0), 0.0)[k] + off)

    scale = float(np.linalg.norm(F) / np.linalg.norm(D))
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [minimum(5.0, 0), minimum(5.0, 1)])
    fit = fit_mains(D, F, Pickup(SINGLE, np.ones(2), 9), 1e-3)
    np.testing.assert_allclose(fit.shift, shares @ entries, rtol=1e-4)
    inflation = 13.0 / 18.0
    between = 0.75 * 0.25 * 16e12
    np.testing.assert_allclose(fit.covariance, inflation * 1.25e10 * np.eye(8) + between, rtol=1e-3)
    # two units of chi-square worse, in units of the inflation: exp(-1 / inflation) less likely
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [minimum(5.0, 0), minimum(7.0, 1)])
    worse = math.exp(-1.0 / inflation) / 3.0
    shift = fit_mains(D, F, Pickup(SINGLE, np.ones(2), 9), 1e-3).shift
    np.testing.assert_allclose(shift, 4e6 * worse / (1.0 + worse), rtol=1e-4)
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [])
    assert fit_mains(D, F, Pickup(SINGLE, np.ones(2), 9), 1e-3) is None


def test_a_lost_run_gives_no_answer():
    D, F = shaken()
    D[4] = np.nan
    assert fit_mains(D, F, Pickup(SINGLE, np.ones(2), 9), 1e-3) is None


def test_mains_in_the_cells_is_what_least_squares_makes_of_a_line_of_random_phase():
    lines = [np.array([3.0 * np.exp(1j * k), 1.0]) for k in range(5)]
    size = force_pickup([*lines, None, np.array([90.0, 90.0])])
    np.testing.assert_allclose(size, [3.0, 1.0])
    np.testing.assert_array_equal(force_pickup([None]), 0.0)
    rng = np.random.default_rng(9)
    D, F = shaken()
    errors = []
    for _ in range(3000):
        line = size * np.exp(2j * math.pi * rng.random((6, 2)))
        off = np.linalg.lstsq(D, F + line, rcond=None)[0].T - H
        errors.append(np.concatenate([off.real.ravel(), off.imag.ravel()]))
    found = np.diag(force_pickup_spread(D, size))
    np.testing.assert_allclose(np.mean(np.square(errors), axis=0), found, rtol=0.12)


def test_a_valley_without_a_floor_is_no_answer():
    """Forces whose phases turn with the pick-up leave H open: no minimum, rather than one of infinite breadth."""
    given, vectors = problem(SINGLE)
    turns = np.exp(1j * np.angle(vectors @ np.linalg.pinv(SINGLE)))
    direction = given.F / np.exp(1j * np.angle(given.F[:, :1] + given.F[:, 1:]))
    F = direction.real * turns
    open_one = replace(given, F=F, D=np.linalg.solve(H, F.T).T + vectors)
    for minimum in open_one.solve():
        assert np.isfinite(minimum.log_volume)
