"""Centre and corners of a clearance polygon: what the convention does with pads that stand off."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata.vector import directions
from tests.clearance.cases import ANGLES
from tpjb_ident.clearance.polygon import corners, find_centre

SMALL = np.eye(5) * (1e-8) ** 2
MICRO = st.floats(-50e-6, 50e-6)


@settings(max_examples=30)
@given(x=MICRO, y=MICRO, offset=st.floats(2e-6, 30e-6), pad=st.integers(0, 4), sign=st.sampled_from([-1, 1]))
def test_one_pad_off_is_found_exactly(x, y, offset, pad, sign):
    clearance = np.full(5, 80e-6)
    clearance[pad] += sign * offset
    found = find_centre(ANGLES, clearance + directions(ANGLES) @ [x, y], SMALL)
    # square within the measurement error: a few hundredths of a micrometre remain
    assert found.position == pytest.approx([x, y], abs=8e-8)
    assert found.clearance == pytest.approx(80e-6, abs=8e-8)


def test_differences_within_the_error_are_averaged():
    clearance = 80e-6 + np.array([1.0, -0.5, 0.2, -0.9, 0.4]) * 1e-8
    square = np.linalg.lstsq(np.column_stack([directions(ANGLES), np.ones(5)]), clearance, rcond=None)[0]
    assert find_centre(ANGLES, clearance, SMALL).position == pytest.approx(square[:2], abs=1e-12)


@pytest.mark.parametrize("degrees", [(-90, 0, 90, 180), (-45, 45, 135, 225), (-90, -30, 30, 150)])
@pytest.mark.parametrize("pad", range(4))
def test_of_four_pads_any_may_be_off_and_the_error_reaches_to_each(degrees, pad):
    angles = np.radians(degrees)
    clearance = np.full(4, 80e-6)
    clearance[pad] += 8e-6
    found = find_centre(angles, clearance, np.eye(4) * 1e-16)
    n = directions(angles)
    # the sides stand at the clearances: the true centre is zero
    assert found.suspects[pad] == pytest.approx(8e-6, abs=1e-9)
    if degrees[3] - degrees[0] == 270:
        assert found.suspects == pytest.approx(8e-6 * (-1.0) ** (np.arange(4) - pad), abs=1e-9)
    errors = 1.96 * np.sqrt(np.einsum("ki,ij,kj->k", n, found.covariance, n))
    assert np.all(np.abs(n @ found.position) <= errors)
    assert errors.max() < 1.25 * np.abs(found.suspects).max()
    five = find_centre(ANGLES, np.full(5, 80e-6), SMALL)
    assert not five.covariance.any()
    assert not five.suspects.any()


@pytest.mark.parametrize("angles", [ANGLES[:2], np.zeros(5)])
def test_pads_that_do_not_surround_the_shaft_are_refused(angles):
    with pytest.raises(ValueError, match="around the shaft"):
        find_centre(angles, np.full(len(angles), 80e-6), np.eye(len(angles)) * 1e-16)


def test_corners_of_a_regular_pentagon():
    found = corners(ANGLES, np.full(5, 80e-6))
    assert np.hypot(*found.T) == pytest.approx(80e-6 / np.cos(np.pi / 5), rel=1e-12)
    between = np.degrees(np.arctan2(found[:, 1], found[:, 0])) % 360
    assert between == pytest.approx([306.0, 18.0, 90.0, 162.0, 234.0])
