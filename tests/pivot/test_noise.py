"""The noise model: its covariance, and what it learns from records."""

from __future__ import annotations

import numpy as np
import pytest

from tpjb_ident.slow_records.noise import NoiseModel, NoiseSeries, estimate_noise, flicker_kernel

BLOCK = 0.1
TRUE = NoiseModel(white=4e-18, flicker=1e-16, drift=1.5e-8)


def simulate(model, count, seed, n=120):
    rng = np.random.default_rng(seed)
    time = (np.arange(n) + 0.5) * BLOCK
    duration = np.full(n, BLOCK)
    root = np.linalg.cholesky(model.covariance(time, duration))
    mean = np.column_stack([np.ones(n), np.floor(time), np.floor(time) ** 2])
    return [NoiseSeries(time, duration, root @ rng.standard_normal(n), mean) for _ in range(count)]


def test_covariance_is_positive_definite_and_symmetric():
    time = np.sort(np.random.default_rng(0).uniform(0, 30, 90))
    duration = np.full(90, 0.05)
    covariance = TRUE.covariance(time, duration)
    assert covariance == pytest.approx(covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0


def test_flicker_has_the_stated_density():
    # averaging a periodogram over many draws: S(f) = 1/f within the ripple of the sum of exponentials
    n, step = 800, 0.04
    time = np.arange(n) * step
    root = np.linalg.cholesky(flicker_kernel(time) + 1e-12 * np.eye(n))
    rng = np.random.default_rng(5)
    window = np.hanning(n)
    power = np.zeros(n // 2 + 1)
    for _ in range(120):
        power += np.abs(np.fft.rfft(window * (root @ rng.standard_normal(n)))) ** 2
    density = 2.0 * power / 120 * step / np.sum(window**2)
    frequency = np.fft.rfftfreq(n, step)
    band = (frequency > 0.2) & (frequency < 2.0)
    assert density[band] * frequency[band] == pytest.approx(1.0, rel=0.45)
    assert np.mean(density[band] * frequency[band]) == pytest.approx(1.0, rel=0.12)


def test_levels_are_recovered():
    found = [estimate_noise(simulate(TRUE, 10, seed), 1e-8) for seed in range(4)]
    for name in ("white", "flicker", "drift"):
        ratio = np.median([getattr(f, name) for f in found]) / getattr(TRUE, name)
        assert 0.6 < ratio < 1.6, name


def test_drift_is_seen_where_there_is_more_than_usual():
    calm = estimate_noise(simulate(NoiseModel(4e-18, 1e-16, 1e-9), 8, 1), 1e-8)
    restless = estimate_noise(simulate(NoiseModel(4e-18, 1e-16, 2e-7), 8, 1), 1e-8)
    assert restless.drift > 8.0 * calm.drift
    assert restless.drift == pytest.approx(2e-7, rel=0.6)


def test_units_do_not_matter():
    series = simulate(TRUE, 6, 2)
    scaled = [NoiseSeries(s.time, s.duration, 1e3 * s.values, s.mean) for s in series]
    one, other = estimate_noise(series, 1e-8), estimate_noise(scaled, 1e-5)
    assert other.drift == pytest.approx(1e3 * one.drift, rel=1e-6)
    assert other.white == pytest.approx(1e6 * one.white, rel=1e-6)


def test_variance_of_a_mean():
    white = NoiseModel(4e-18, 0.0, 1e-8)
    assert white.mean_variance(2.0) == pytest.approx(2e-18, rel=1e-9)
    assert TRUE.mean_variance(1.0) > TRUE.mean_variance(4.0) > 0.0


def test_nothing_to_learn_from_is_an_error():
    time = np.arange(3.0)
    with pytest.raises(ValueError, match="longer holds"):
        estimate_noise([NoiseSeries(time, np.ones(3), time, np.eye(3))], 1e-8)
