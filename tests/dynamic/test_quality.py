"""Figures and flags of a point, from phasors made by hand: linearity, damping sign, losses, loads, calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.corrections.static_load import load_misses, load_slopes, to_set_point, widened
from tpjb_ident.dynamic.corrections.systematic_sources import apparent_change, gain_draws
from tpjb_ident.dynamic.estimators.estimate import estimate_dynamic_stiffness
from tpjb_ident.dynamic.instruments.amplitude import amplitude_slope
from tpjb_ident.dynamic.records.lines import known_lines
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.records.run_data import RunPhasors
from tpjb_ident.dynamic.results.frequency_fit import fit_over_frequency
from tpjb_ident.dynamic.results.quality import amplitude, coherence, directional_pattern, flags, rejected_windows
from tpjb_ident.dynamic.runs.point_data import PointData, gather

OMEGA = 2 * np.pi * 25.0
H = np.array([[2.1e8 + 6.3e7j, 2.0e7 + 3.1e6j], [-1.5e7 + 1.6e6j, 5.0e8 + 9.4e7j]])
WINDOWS = 6


def run(name: str, direction: float, force: float = 500.0, h=H, load: float = 5000.0, seed: int = 0, miss=0.0):
    rng = np.random.default_rng([seed, round(1e3 * direction)])
    noise = rng.standard_normal((WINDOWS, 4)) + 1j * rng.standard_normal((WINDOWS, 4))
    F = force * np.array([np.cos(direction), np.sin(direction)]) + 0.1 * noise[:, :2]
    D = np.linalg.solve(h, F.T).T + 1e-9 * noise[:, 2:]
    mean = np.tile([0.0, -load * (1 + miss)], (WINDOWS, 1))
    point = OperatingPoint(load, -np.pi / 2, 2 * np.pi * 22, OMEGA)
    lines = known_lines((25.0,), 22.0, 1000.0)

    def block(z, mean=mean):
        lost = np.zeros(WINDOWS)
        return PhasorBlock(z[:, None, :], mean, np.full((WINDOWS, 2), 1e-9), lost)

    start = 0.25 * np.arange(WINDOWS)
    return RunPhasors(
        name, point, direction, lines, start, 0.25, block(D), block(F), None, 30.0, np.full(WINDOWS, 22.0)
    )


def point_of(runs) -> PointData:
    (data,) = gather(list(runs))
    return data


def six(**how) -> PointData:
    return point_of(run(f"r{i}", i * np.pi / 6, **how) for i in range(6))


def estimate(data: PointData):
    return estimate_dynamic_stiffness(data.D, data.F, OMEGA, data.run_index)


def test_amplitude_dependence_is_found_and_linear_bearings_are_left_alone():
    def stiffening(force):
        return H * (1 + 0.05 * np.log2(force / 500.0))

    def both(law):
        runs = [
            run(f"r{i}-{f:g}", i * np.pi / 6, force=f, h=law(f), seed=round(f))
            for i in range(6)
            for f in (250.0, 500.0, 1000.0)
        ]
        data = point_of(runs)
        est = estimate(data)
        return amplitude_slope(data, est.h, est.weights.min(axis=1))

    slope = both(stiffening)
    # D falls as h grows, so a doubled force is not quite a doubled amplitude
    assert slope.stiffening == pytest.approx(0.05, rel=0.15)
    assert slope.significant
    assert slope.condition() == ("nonlinear-amplitude",)
    linear = both(lambda force: H)
    assert not linear.significant
    assert linear.condition() == ()
    data = six()
    assert amplitude_slope(data, H, np.ones(len(data.D))) is None


def test_a_film_that_feeds_the_motion_is_pointed_out():
    good = six()
    assert "negative-damping" not in flags(good, estimate(good), 1.0)
    inverted = replace(good, D=-good.D)
    assert "negative-damping" in flags(inverted, estimate(inverted), 1.0)


def test_missing_windows_and_runs_are_pointed_out_but_not_as_rejected_directions():
    data = six()
    D = data.D.copy()
    D[data.run_index == 2] = np.nan
    lost = replace(data, D=D)
    est = estimate(lost)
    found = flags(lost, est, 1.0)
    assert "run-without-data" in found
    assert directional_pattern(lost, est.weights.min(axis=1)) is None
    D = data.D.copy()
    D[::5] = np.nan
    assert "windows-missing" in flags(replace(data, D=D), estimate(replace(data, D=D)), 1.0)
    assert "inertia-not-corrected" in flags(data, estimate(data), 1.0)


def test_coherence_and_amplitude():
    data = six()
    ones = np.ones(len(data.D))
    assert coherence(data.D, data.F, H, ones) > 0.9999
    assert coherence(data.D, data.F + 300 * np.random.default_rng(0).standard_normal(data.F.shape), H, ones) < 0.8
    largest = max(np.linalg.norm(np.linalg.solve(H, 500 * np.array([np.cos(a), np.sin(a)]))) for a in np.arange(6))
    assert amplitude(data, ones) == pytest.approx(largest, rel=0.1)
    assert "low-coherence" in flags(data, estimate(data), 0.8)


def test_rejected_windows_say_what_moved():
    data = six()
    F = data.F.copy()
    F[8] += 400.0
    spoiled = replace(data, F=F)
    est = estimate(spoiled)
    (verdict,) = rejected_windows(spoiled, est.h, est.weights.min(axis=1))
    assert (verdict.run, verdict.time) == ("r1", 0.5)
    assert verdict.reason.startswith("force phasor")
    assert verdict.direction == pytest.approx(np.pi / 6)


def test_loads_are_brought_to_their_set_points():
    def law(load):
        return np.diag([1e8 * (load / 5e3) ** 0.5 + 6e7j, 3e8 * (load / 5e3) + 9e7j])

    def campaign(rng):
        runs = []
        for load in (3000.0, 4000.0, 5000.0, 7000.0):
            for i in range(6):
                miss = 0.01 * rng.standard_normal()
                runs.append(run(f"{load:g}-{i}", i * np.pi / 6, h=law(load * (1 + miss)), load=load, miss=miss, seed=i))
        return gather(runs)

    points = campaign(np.random.default_rng(8))
    first = [estimate(p) for p in points]
    misses, common = load_misses(points)
    assert abs(common - 1) < 0.005
    slopes = load_slopes(points, first)
    np.testing.assert_allclose(np.diag(slopes[2].real), [0.5e8, 3e8], rtol=0.1)
    for i, p in enumerate(points):
        true = law(p.point.static_load)
        after = estimate(to_set_point(p, misses[i], slopes[i])).h
        # what is left is the campaign's own mean miss, known to 1 % / sqrt(24)
        assert np.linalg.norm(after - true) < 0.004 * np.linalg.norm(true)


def test_an_unknown_slope_widens_the_interval_by_the_mean_miss():
    data = six(miss=0.02)
    est = estimate(data)
    (miss,), _ = load_misses([data])
    assert np.abs(miss.size).max() < 1e-9  # one point alone: all runs alike are the cells' gain
    shifted = replace(miss, size=miss.size + 0.02)
    wide = widened(est, shifted, None)
    extra = np.sqrt(np.diag(wide.covariance - est.covariance))
    np.testing.assert_allclose(extra, 0.6 * 0.02 * np.abs(est.vector), rtol=1e-6)


class _Channel:
    def __init__(self, name, quantity, axis, uncertainty):
        self.name, self.quantity, self.axis, self.uncertainty = name, quantity, np.radians(axis), uncertainty


def test_calibration_draws_move_h_as_gains_do():
    channels = {
        "X": _Channel("X", "displacement", 0, 0.01),
        "Y": _Channel("Y", "displacement", 90, 0.02),
        "FX": _Channel("FX", "force", 0, 0.003),
        "FY": _Channel("FY", "force", 90, None),
    }
    draws = gain_draws(channels, 4000, seed=1)
    assert draws.unstated == ("FY",)
    data = six()
    change = apparent_change(data, estimate(data), draws)
    sigma = change.std(axis=0) / np.abs(np.concatenate([H.real.ravel(), H.imag.ravel()]))
    np.testing.assert_allclose(sigma[[0, 3]], [np.hypot(0.01, 0.003), 0.02], rtol=0.06)
    assert np.abs(change.mean(axis=0) / change.std(axis=0)).max() < 0.05
    # probes at 45 deg share their errors between X and Y, so a common gain is less likely
    turned = {**channels, "X": _Channel("X", "displacement", 45, 0.01), "Y": _Channel("Y", "displacement", 135, 0.01)}
    both = apparent_change(data, estimate(data), gain_draws(turned, 4000, seed=1)).std(axis=0)
    assert both[3] / H[1, 1].real == pytest.approx(0.01 / np.sqrt(2), rel=0.1)


def test_frequency_models_and_which_one_the_data_support():
    K, C, M = np.diag([1e8, 3e8]), np.diag([4e5, 6e5]), np.diag([300.0, 500.0])

    def points(mass, seed=0):
        rng = np.random.default_rng(seed)
        result = []
        for f in (10.0, 20.0, 30.0, 40.0, 50.0):
            omega = 2 * np.pi * f
            h = K - omega**2 * mass + 1j * omega * C
            est = replace(estimate(six()), omega=omega)
            error = rng.multivariate_normal(np.zeros(8), est.covariance)
            result.append(replace(est, h=h + (error[:4] + 1j * error[4:]).reshape(2, 2)))
        return result

    plain = fit_over_frequency(points(np.zeros((2, 2))), "K-C")
    assert not plain.refused
    assert plain.dof == 32
    np.testing.assert_allclose(np.diag(plain.K), np.diag(K), rtol=2e-3)
    with_mass = points(M)
    assert fit_over_frequency(with_mass, "K-C").refused
    full = fit_over_frequency(with_mass, "K-C-M")
    assert not full.refused
    error = np.abs(
        np.concatenate([full.K.ravel(), full.C.ravel(), full.M.ravel()])
        - np.concatenate([K.ravel(), C.ravel(), M.ravel()])
    )
    assert (error < 4 * full.standard_error).all()
    np.testing.assert_allclose(full.h(2 * np.pi * 30.0), with_mass[2].h, rtol=0.02, atol=1e6)
    with pytest.raises(ValueError, match="unknown model"):
        fit_over_frequency(with_mass, "K")
    with pytest.raises(ValueError, match="needs 2 frequencies"):
        fit_over_frequency(with_mass[:1], "K-C-M")


def test_two_directions_are_used_with_a_word_of_warning():
    data = point_of([run("a", 0.0), run("b", np.pi / 2)])
    est = estimate(data)
    assert "no-spare-direction" in est.status
    np.testing.assert_allclose(est.h, H, atol=0.01 * np.abs(H).max())
