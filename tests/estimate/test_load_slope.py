"""How H changes with the static load, told by a campaign's other loads."""

import numpy as np
import pytest

from tests.phasors.phasor_cases import H, place
from tpjb_ident.estimate.noise import UNKNOWN_EXPONENT, slopes_over_load

EXPONENTS = np.array([[0.7, -0.4], [1.3, 0.9]]), np.array([[0.2, 0.5], [-0.3, 1.1]])


def power_law(load):
    w = load / 5000.0
    return H.real * w ** EXPONENTS[0] + 1j * H.imag * w ** EXPONENTS[1]


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
    slope, known = slopes_over_load(everyone, np.concatenate([h, np.tile(H, (4, 1, 1))]))
    np.testing.assert_array_equal(known, [True] * 5 + [False] * 3)
    np.testing.assert_allclose(slope[5], UNKNOWN_EXPONENT * H)
    np.testing.assert_allclose(slope[4], slope[1].real + 1j * slope[1].imag * 35.0 / 20.0, rtol=1e-12)
    at_45 = slopes_over_load([*points, place(8000.0, excitation=45.0)], np.concatenate([h, H[None]]))[0][4]
    np.testing.assert_allclose(at_45, slope[3].real + 1j * slope[3].imag * 45.0 / 60.0, rtol=1e-12)
    # a point without an answer gives no slope, and may borrow one
    lost = h.copy()
    lost[1] = np.nan
    slope, known = slopes_over_load(points, lost)
    assert np.isfinite(slope).all()
    np.testing.assert_allclose(slope[1], slope[3].real + 1j * slope[3].imag / 3.0, rtol=1e-12)
    np.testing.assert_array_equal(known, True)
    assert not slopes_over_load([place(0.0), place(0.0)], h[:2])[1].any()
