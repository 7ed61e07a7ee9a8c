"""Rising cubics against scipy's."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from model.interpolation import rising_cubics


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3, 9])
def test_cubics_are_those_of_scipy(seed, count):
    x, y = np.sort(np.random.default_rng(seed).normal(size=(2, count)), axis=1)
    np.testing.assert_allclose(rising_cubics(x, y), PchipInterpolator(x, y).c, rtol=1e-9, atol=1e-12)
