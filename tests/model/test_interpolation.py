"""Monotone cubics against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator, PPoly

from model.interpolation import monotone_cubics


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3, 9])
def test_cubics_are_those_of_scipy(seed, count):
    rng = np.random.default_rng(seed)
    x, y = np.sort(rng.normal(size=count)), rng.normal(size=(count, 3))
    y[:, 1] = np.sort(y[:, 1])
    y[count // 2 :, 2] = 0.5
    theirs, at = PchipInterpolator(x, y), np.linspace(x[0], x[-1], 50)
    np.testing.assert_allclose(PPoly(monotone_cubics(x, y), x)(at), theirs(at), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(monotone_cubics(x, y[:, 1]), PchipInterpolator(x, y[:, 1]).c, rtol=1e-9, atol=1e-12)
