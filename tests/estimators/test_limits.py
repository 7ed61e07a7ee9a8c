"""Models over frequency, lines, windows, amplitude and calibration: answers that can be written down beforehand."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import t as student_t

from rigdata.operating_point import OperatingPoint
from tests.phasors import phasor_cases
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.equation import RigStiffness
from tpjb_ident.phasors.lines import (
    Line,
    LineSet,
    RecordTooShortError,
    known_lines,
    line_design,
    plan_windows,
    strong_lines,
    variance_inflation,
)
from tpjb_ident.results.frequency_model import REFUSED, fit_over_frequency, fits_over_frequency
from tpjb_ident.results.linearity import MIN_RATIO, NOTABLE, SIGNIFICANCE, AmplitudeSlope, amplitude_slope
from tpjb_ident.runs.point_data import PointData
from tpjb_ident.runs.run_jobs import DryTest

K = np.array([[2.0e8, 1e7], [-3e7, 4.0e8]])
C = np.array([[4e5, 2e4], [-1e4, 6e5]])
M = np.array([[30.0, 4.0], [-2.0, 50.0]])
OMEGAS = 2 * np.pi * np.array([15.0, 25.0, 40.0, 60.0])


def estimate(omega, mass=0.0, off=0.0, error=1e6, covariance=None):
    h = K - mass * omega**2 * M + 1j * omega * C + off
    return phasor_cases.stiff(h, float(omega), error**2 * np.eye(8) if covariance is None else covariance)


def test_stiffness_and_damping_that_are_there_are_found_exactly():
    fit = fit_over_frequency([estimate(w) for w in OMEGAS], "K-C")
    np.testing.assert_allclose(fit.parameters, np.concatenate([K.ravel(), C.ravel()]), rtol=1e-9)
    assert fit.chi_square < 1e-3
    assert fit.misfit < 1e-9
    assert (fit.spare, fit.n_frequencies) == (24, 4)
    np.testing.assert_allclose(fit.band, (15.0, 60.0), rtol=1e-12)
    np.testing.assert_allclose(fit.h(100.0), K + 100j * C, rtol=1e-9)
    # equal errors: K is a mean, C a slope through the origin
    expected = np.repeat([1e6**2 / 4, 1e6**2 / np.sum(OMEGAS**2)], 4)
    np.testing.assert_allclose(np.diag(fit.covariance), expected, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance - np.diag(np.diag(fit.covariance)), 0.0, atol=1e-3)
    np.testing.assert_allclose(fit.standard_error, np.sqrt(expected), rtol=1e-9)


def test_a_mass_is_found_and_its_want_refused():
    given = [estimate(w, mass=1.0, error=1e5) for w in OMEGAS]
    fit = fit_over_frequency(given, "K-C-M")
    np.testing.assert_allclose(fit.parameters[8:], M.ravel(), rtol=1e-6)
    np.testing.assert_allclose(fit.parameters[:4], K.ravel(), rtol=1e-9)
    np.testing.assert_allclose(fit.h(200.0), K - 200.0**2 * M + 200j * C, rtol=1e-8)
    assert fit.spare == 20
    assert not fit.refused
    without = fit_over_frequency(given, "K-C")
    assert without.refused
    worst = max(np.linalg.norm(without.h(e.omega) - e.h) / np.linalg.norm(e.h) for e in given)
    assert without.misfit == pytest.approx(worst)
    assert without.probability == pytest.approx(float(chi2.sf(without.chi_square, 24)))
    inflated = np.sqrt(np.diag(without.covariance) * without.chi_square / 24)
    np.testing.assert_allclose(without.standard_error, inflated, rtol=1e-12)


def test_chi_square_is_the_weighted_sum_of_what_is_left():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((8, 8))
    spread = 1e10 * (root @ root.T + np.eye(8))
    given = [estimate(w, off=1e6 * (rng.standard_normal((2, 2)) + 1j), covariance=(k + 1) * spread)
             for k, w in enumerate(OMEGAS)]  # fmt: skip
    for model in ("K-C", "K-C-M"):
        fit = fit_over_frequency(given, model)
        left = 0.0
        for est in given:
            miss = est.h - fit.h(est.omega)
            vector = np.concatenate([miss.real.ravel(), miss.imag.ravel()])
            left += vector @ np.linalg.solve(est.covariance, vector)
        assert fit.chi_square == pytest.approx(left, rel=1e-6)
        turned = fit_over_frequency(given[::-1], model)
        np.testing.assert_allclose(turned.parameters, fit.parameters, rtol=1e-9)


def test_one_frequency_is_its_own_answer():
    fit = fit_over_frequency([estimate(OMEGAS[1])], "K-C")
    np.testing.assert_allclose(fit.parameters[4:], C.ravel(), rtol=1e-9)
    assert fit.spare == 0
    assert math.isnan(fit.probability)
    assert not fit.refused
    np.testing.assert_allclose(fit.standard_error, np.sqrt(np.diag(fit.covariance)))
    # two estimates at one frequency: the second model still needs another
    twice, lost = 2 * [estimate(OMEGAS[1])], [replace(estimate(OMEGAS[1]), h=np.full((2, 2), np.nan + 0j))]
    assert fit_over_frequency(twice, "K-C").spare == 8
    for given, model, message in (
        (twice, "K-C-M", "K-C-M needs 2 frequencies with an answer, got 1"),
        (lost, "K-C", "K-C needs 1 frequencies with an answer, got 0"),
        (twice, "K", "unknown model 'K'"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_over_frequency(given, model)


def test_estimates_without_an_interval_are_left_out():
    lost = replace(estimate(OMEGAS[2], off=1e9), covariance=np.full((8, 8), np.nan))
    fit = fit_over_frequency([estimate(OMEGAS[0]), lost, estimate(OMEGAS[3])], "K-C")
    np.testing.assert_allclose(fit.parameters[:4], K.ravel(), rtol=1e-9)
    assert fit.n_frequencies == 2


def test_a_gain_that_all_frequencies_share_is_in_the_interval_as_it_is_in_theirs():
    gain = 0.01 * np.array([estimate(w).vector for w in OMEGAS])
    given = [replace(estimate(w, error=1.0), systematic=np.outer(g, g)) for w, g in zip(OMEGAS, gain, strict=True)]
    fit = fit_over_frequency(given, "K-C", gain.reshape(1, -1))
    truth = np.concatenate([K.ravel(), C.ravel()])
    np.testing.assert_allclose(np.sqrt(np.diag(fit.systematic)), np.abs(0.01 * truth), rtol=1e-6)
    # each frequency's own errors average out
    single = fit_over_frequency(given, "K-C")
    np.testing.assert_allclose(np.diag(single.systematic)[:4], (0.01 * K.ravel()) ** 2 / 4, rtol=1e-6)


@pytest.mark.slow
def test_intervals_over_frequency_hold_the_truth():
    rng = np.random.default_rng(11)
    dof, draws, inside = 16.0, 400, 0
    truth = np.concatenate([K.ravel(), C.ravel()])
    for _ in range(draws):
        common = 0.003 * rng.standard_normal()
        given, changes = [], []
        for w in OMEGAS[:3]:
            exact = estimate(w)
            error = 1e6 * rng.standard_normal(8)
            measured = 1e12 * np.eye(8) * rng.chisquare(dof) / dof
            h = exact.h * (1 + common) + error[:4].reshape(2, 2) + 1j * error[4:].reshape(2, 2)
            changes.append(0.003 * exact.vector)
            systematic = np.outer(changes[-1], changes[-1])
            given.append(replace(exact, h=h, covariance=measured, dof=np.full(8, dof), systematic=systematic))
        fit = fit_over_frequency(given, "K-C", np.concatenate(changes)[None])
        inside += np.count_nonzero(np.abs(fit.parameters - truth) < fit.half_width())
    assert 0.93 < inside / (8 * draws) < 0.98


def point(stiffness, load=5000.0, direction=-90.0, speed=22.0):
    where = OperatingPoint(load, math.radians(direction), 2 * math.pi * speed)
    return SimpleNamespace(point=where, stiffness=stiffness)


@pytest.mark.parametrize(("mass", "wild", "supported"), [(0.0, 0.0, "K-C"), (1.0, 0.0, "K-C-M"), (0.0, 3e7, "raw H")])
def test_the_simplest_model_that_is_not_refused_is_supported(mass, wild, supported):
    off = wild * np.array([1, -1, 1, -1])
    points = tuple(point(estimate(w, mass, o, error=1e5)) for w, o in zip(OMEGAS, off, strict=True))
    (found,) = fits_over_frequency(points)
    assert found.supported == supported
    assert set(found.fits) == {"K-C", "K-C-M"}
    assert found.points == points


def test_loads_directions_and_speeds_are_fitted_apart():
    two = OMEGAS[:2]
    places = ((5e3, -90, 22), (6e3, -90, 22), (5e3, -60, 22), (5e3, -90, 33))
    points = [point(estimate(w), *place) for w in two for place in places]
    points.append(point(estimate(two[0]), load=7e3))  # alone at its load
    points += [point(estimate(two[0]), load=8e3), point(replace(estimate(two[1]), h=np.full((2, 2), np.nan)), load=8e3)]
    found = fits_over_frequency(tuple(points))
    assert [len(f.points) for f in found] == [2, 2, 2, 2]
    assert 0.0 < REFUSED < 0.05


def lines_of(found):
    return [(line.name, line.frequency) for line in found.nuisance]


def test_every_kind_of_line_has_its_place_and_order():
    found = known_lines((33.0, 25.0), 10.0, 1000.0, 60.0, extra=(71.3,))
    assert [e.frequency for e in found.excitation] == [25.0, 33.0]
    assert lines_of(found) == [
        ("1X", 10.0), ("2X", 20.0), ("mains", 60.0), ("harmonic 2", 50.0), ("harmonic 2", 66.0), ("found", 71.3)
    ]  # fmt: skip
    np.testing.assert_array_equal(found.frequencies[:3], [25.0, 33.0, 10.0])
    more = [(line.name, line.frequency) for line in strong_lines(found.excitation, 10.0, 60.0, 3, 2)]
    assert more[:5] == [("1X", 10.0), ("2X", 20.0), ("3X", 30.0), ("mains", 60.0), ("mains 2", 120.0)]
    assert more[5:] == [("harmonic 2", 50.0), ("harmonic 2", 66.0)]
    assert found.speed == 10.0
    moved = found.with_slip(1.0)
    assert moved[2:4].tolist() == [11.0, 22.0]
    assert moved[4:8].tolist() == found.frequencies[4:].tolist()
    assert known_lines((25.0, 25.0), 0.0, 1000.0, 0.0).frequencies.tolist() == [25.0, 50.0]


LINES = [
    # within its wander the shaft strikes the excitation; its second harmonic wanders twice as far
    (25.0, 24.93, {}, "2X", "1X"),
    (25.0, 24.91, {}, "1X 2X mains", ""),
    (25.0, 25.08, {}, "2X", "1X"),
    (25.0, 25.09, {}, "1X 2X mains", ""),
    (25.0, 12.45, {"mains": 0.0}, "1X harmonic 2", "2X"),
    (25.0, 12.41, {"mains": 0.0}, "1X 2X harmonic 2", ""),
    (25.0, 12.57, {"mains": 0.0}, "1X harmonic 2", "2X"),
    (25.0, 12.6, {"mains": 0.0}, "1X 2X harmonic 2", ""),
    (65.0, 22.0, {}, "1X 2X mains harmonic 2", ""),
    (66.0, 22.0, {}, "1X 2X mains harmonic 2", "3X"),
    # lines closer than either wanders are one
    (30.0, 49.9, {}, "1X 2X harmonic 2", ""),
    (30.0, 49.8, {}, "1X 2X mains harmonic 2", ""),
    # and what a record is too short to tell apart, the shaft's before the film's
    (25.0, 50.2, {"mains": 60.0, "duration": 2.0}, "1X 2X mains", ""),
    (25.0, 50.2, {"mains": 60.0, "duration": 4.0}, "1X 2X mains harmonic 2", ""),
    # a harmonic above the band is none
    (230.0, 22.0, {}, "1X 2X mains", ""),
]


@pytest.mark.parametrize(("driven", "speed", "more", "names", "struck"), LINES)
def test_lines_stand_apart_by_more_than_they_wander(driven, speed, more, names, struck):
    found = known_lines((driven,), speed, 1000.0, **more)
    assert " ".join(name for name, _ in lines_of(found)) == names
    assert found.conditions == ((f"{struck} on excitation line",) if struck else ())


@pytest.mark.parametrize(("speed", "there"), [(50.02, False), (47.0, True)])
def test_what_film_and_shaft_make_at_next_to_no_frequency_is_the_mean(speed, there):
    whole = known_lines((25.0,), speed, 1000.0, duration=2.0).whole
    assert ("2f-X" in [line.name for line in whole]) is there


def test_faint_lines_are_those_of_the_whole_record_unless_they_stand_out():
    found = known_lines((25.0,), 22.0, 1000.0, 50.0, (66.0, 71.0), 4.0)
    assert [(line.name, line.frequency) for line in found.faint] == [
        ("4X", 88.0), *((f"{n}X", 22.0 * n) for n in range(5, 11)), ("harmonic 3", 75.0), ("2X-f", 19.0), ("2f-X", 28.0)
    ]  # fmt: skip
    assert lines_of(found)[3:] == [("3X", 66.0), ("found", 71.0)]
    assert found.with_slip(0.5)[-4:].tolist() == [225.0, 75.0, 20.0, 27.5]
    # |2X - f| falls where 2X is below f
    assert known_lines((50.0,), 22.0, 1000.0).with_slip(0.5)[-2] == 5.0


def test_inflation_is_the_variance_of_a_phasor_over_that_of_the_line_alone():
    """One line over whole cycles: one; a neighbour half a beat away: from the Gram matrix of both."""
    for alone in ([20.0], [25.0, 20.0]):
        assert variance_inflation(np.array(alone), 1, 1.0, 1000.0) == pytest.approx(1.0, abs=0.02)
    assert variance_inflation(np.array([25.0, 25.0]), 1, 1.0, 1000.0) == math.inf
    frequencies, length = np.array([20.0, 21.3, 33.0]), 0.5
    design = line_design(np.arange(500) / 1000.0, frequencies)
    covariance = np.linalg.inv(design.T @ design) * 500 / 2
    by_hand = np.diag(covariance)[:2].max()
    assert variance_inflation(frequencies, 1, length, 1000.0) == pytest.approx(by_hand, rel=0.03)
    every = np.diag(covariance)[:4].max()
    assert variance_inflation(frequencies, 2, length, 1000.0) == pytest.approx(every, rel=0.03)
    # as many samples as unknowns tell nothing
    assert variance_inflation(np.array([20.0, 33.0]), 1, 0.006, 1000.0) == math.inf


def test_windows_are_as_long_as_asked_or_as_many_as_wished():
    usual, alone = known_lines((25.0,), 22.0, 1000.0), LineSet((Line("excitation", 25.0),), ())

    def planned(samples, lines=usual, length=None):
        return plan_windows(samples, 1000.0, lines, length)

    assert planned(5000, length=0.8) == planned(4800, length=0.8) == (800, 6)
    assert planned(40_000) == (2000, 20)
    # few windows of a short record: four cycles of a line alone, more of one with neighbours
    assert planned(1600, alone) == (160, 10)
    assert planned(1600)[0] > 160
    with pytest.raises(RecordTooShortError, match=r"a window of 0\.03 s.*cannot tell the lines apart"):
        planned(3000, length=0.03)


H = K + 1j * OMEGAS[1] * C


def shaken(factors, direction, stiffening=0.0, off=None):
    """Runs of one direction, each `factors` times as hard; h changes with the logarithm of the amplitude."""
    axis = np.array([math.cos(direction), math.sin(direction)])
    runs, D, F = [], [], []
    for k, factor in enumerate(factors):
        moved = 1e-5 * factor * axis * np.exp(0.3j)
        change = stiffening * math.log2(np.linalg.norm(moved) / 1e-5) + (0.0 if off is None else off[k])
        runs.append(SimpleNamespace(direction=direction))
        D.append(moved)
        F.append((1 + change) * H @ moved)
    return runs, D, F


def data_of(*groups):
    runs = [run for g in groups for run in g[0]]
    D, F = (np.array([row for g in groups for row in g[k]]) for k in (1, 2))
    repeated = np.repeat(np.arange(len(runs)), 3)
    return PointData(None, tuple(runs), (0,) * len(runs), D[repeated], F[repeated], repeated)


def test_a_stiffening_with_amplitude_is_found_exactly_and_units_do_not_matter():
    data = data_of(shaken((1.0, 2.0), 0.2, 0.05), shaken((0.5, 1.0, 3.0), 1.1, 0.05))
    found = amplitude_slope(data, H, np.ones(15))
    assert found.stiffening == pytest.approx(0.05, rel=1e-9)
    assert found.standard_error < 1e-9
    assert found.runs == 5
    data = replace(data, D=1e3 * data.D, F=1e-2 * data.F)
    assert amplitude_slope(data, 1e-5 * H, np.ones(15)).stiffening == pytest.approx(0.05, rel=1e-9)


def test_what_a_direction_is_off_as_a_whole_is_no_amplitude_effect():
    data = data_of(shaken((1.0, 2.0), 0.2, 0.05, (0.2, 0.2)), shaken((1.0, 2.0, 4.0), 1.1, 0.05, (-0.1, -0.1, -0.1)))
    assert amplitude_slope(data, H, np.ones(15)).stiffening == pytest.approx(0.05, rel=1e-6)
    # opposite directions are one
    both = data_of(shaken((1.0,), 0.2, 0.05), shaken((2.0,), 0.2 + math.pi, 0.05), shaken((1.0, 2.0, 4.0), 1.1, 0.05))
    assert amplitude_slope(both, H, np.ones(15)).runs == 5


def test_its_error_is_that_of_a_slope_within_directions():
    off = np.array([0.01, -0.01, 0.02, -0.03, 0.01])
    factors = (1.0, 2.0, 4.0, 8.0, 16.0)
    found = amplitude_slope(data_of(shaken(factors, 0.4, 0.0, off)), H, np.ones(15))
    x = np.log2(factors) - 2.0
    slope = x @ off / (x @ x)
    left = off - off.mean() - slope * x
    assert found.stiffening == pytest.approx(slope, rel=1e-9)
    assert found.standard_error == pytest.approx(math.sqrt(left @ left / 3 / (x @ x)), rel=1e-9)


@pytest.mark.parametrize(("ratio", "told"), [(MIN_RATIO * 1.01, True), (MIN_RATIO * 0.99, False)])
def test_amplitudes_must_differ_to_tell_anything(ratio, told):
    data = data_of(shaken((1.0, ratio), 0.2), shaken((1.0, ratio), 1.1))
    assert (amplitude_slope(data, H, np.ones(12)).runs > 0) is told


def test_too_few_runs_and_windows_without_weight_tell_nothing():
    assert not amplitude_slope(data_of(shaken((1.0, 2.0), 0.2)), H, np.ones(6)).runs
    data = data_of(shaken((1.0, 2.0, 4.0), 0.2, 0.05), shaken((1.0, 2.0), 1.1, 0.05))
    weights = np.where(data.run_index == 1, 0.0, 1.0)
    assert amplitude_slope(data, H, weights).runs == 4
    spoilt = np.where(np.arange(15) % 3 == 0, 0.0, 1.0)
    data = replace(data, F=data.F + 1e4 * (spoilt == 0)[:, None])
    assert amplitude_slope(data, H, spoilt).stiffening == pytest.approx(0.05, rel=1e-9)
    data.runs[0].direction = None
    assert amplitude_slope(data, H, spoilt).runs == 4
    assert not amplitude_slope(data, np.full((2, 2), np.nan), spoilt).runs


def test_a_slope_is_pointed_out_beyond_chance_and_one_per_cent():
    limit = float(student_t.isf(SIGNIFICANCE / 2, 4))
    for slope, error, runs in ((1.01 * limit * 0.01, 0.01, 6), (1.01 * NOTABLE, 1e-9, 6), (1.01 * NOTABLE, 1e-9, 2)):
        for sign in (1.0, -1.0):
            assert AmplitudeSlope(sign * slope, error, runs).condition()
            assert AmplitudeSlope(sign * slope * 0.98, error, runs).condition() == ()
    (said,) = AmplitudeSlope(-0.123, 0.004, 6).condition()
    assert said == "nonlinear-amplitude"
    assert "-12.3 %" in said.detail
    assert "0.4 %" in said.detail


def test_baseline_runs_without_an_answer_are_named_where_no_other_baseline_reaches():
    failed = Condition("baseline-missing", "the baseline runs at 15 Hz give no answer: two directions are needed")
    known = RigStiffness(OMEGAS[1:3], np.zeros((2, 2, 2), complex), np.zeros((2, 8, 8)))
    assert [DryTest(conditions=(failed,)).missing(omega) for omega in OMEGAS] == [(failed,)] * len(OMEGAS)
    assert [bool(DryTest(known, (failed,)).missing(omega)) for omega in OMEGAS] == [True, False, False, True]
    assert DryTest().missing(OMEGAS[0]) == ()


def test_the_bare_rig_is_linear_between_its_frequencies_and_nothing_beyond():
    h = np.array([np.eye(2), 3 * np.eye(2)]) * (1e7 + 1e6j)
    known = RigStiffness(np.array([100.0, 200.0]), h, np.zeros((2, 8, 8)))
    np.testing.assert_allclose(known.at(np.array([100.0, 150.0, 201.0])), h[[0, 0, 1]] * [[[1.0]], [[2.0]], [[1.0]]])
    np.testing.assert_array_equal(known.at(np.array([97.0, 205.0])), 0.0)
