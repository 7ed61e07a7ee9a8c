"""What a film tells over frequencies and amplitudes: a point whose runs are all wrong alike, one that was shaken too
hard."""

from dataclasses import replace

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.dynamics import bearing_impedance
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Setup
from rigdata import load_campaign
from tests.phasors.phasor_cases import FILM_H as H
from tests.phasors.phasor_cases import stiff
from tests.rigs import closed_form
from tests.rigs.acquisition import EXACT, Acquisition
from tests.rigs.closed_form import USUAL, Rig, vector, write_rig
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.results.frequency_model import frequency_outlier
from tpjb_ident.results.linearity import MAX_AMPLITUDE, NEVER_LINEAR, FilmChange, change_conditions

K, C = 1e6 * np.array([[80.0, 6.0], [-5.0, 250.0]]), 1e5 * np.array([[6.5, 0.1], [0.1, 11.0]])


def estimates(frequencies, h, error=1e5, seed=0):
    """Estimates of h (n, 2, 2) with a random error of every entry [N/m]."""
    rng = np.random.default_rng(seed)
    noisy = h + error * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
    omega = 2 * np.pi * np.array(frequencies)
    return [stiff(value, w, error**2 * np.eye(8), 20.0) for value, w in zip(noisy, omega.tolist(), strict=True)]


def film(frequencies, mass=0.0):
    omega = 2 * np.pi * np.array(frequencies)[:, None, None]
    return K + 1j * omega * C - omega**2 * mass * np.eye(2)


@pytest.mark.parametrize("mass", [0.0, 300.0])
@pytest.mark.parametrize(
    "fault", [np.diag([0.5, 0.5]), np.diag([1.0, 0.85]), np.exp(1j * 2 * np.pi * 35.0 * 1e-3) * np.eye(2)]
)
def test_a_gain_a_range_or_a_delay_of_one_frequency_is_told(fault, mass):
    frequencies = [15.0, 25.0, 35.0, 45.0]
    h = film(frequencies, mass)
    assert frequency_outlier(estimates(frequencies, h)) is None
    h[2] = h[2] @ fault
    place, distance = frequency_outlier(estimates(frequencies, h))
    assert place == 2
    assert np.linalg.norm(distance) > 0.05 * np.linalg.norm(h[2])


def test_noise_and_few_frequencies_tell_nothing():
    frequencies = [15.0, 25.0, 35.0, 45.0]
    h = film(frequencies)
    h[2] *= 0.9
    assert frequency_outlier(estimates(frequencies, h, error=3e7)) is None
    assert frequency_outlier(estimates(frequencies, h)[:3]) is None


@pytest.mark.parametrize(
    "frequencies", [[15.0, 25.0, 35.0, 45.0], [5.0, 120.0, 140.0, 155.0], [10.0, 30.0, 60.0, 90.0, 180.0]]
)
def test_a_film_that_bends_over_frequency_has_no_outlier(rocker_file, frequencies):
    bearing = load_bearing(rocker_file)
    for pivots in ("rigid", "kirk", 1e8):
        setup = Setup(bearing, pivot_laws(pivots, bearing), "isothermal")
        omega = 2 * np.pi * np.array(frequencies)
        prediction = predict_setup(setup, 8000.0, -np.pi / 2, 138.0, omega)
        h = bearing_impedance(setup, prediction.equilibrium, omega)
        assert frequency_outlier(estimates(frequencies, h, error=1e3)) is None


def test_an_outlier_s_interval_reaches_to_what_the_others_let_expect(tmp_path):
    plan = closed_form.Rig(frequencies=(20.0, 35.0, 55.0, 70.0))

    def up(values, rng, number):
        return values * (1.1 if 4 <= number < 8 else 1.0)

    channels = closed_form.with_entries(closed_form.channels_of(plan), "X1A", fault=up)
    result = identify(load_campaign(closed_form.write_rig(tmp_path, plan, channels)))
    flagged = [[c for c in p.quality if c == "frequency-outlier"] for p in result.points]
    assert [len(conditions) for conditions in flagged] == [0, 1, 0, 0]
    point = result.points[1]
    h = plan.film.h(35.0, 5000.0)
    off = np.abs(point.stiffness.vector - closed_form.vector(h))
    assert off.max() > 0.03 * np.linalg.norm(h)
    assert (off < point.stiffness.half_width()).all()
    assert all((e.half_width() > off).all() for e in point.by_method.values())
    total = sum(point.budget.values())
    np.testing.assert_allclose(total, point.stiffness.covariance + point.stiffness.systematic, rtol=1e-6, atol=1e6)


@pytest.mark.parametrize(
    ("change", "size", "named"),
    [
        (FilmChange(0.0, hidden=1e-4), 0.29, ()),
        (FilmChange(0.0, hidden=0.02), 0.29, ("large-amplitude",)),
        (FilmChange(0.0, hidden=0.02), MAX_AMPLITUDE, ()),
        (FilmChange(0.02, hidden=1e-4), 0.08, ()),
        (FilmChange(0.06, hidden=1e-4), 0.08, ("film-not-linear",)),
        (FilmChange(0.07, is_shown=False), 0.04, ("large-amplitude",)),
        (FilmChange(0.16, is_shown=False), 0.1, ("film-not-linear",)),
        (FilmChange(0.0, hidden=1e-4), NEVER_LINEAR * 1.01, ("large-amplitude",)),
    ],
)
def test_a_large_motion_is_flagged_only_where_the_harmonics_do_not_show_a_linear_film(change, size, named):
    est = stiff(H, covariance=(0.003 * np.abs(H[0, 0])) ** 2 * np.eye(8))
    assert change_conditions(change, {}, est, size * 80e-6, 80e-6) == named
    assert change_conditions(FilmChange(), {}, est, 1.0, None) == ()


@pytest.mark.slow
def test_three_amplitudes_are_right_where_one_is_refused(tmp_path):
    film = replace(USUAL, square=3.0, cube=5.0)
    rig = Rig(film=film, frequencies=(25.0,), amplitude=0.12, seconds=2.0)
    for sizes, refused in (((1.0,), True), ((0.3, 0.6, 1.0), False)):
        path = write_rig(tmp_path, replace(rig, sizes=sizes), setup=Acquisition(rate=1000.0, uncertainty=EXACT))
        (point,) = identify(load_campaign(path), IdentifySettings(clearance=80e-6)).points
        assert ("film-not-linear" in point.quality) is refused
        if not refused:
            off = np.abs(point.stiffness.vector - vector(film.h(25.0, 5000.0)))
            assert (off < 1.5 * point.stiffness.half_width()).all()
            assert "amplitude" in point.budget
