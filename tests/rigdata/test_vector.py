"""Two or more directions into X and Y."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata.vector import solve_vector


@settings(max_examples=40, deadline=None)
@given(st.floats(-7, 7), st.floats(0.1, 3.0), st.floats(-1, 1), st.floats(-1, 1))
def test_any_two_angles(first, apart, x, y):
    axes = np.array([first, first + apart])
    readings = np.cos(axes) * x + np.sin(axes) * y
    assert solve_vector(axes, readings[None, :])[0] == pytest.approx([x, y], abs=1e-9)


def test_three_directions_least_squares():
    axes = np.radians([0.0, 60.0, 120.0])
    readings = np.array([1.0, 1.0, 0.5])
    expected = np.linalg.lstsq(np.stack([np.cos(axes), np.sin(axes)], 1), readings, rcond=None)[0]
    assert solve_vector(axes, readings[None, :])[0] == pytest.approx(expected)


def test_missing_values():
    axes = np.radians([0.0, 90.0, 45.0])
    values = np.array([[1.0, 2.0, np.nan], [1.0, np.nan, np.sqrt(2.0)], [1.0, np.nan, np.nan]])
    solved = solve_vector(axes, values)
    assert solved[0] == pytest.approx([1.0, 2.0])
    assert solved[1] == pytest.approx([1.0, 1.0])
    assert np.isnan(solved[2]).all()


def test_collinear_gives_no_value():
    assert np.isnan(solve_vector(np.array([0.0, np.pi]), np.array([[1.0, -1.0]]))).all()
