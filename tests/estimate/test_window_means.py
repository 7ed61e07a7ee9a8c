"""Windows of a point to one phasor a run and channel: weights, noise, drives that wander; slopes of H over the load."""

import numpy as np
import pytest

from tests.phasors.phasor_cases import H as BASE
from tests.phasors.phasor_cases import complex_normal, hermitian, place
from tpjb_ident.estimate.noise import UNKNOWN_EXPONENT, slopes_over_load
from tpjb_ident.estimate.window_means import Readings, aligned, motion_in, window_means

RUNS, WINDOWS, CHANNELS = 5, 12, 4
RUN = np.repeat(np.arange(RUNS), WINDOWS)
TIME = np.tile(0.5 * np.arange(WINDOWS), RUNS)
DEVICES = ("probes", "probes", "cells", "cells")
H = np.array([[1.0 + 0.5j, 0.2], [-0.3j, 2.0 + 1.0j]])
ALL = np.vstack([np.eye(2), H])  # what a motion makes of displacements and forces
TRUE = (complex_normal(np.random.default_rng(1), RUNS, 2) + 2) @ ALL.T
NOISE = 1e-4 * hermitian(np.random.default_rng(2), CHANNELS)


def windows(seed, noise=NOISE):
    rng = np.random.default_rng([9, seed])
    return TRUE[RUN] + complex_normal(rng, len(RUN), CHANNELS) @ np.linalg.cholesky(noise).T


def meant(z, weights=None, present=None, devices=DEVICES):
    weights = np.ones(len(RUN)) if weights is None else weights
    present = np.ones((RUNS, CHANNELS), dtype=bool) if present is None else present
    return window_means(z, RUN, TIME, Readings(devices, np.eye(CHANNELS)), weights, present)


def test_without_noise_means_are_exact():
    found = meant(TRUE[RUN])
    np.testing.assert_allclose(found.mean, TRUE, rtol=1e-12)
    np.testing.assert_allclose(found.slope, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.count, WINDOWS)
    np.testing.assert_allclose(found.time, 2.75)
    assert found.wandering == 0


@pytest.mark.slow
def test_noise_is_unbiased_and_means_scatter_by_it():
    noises, means = [], []
    for seed in range(200):
        found = meant(windows(seed))
        noises.append(found.noise)
        means.append((found.mean - TRUE) * np.sqrt(found.count)[:, None])
    np.testing.assert_allclose(np.mean(noises, axis=0), NOISE, atol=0.05 * np.abs(NOISE).max())
    assert np.trace(np.mean(noises, axis=0)).real == pytest.approx(np.trace(NOISE).real, rel=0.05)
    scatter = np.mean(np.abs(means) ** 2, axis=(0, 1))
    np.testing.assert_allclose(scatter, np.diag(NOISE).real, rtol=0.12)


def test_bad_windows_lose_their_weight_and_the_mean_does_not_move():
    z = windows(1)
    bad = [3, 17, 40]
    z[bad, :2] += 0.5
    found = meant(z)
    assert found.weights[bad].max() < 0.01
    assert np.delete(found.weights, bad).mean() > 0.85
    np.testing.assert_allclose(found.mean, meant(windows(1)).mean, atol=0.02)
    np.testing.assert_allclose(np.diag(found.noise), np.diag(NOISE), rtol=0.5)


def test_windows_without_a_phasor_and_those_struck_before_do_not_count():
    z, weights = windows(2), np.ones(len(RUN))
    z[5, 1] = np.nan
    weights[20] = 0.0
    found = meant(z, weights=weights)
    assert found.weights[5] == 0.0
    np.testing.assert_allclose(found.mean, TRUE, atol=0.03)
    assert meant(np.full_like(z, np.nan)) is None


def test_good_windows_that_were_struck_among_few_come_back():
    few, shares = np.flatnonzero(np.arange(len(RUN)) % WINDOWS < 4), []
    for seed in range(20):
        z, struck = windows(seed)[few], np.random.default_rng(seed).random(len(few)) < 0.4
        time = np.arange(len(few)) % 4 * 0.5
        found = window_means(
            z,
            RUN[few],
            time,
            Readings(DEVICES, np.eye(CHANNELS)),
            np.where(struck, 0.0, 1.0),
            np.ones((RUNS, CHANNELS), bool),
        )
        shares.append(found.weights[struck].mean())
    assert np.mean(shares) > 0.95


def test_a_channel_that_a_run_lacks_leaves_the_others_theirs():
    z = windows(3)
    present = np.ones((RUNS, CHANNELS), dtype=bool)
    present[2, 3] = False
    z[RUN == 2, 3] = np.nan
    found = meant(z, present=present)
    np.testing.assert_allclose(found.mean[present], TRUE[present], atol=0.03)
    assert found.mean[2, 3] == 0
    assert found.count[2] > 0.8 * WINDOWS
    np.testing.assert_allclose(np.diag(found.noise), np.diag(NOISE), rtol=0.5)


def test_a_drive_that_wanders_is_turned_to_one_phase():
    """All channels of a window turn alike; what they are to one another stays."""
    rng = np.random.default_rng(4)
    turns = np.exp(1j * np.cumsum(rng.normal(0, 0.8, len(RUN))))
    found = meant(windows(4) * turns[:, None])
    assert found.wandering == RUNS
    ratio = found.mean / found.mean[:, :1]
    np.testing.assert_allclose(ratio, TRUE / TRUE[:, :1], rtol=0.03)
    assert (np.abs(found.mean) > 0.97 * np.abs(TRUE)).all()
    steady, wandering = aligned(windows(4), RUN, np.ones(len(RUN)))
    assert wandering == 0
    np.testing.assert_array_equal(steady, windows(4))


@pytest.mark.parametrize("rate", [0.02, -0.04])
def test_a_clock_shows_as_a_slope_of_its_device_and_not_as_noise(rate):
    turn = np.exp(1j * rate * (TIME - 2.75))[:, None] * [0, 0, 1, 1] + [1, 1, 0, 0]
    found = meant(windows(5) * turn)
    slope = found.slope / found.mean
    np.testing.assert_allclose(slope[:, 2:], 1j * rate, atol=6e-3)
    np.testing.assert_allclose(slope[:, :2], 0.0, atol=6e-3)
    np.testing.assert_allclose(np.diag(found.noise), np.diag(NOISE), rtol=0.5)


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_motion_from_window_to_window_is_no_noise(share):
    """A drive that wanders and a line close by: the film answers such motion as it answers the drive."""
    rng = np.random.default_rng(6)
    motion = share * complex_normal(rng, len(RUN), 2)
    still, moving = (meant(windows(6) + part, devices=("",) * CHANNELS) for part in (0.0, motion @ ALL.T))
    equation = np.hstack([-H, np.eye(2)])
    left = equation @ still.noise @ equation.conj().T
    np.testing.assert_allclose(equation @ moving.noise @ equation.conj().T, left, atol=0.3 * np.abs(left).max())
    assert np.trace(moving.noise).real < 100 * np.trace(NOISE).real
    moved = np.trace(share**2 * ALL @ ALL.conj().T).real
    assert np.trace(moving.motion).real == pytest.approx(moved, rel=0.3)
    assert not still.motion.any()


def test_motion_is_told_by_displacements_and_oil_forces():
    """What accelerometers show need not go with the motion of the means: the housing answers every frequency anew."""
    rng = np.random.default_rng(7)
    film = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    film[2, 4] = 3.0  # inertia along X
    inertia = complex_normal(rng, 300)
    residual = complex_normal(rng, 300, 2) @ ALL.T
    residual = np.column_stack([residual, inertia])
    residual[:, 2] -= 3.0 * inertia
    noise = 1e-4 * complex_normal(rng, 300, 5)
    means = np.column_stack([TRUE, np.zeros(RUNS)])
    left = residual + noise - motion_in(residual + noise, np.ones(300), means, film)
    np.testing.assert_allclose(left[:, 4], inertia + noise[:, 4], atol=1e-12)
    assert np.abs(left[:, :2]).max() < 1e-2
    assert np.abs((left @ film.T)[:, 2]).max() < 2e-2


def test_noise_of_the_channels_own_is_no_motion():
    rng = np.random.default_rng(8)
    noise = complex_normal(rng, 300, CHANNELS) * [1.0, 2.0, 0.5, 3.0]
    assert not motion_in(noise, np.ones(300), TRUE, np.eye(CHANNELS)).any()
    exact = motion_in(0 * noise, np.ones(300), TRUE, np.eye(CHANNELS))
    assert not exact.any()
    few = motion_in(noise[:1], np.ones(1), TRUE, np.eye(CHANNELS))
    assert np.isfinite(few).all()


EXPONENTS = np.array([[0.7, -0.4], [1.3, 0.9]]), np.array([[0.2, 0.5], [-0.3, 1.1]])


def power_law(load):
    w = load / 5000.0
    return BASE.real * w ** EXPONENTS[0] + 1j * BASE.imag * w ** EXPONENTS[1]


@pytest.mark.parametrize("loads", [(3000.0, 8000.0), (2500.0, 9000.0, 4000.0), (9000.0, 2500.0, 6000.0, 4000.0)])
def test_slopes_of_power_laws_are_their_exponents(loads):
    """At any spacing and in any order; stiffness and damping each with its own."""
    points = [place(load) for load in loads]
    h = np.array([power_law(load) for load in loads])
    slope, known = slopes_over_load(points, h)
    np.testing.assert_allclose(slope, EXPONENTS[0] * h.real + 1j * EXPONENTS[1] * h.imag, rtol=1e-9)
    assert known.all()


def test_entries_that_change_their_sign_or_vanish_are_straight_or_bent_in_the_logarithm():
    loads = np.array([2500.0, 4000.0, 9000.0])
    t = np.log(loads / 4500.0)
    values = np.stack([t, 2 * t + t**2, 0 * t, 1.0 + 0 * t], axis=1).reshape(3, 2, 2)
    points = [place(load) for load in loads]
    found, _ = slopes_over_load(points, np.array([v + 1j * v[::-1] for v in values]))
    expected = np.stack([1 + 0 * t, 2 + 2 * t, 0 * t, 0 * t], axis=1).reshape(3, 2, 2)
    np.testing.assert_allclose(found, expected + 1j * expected[:, ::-1], atol=1e-9)
    two, _ = slopes_over_load([points[0], points[2]], values[[0, 2]] + 0j)
    np.testing.assert_allclose(two[:, 0, 0], 1.0, rtol=1e-12)


def test_a_slope_is_borrowed_from_the_nearest_excitation_at_the_same_load():
    """Stiffness keeps its slope; omega c has one that goes with the frequency."""
    loads = (3000.0, 8000.0)
    points = [place(load, excitation=f) for f in (20.0, 60.0) for load in loads]
    h = np.array([(1 + k // 2) * power_law(p.static_load) for k, p in enumerate(points)])
    strangers = [place(8000.0, 30.0, 22.0, 35.0), place(8000.0, -90.0, 33.0, 35.0), place(7000.0, excitation=36.0)]
    everyone = [*points, place(8000.0, excitation=35.0), *strangers]
    slope, known = slopes_over_load(everyone, np.concatenate([h, np.tile(BASE, (4, 1, 1))]))
    np.testing.assert_array_equal(known, [True] * 5 + [False] * 3)
    np.testing.assert_allclose(slope[5], UNKNOWN_EXPONENT * BASE)
    np.testing.assert_allclose(slope[4], slope[1].real + 1j * slope[1].imag * 35.0 / 20.0, rtol=1e-12)
    at_45 = slopes_over_load([*points, place(8000.0, excitation=45.0)], np.concatenate([h, BASE[None]]))[0][4]
    np.testing.assert_allclose(at_45, slope[3].real + 1j * slope[3].imag * 45.0 / 60.0, rtol=1e-12)
    # a point without an answer gives no slope, and may borrow one
    lost = h.copy()
    lost[1] = np.nan
    slope, known = slopes_over_load(points, lost)
    assert np.isfinite(slope).all()
    np.testing.assert_allclose(slope[1], slope[3].real + 1j * slope[3].imag / 3.0, rtol=1e-12)
    np.testing.assert_array_equal(known, True)
    assert not slopes_over_load([place(0.0), place(0.0)], h[:2])[1].any()
