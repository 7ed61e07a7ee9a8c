"""Two or more directions into X and Y."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata.calibration import Channel
from rigdata.vector import vector_rows


def solve(axes, *samples, **calibration):
    """X and Y (n, 2) of samples, one reading per axis each."""
    channels = [Channel(f"C{i}", "displacement", axis=axis, **calibration) for i, axis in enumerate(axes)]
    return vector_rows(channels, list(np.array(samples, dtype=float).T)).T


@settings(max_examples=40, deadline=None)
@given(st.floats(-7, 7), st.floats(0.1, 3.0), st.floats(-1, 1), st.floats(-1, 1))
def test_any_two_angles(first, between, x, y):
    axes = np.array([first, first + between])
    readings = np.cos(axes) * x + np.sin(axes) * y
    assert solve(axes, readings)[0] == pytest.approx([x, y], abs=1e-9)
    calibrated = solve(axes, -(readings - 0.5) / 2.0, gain=2.0, polarity=-1, zero=0.5)
    assert calibrated[0] == pytest.approx([x, y], abs=1e-9)


def test_three_directions_least_squares():
    axes = np.radians([0.0, 60.0, 120.0])
    readings = np.array([1.0, 1.0, 0.5])
    expected = np.linalg.lstsq(np.stack([np.cos(axes), np.sin(axes)], 1), readings, rcond=None)[0]
    assert solve(axes, readings)[0] == pytest.approx(expected)


def test_missing_values_and_overflows():
    nan = np.nan
    samples = [[1.0, 2.0, nan], [1.0, -9.9e37, np.sqrt(2.0)], [1.0, nan, nan], [nan, 1e99, np.inf]]
    solved = solve(np.radians([0.0, 90.0, 45.0]), *samples)
    assert solved[0] == pytest.approx([1.0, 2.0])
    assert solved[1] == pytest.approx([1.0, 1.0])
    assert np.isnan(solved[2:]).all()


def test_collinear_gives_no_value():
    assert np.isnan(solve([0.0, np.pi], [1.0, -1.0])).all()
