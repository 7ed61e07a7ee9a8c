"""Monotone cubics and bracketed roots against scipy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from model.interpolation import bracketed_root, evaluated, monotone_cubics


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3, 9])
def test_cubics_are_those_of_scipy(seed, count):
    rng = np.random.default_rng(seed)
    x, y = np.sort(rng.normal(size=count)), rng.normal(size=(count, 3))
    y[:, 1] = np.sort(y[:, 1])
    y[count // 2 :, 2] = 0.5
    theirs, at = PchipInterpolator(x, y), np.linspace(x[0], x[-1], 50)
    np.testing.assert_allclose(evaluated(x, monotone_cubics(x, y), at), theirs(at), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(monotone_cubics(x, y[:, 1]), PchipInterpolator(x, y[:, 1]).c, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "function", [math.cos, lambda x: x**3 - 2.0, lambda x: math.exp(5 * x) - 40.0, lambda x: x - 0.1,
                 lambda x: math.inf if x > 1.5 else x - 0.7]
)  # fmt: skip
def test_roots_are_those_of_scipy(function):
    theirs = brentq(lambda x: min(function(x), 1e9), 0.0, 2.0, xtol=1e-12)
    assert bracketed_root(function, 0.0, 2.0, 1e-9) == pytest.approx(theirs, abs=1e-8)


def test_no_change_of_sign_is_no_root():
    with pytest.raises(ValueError, match="no change of sign"):
        bracketed_root(lambda x: 1.0 + x, 0.0, 2.0, 1e-6)
