"""Mains on the excitation line, and what else is put right between phasors and estimate, taken off exactly."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.dynamic import phasor_cases
from tests.dynamic.phasor_cases import FILM_H as H
from tests.dynamic.phasor_cases import complex_normal
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.corrections import mains_angles
from tpjb_ident.dynamic.corrections.find import Correction, find_corrections
from tpjb_ident.dynamic.corrections.load_direction import DirectionSensitivity
from tpjb_ident.dynamic.corrections.mains import (
    LOCKED,
    MAINS_CORRECTED,
    MAINS_ON_LINE,
    MIN_RUNS,
    MainsFit,
    Pickup,
    corrected_condition,
    fit_mains,
    mains_pickup,
    relative_scatter,
    with_mains_uncertainty,
    without_mains,
)
from tpjb_ident.dynamic.corrections.mains_angles import MainsEquations
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.estimators.estimate import estimate_dynamic_stiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import mains_line
from tpjb_ident.phasors.lines import LineSettings, known_lines

OMEGA = 2 * math.pi * 50.0
PATTERN = 1e-7 * np.array([1.0 + 0.5j, -0.6j])
AXES = np.radians([45.0, 135.0])
PROBES = np.stack([np.cos(AXES), np.sin(AXES)], axis=1)


@pytest.fixture(autouse=True)
def _few_starts(monkeypatch):
    """Six runs with little pick-up need neither two thousand starts nor thirty of them polished."""
    monkeypatch.setattr(mains_angles, "_STARTS", 40)
    monkeypatch.setattr(mains_angles, "_POLISHED", 6)


def shaken(n=6, per_run=4, seed=1, h=H, load=5000.0, coincident=False, noise=1e-13, force=500.0):
    """Runs in n directions, F = H D in every window but for next to no noise."""
    rng = np.random.default_rng(seed)
    angle = np.arange(n) * math.pi / n
    F = force * np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.exp(2j * math.pi * rng.random(n))[:, None]
    index = np.repeat(np.arange(n), per_run)
    D = np.linalg.solve(h, F.T).T[index] + noise * complex_normal(rng, n * per_run, 2)
    conditions = (Condition(MAINS_ON_LINE),) if coincident else ()
    runs = tuple(SimpleNamespace(run=f"r{k}", conditions=conditions) for k in range(n))
    point = OperatingPoint(load, -math.pi / 2, 138.0, OMEGA)
    return PointData(point, runs, (0,) * n, D, F[index], np.zeros_like(D), index)


def with_pickup(data, patterns, seed=3):
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, (len(data.runs), len(patterns)))
    vectors = np.exp(1j * angles) @ patterns
    return replace(data, D=data.D + vectors[data.run_index]), vectors


def stiff(h=H, variance=1e10, dof=30.0):
    return phasor_cases.stiff(h, OMEGA, variance * np.eye(8), dof)


def run_with_lines(excitation, z, seed=1, settings=None):
    lines = known_lines((excitation,), 22.0, 1000.0, settings or LineSettings())
    names = [line.name for line in lines.nuisance]
    phasors = complex_normal(np.random.default_rng(seed), 5, len(lines.frequencies), 2)
    if "mains" in names:
        phasors[:, 1 + names.index("mains")] = z
    return SimpleNamespace(lines=lines, displacement=SimpleNamespace(phasors=phasors))


def test_the_mains_line_of_a_run_is_its_typical_phasor():
    z = np.array([[1, 1j], [1, 1j], [50, 50j], [1, 1j], [np.nan, 0]])
    np.testing.assert_allclose(mains_line(run_with_lines(30.0, z)), [1, 1j])
    assert mains_line(run_with_lines(30.0, np.full((5, 2), np.nan))) is None
    # on the excitation, or under one of its harmonics, it is no mains line
    for excitation in (50.0, 25.0, 50.0 / 3):
        assert mains_line(run_with_lines(excitation, z[:1], settings=LineSettings(drive_harmonics=3))) is None
    lines = known_lines((30.0,), 22.0, 1000.0, LineSettings(mains=0.0))
    assert mains_line(SimpleNamespace(lines=lines, displacement=None)) is None


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
    wobble = math.acos(LOCKED - off)
    probes = [np.exp([0.3j * k, 1j * (0.3 * k + 1.0 + wobble * (-1) ** k)]) for k in range(8)]
    assert len(mains_pickup([np.linalg.solve(PROBES, p) for p in probes], AXES).patterns) == patterns


def problem(patterns, seed=3, sigma=0.5):
    data, vectors = with_pickup(shaken(noise=0.0), patterns, seed)
    first = np.arange(0, 24, 4)
    return MainsEquations(data.D[first], data.F[first], patterns, np.full(6, sigma)), vectors


SINGLE, OWN = PATTERN[None], np.linalg.solve(PROBES, np.diag([1.0e-7, 0.7e-7])).T + 0j


@pytest.mark.parametrize("patterns", [SINGLE, OWN])
def test_residuals_have_the_slopes_that_are_said_and_vanish_at_the_truth(patterns):
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
    x = truth + 0.05 * np.random.default_rng(5).standard_normal(len(truth))
    step = 1e-6 * np.eye(len(x))
    numeric = np.stack([(given.residual(x + e) - given.residual(x - e)) / 2e-6 for e in step], axis=1)
    np.testing.assert_allclose(given.jacobian(x), numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())


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
    normal = given.jacobian(best.x).T @ given.jacobian(best.x)
    expected = np.linalg.inv(normal)[:8, :8] * given.scale**2
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(best.covariance / size, expected / size, atol=1e-4)
    assert best.log_volume == pytest.approx(-0.5 * math.log(np.linalg.det(normal)), rel=1e-3)
    assert [m.cost for m in found] == sorted(m.cost for m in found)
    places = np.array([m.x[:8] for m in found])
    assert all(np.abs(a - b).max() > 1e-6 for i, a in enumerate(places) for b in places[:i])


def test_without_noise_the_pickup_is_taken_off_exactly():
    data, vectors = with_pickup(shaken(), SINGLE)
    fit = fit_mains(data, Pickup(SINGLE, np.abs(PROBES @ PATTERN), 9), 1e-3)
    np.testing.assert_allclose(fit.pickup, vectors, atol=1e-11)
    clean = without_mains(data, fit)
    np.testing.assert_allclose(clean.D, data.D - vectors[data.run_index], atol=1e-11)
    np.testing.assert_array_equal(clean.F, data.F)
    # 24 real equations, 8 entries and 6 angles; eight degrees of freedom come from the other points
    assert fit.dof == 8.0 + 10
    assert fit.chi_square < 1e-3
    found = corrected_condition(Pickup(SINGLE, np.array([1.23e-7, 4.5e-8]), 9), fit)
    assert found == MAINS_CORRECTED
    assert "0.123 um, 0.045 um known from 9 other runs" in found.detail


@pytest.mark.parametrize(
    ("n", "patterns", "told"), [(5, OWN, True), (4, OWN, False), (4, SINGLE, True), (3, SINGLE, False)]
)
def test_as_many_equations_are_needed_as_there_are_unknowns_and_one(n, patterns, told):
    """Three runs have an equation to spare as a whole, but not along the pattern: H stays open there."""
    data, _ = with_pickup(shaken(n=n, per_run=6), patterns)
    fit = fit_mains(data, Pickup(patterns, np.ones(2), 9), 1e-3)
    assert (fit is not None) is told
    if told:
        assert fit.dof == 8.0 + 4 * n - 8 - len(patterns) * n


def test_the_scatter_of_other_points_and_ones_own_misfit_make_the_interval():
    """The prior has eight degrees of freedom; no other minimum is near when runs are many and pick-up small."""
    data, _ = with_pickup(shaken(n=8), SINGLE)
    rng = np.random.default_rng(7)
    F = data.F + 2.0 * complex_normal(rng, 8, 2)[data.run_index]
    spoilt = replace(data, F=F)
    pickup = Pickup(SINGLE, np.ones(2), 9)
    small, large = (fit_mains(spoilt, pickup, s) for s in (1e-3, 1e-1))
    spare = 4 * 8 - 8 - 8
    assert small.chi_square == pytest.approx(1e4 * large.chi_square, rel=1e-3)
    for fit, scatter in ((small, 1e-3), (large, 1e-1)):
        first = np.arange(0, 32, 4)
        own = MainsEquations(data.D[first], F[first], SINGLE, scatter * np.linalg.norm(F[first], axis=1))
        best = own.solve()[0]
        assert fit.chi_square == pytest.approx(best.cost / spare, rel=1e-3)
        inflation = (8.0 + best.cost) / (8.0 + spare)
        if scatter == 1e-3:
            np.testing.assert_allclose(np.diag(fit.covariance), inflation * np.diag(best.covariance), rtol=0.01)
            np.testing.assert_allclose(fit.shift, 0.0, atol=1e-3 * np.abs(H).max())


@pytest.mark.parametrize("off", [0.0, -2000.0, 900.0])
def test_two_answers_that_are_equally_good_share_by_their_breadth(monkeypatch, off):
    """Mean and covariance of a mixture: within and between; hundreds of angles make volumes beyond floats."""
    data = shaken()
    shares, entries = np.array([0.75, 0.25]), np.array([np.zeros(8), 4e6 * np.ones(8)])

    def minimum(cost, k):
        x = np.concatenate([entries[k] / scale, np.zeros(6)])
        return mains_angles.Minimum(cost, x, (k + 1) * 1e10 * np.eye(8), (math.log(3.0), 0.0)[k] + off)

    scale = float(np.linalg.norm(data.F[::4]) / np.linalg.norm(data.D[::4]))
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [minimum(5.0, 0), minimum(5.0, 1)])
    fit = fit_mains(data, Pickup(SINGLE, np.ones(2), 9), 1e-3)
    np.testing.assert_allclose(fit.shift, shares @ entries, rtol=1e-4)
    inflation = 13.0 / 18.0
    between = 0.75 * 0.25 * 16e12
    np.testing.assert_allclose(fit.covariance, inflation * 1.25e10 * np.eye(8) + between, rtol=1e-3)
    # two units of chi-square worse, in units of the inflation: exp(-1 / inflation) less likely
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [minimum(5.0, 0), minimum(7.0, 1)])
    worse = math.exp(-1.0 / inflation) / 3.0
    shift = fit_mains(data, Pickup(SINGLE, np.ones(2), 9), 1e-3).shift
    np.testing.assert_allclose(shift, 4e6 * worse / (1.0 + worse), rtol=1e-4)
    monkeypatch.setattr(MainsEquations, "solve", lambda self: [])
    assert fit_mains(data, Pickup(SINGLE, np.ones(2), 9), 1e-3) is None


def test_struck_windows_and_lost_runs_do_not_enter_the_means():
    data, vectors = with_pickup(shaken(per_run=7, noise=1e-11), SINGLE)
    D, F = data.D.copy(), data.F.copy()
    D[[0, 7]] += 1e-5
    F[[15, 22]] += 300.0j
    pickup = Pickup(SINGLE, np.ones(2), 9)
    fit = fit_mains(replace(data, D=D, F=F), pickup, 1e-3)
    np.testing.assert_allclose(fit.pickup, vectors, atol=1e-9)
    D[data.run_index == 4] = np.nan
    assert fit_mains(replace(data, D=D, F=F), pickup, 1e-3) is None
    assert fit_mains(shaken(per_run=1), pickup, 1e-3) is None


def test_an_estimate_moves_to_the_mean_of_the_answers_and_knows_less():
    shift, covariance = np.arange(8.0), 3.0 * np.eye(8)
    fit = MainsFit(np.zeros((6, 2)), shift, covariance, 18.0, 1.0)
    moved = with_mains_uncertainty(stiff(), fit)
    np.testing.assert_allclose(moved.vector, stiff().vector + shift)
    np.testing.assert_allclose(moved.covariance, stiff().covariance + covariance)
    np.testing.assert_array_equal(moved.dof, 18.0)
    np.testing.assert_array_equal(with_mains_uncertainty(stiff(dof=5.0), fit).dof, 5.0)
    lost = stiff(np.full((2, 2), np.nan))
    assert with_mains_uncertainty(lost, fit) is lost


def test_typical_scatter_of_runs_is_that_of_their_means():
    """Root mean square of what F - H D leaves of a run's force, for as many directions as the two unknowns spare."""
    rng = np.random.default_rng(8)
    points, sizes = [], []
    for k, share in enumerate((0.01, 0.02, 0.05)):
        data = shaken(n=5 + k, seed=k)
        off = share * np.linalg.norm(data.F[::4], axis=1)[:, None] * complex_normal(rng, 5 + k, 2)
        F = data.F + off[data.run_index]
        points.append(replace(data, F=F))
        sizes.append(np.mean(np.abs(off) ** 2 / np.linalg.norm(F[::4], axis=1)[:, None] ** 2) * (5 + k) / (3 + k))
    others = [shaken(coincident=True, force=1.0), shaken(n=2), shaken()]
    first = [stiff()] * 5 + [stiff(np.full((2, 2), np.nan))]
    others[0] = replace(others[0], F=9 * others[0].F)
    assert relative_scatter([*points, *others], first) == pytest.approx(math.sqrt(np.median(sizes)), rel=1e-4)
    assert relative_scatter(others, first[3:]) == 0.003


def source(data, ratios):
    """A point, with the mean loads of its runs as multiples of the set point."""
    force = data.point.static_load * np.exp(1j * data.point.static_load_direction) * np.asarray(ratios)
    found = data.runs[0].conditions
    return SimpleNamespace(
        point=data.point,
        load=lambda: data,
        found=lambda c: c in found,
        mean_loads=np.stack([force.real, force.imag], axis=1),
    )


def test_a_correction_takes_off_what_size_direction_and_mains_have_done():
    slope, turn = np.array([[1e8, 2e7j], [-1e7, 4e8]]), np.array([[0, -2e8], [3e8j, 1e7]])
    miss = LoadMiss(np.linspace(-0.02, 0.03, 6), np.linspace(0.01, -0.005, 6), 0.002)
    clean = shaken()
    loaded = clean.F + miss.size[clean.run_index][:, None] * (clean.D @ slope.T)
    loaded = loaded + miss.sideways[clean.run_index][:, None] * (clean.D @ turn.T)
    data, vectors = with_pickup(replace(clean, F=loaded), SINGLE)
    mains = MainsFit(vectors, np.ones(8), 5.0 * np.eye(8), 18.0, 1.0)
    named = (MAINS_CORRECTED, "static-load-off")
    both = Correction(
        miss, slope, DirectionSensitivity(turn, 7.0 * np.eye(8)), mains, tuple(Condition(c) for c in named)
    )
    corrected = both.apply(data)
    np.testing.assert_allclose(corrected.F, clean.F, atol=1e-9)
    np.testing.assert_allclose(corrected.D, clean.D, atol=1e-18)
    narrow = stiff(variance=1.0)
    wide = both.widened(narrow)
    shift = 0.002 * np.concatenate([slope.real.ravel(), slope.imag.ravel()])
    np.testing.assert_allclose(np.diag(wide.covariance), 13.0 + shift**2)
    np.testing.assert_allclose(wide.covariance - np.diag(np.diag(wide.covariance)), _off_diagonal(shift))
    np.testing.assert_allclose(wide.vector, narrow.vector + 1.0)
    slight = replace(both, slope=np.zeros((2, 2)))
    np.testing.assert_allclose(slight.widened(narrow).covariance, 13.0 * np.eye(8))
    np.testing.assert_allclose(replace(slight, turn=None).widened(narrow).covariance, 6.0 * np.eye(8))
    plain = both.measured_only()
    assert plain.conditions == ("static-load-off",)
    assert plain.miss is miss
    np.testing.assert_array_equal(plain.apply(data).F, data.F)
    np.testing.assert_array_equal(plain.apply(data).D, data.D)


def _off_diagonal(shift):
    return np.outer(shift, shift) - np.diag(shift**2)


def campaign(coincident):
    """Three loads, H a power law of them that turns with their direction; misses of the size that rigs have."""
    rng = np.random.default_rng(11)
    points, truths = [], []
    for load in (3000.0, 5000.0, 8000.0):
        h = H * (load / 5000.0) ** 0.5
        hit = coincident and load == 5000.0
        data = shaken(h=h, load=load, coincident=hit, seed=round(load))
        size, aside = 0.005 * rng.standard_normal((2, 6))
        size, aside = size - size.mean(), aside - aside.mean()
        k = float(np.mean(np.diag(h.real)))
        turned = k * np.array([[0, 1.0], [1.0, 0]])
        change = size[:, None, None] * 0.5 * h + aside[:, None, None] * turned
        F = data.F + np.einsum("nab,nb->na", change[data.run_index], data.D)
        full = replace(data, F=F)
        points.append(source(with_pickup(full, 0.3 * SINGLE)[0] if hit else full, 1 + size + 1j * aside))
        truths.append((data, h))
    return points, truths


@pytest.mark.parametrize("coincident", [False, True])
def test_a_whole_campaign_is_brought_to_its_set_points(coincident):
    points, truths = campaign(coincident)
    first = []
    for p in points:
        data = p.load()
        first.append(estimate_dynamic_stiffness(data.D, data.F, OMEGA, data.run_index, "ols"))
    lines = [0.3 * PATTERN * np.exp(0.3j * k) for k in range(8)]
    corrections = find_corrections(points, lines, AXES, first)
    for k, (p, found, (clean, h)) in enumerate(zip(points, corrections, truths, strict=True)):
        corrected = found.apply(p.load())
        size = np.linalg.norm(clean.F, axis=1).max()
        before = np.abs(p.load().F - clean.F).max() / size
        assert np.abs(corrected.F - clean.F).max() / size < 0.12 * before
        assert found.turn is not None
        np.testing.assert_allclose(found.slope, 0.5 * h, atol=(0.1 if coincident else 0.02) * np.abs(h).max())
        assert (found.mains is not None) is (coincident and k == 1)
        assert found.conditions == ((MAINS_CORRECTED,) if coincident and k == 1 else ())
        if found.mains is not None:
            np.testing.assert_allclose(corrected.D, clean.D, atol=0.02 * np.abs(PATTERN).max())
    # the pick-up's size is not known where no run shows it
    assert all(c.mains is None for c in find_corrections(points, [None] * 8, AXES, first))


def test_a_valley_without_a_floor_is_no_answer():
    """Forces whose phases turn with the pick-up leave H open: no minimum, rather than one of infinite breadth."""
    given, vectors = problem(SINGLE)
    turns = np.exp(1j * np.angle(vectors @ np.linalg.pinv(SINGLE)))
    direction = given.F / np.exp(1j * np.angle(given.F[:, :1] + given.F[:, 1:]))
    F = direction.real * turns
    open_one = replace(given, F=F, D=np.linalg.solve(H, F.T).T + vectors)
    for minimum in open_one.solve():
        assert np.isfinite(minimum.log_volume)
