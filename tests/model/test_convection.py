"""Operators interpolated over the convection of a pad's free faces are those of a solution for it."""

from dataclasses import replace

import numpy as np
import pytest

from model.pad.mesh import MeshDensity, PadGeometry
from model.pad.operators import LARGEST, pad_operators

COARSE = MeshDensity(2, 1, 3, 1)


@pytest.mark.slow
@pytest.mark.parametrize("even", [True, False])
def test_between_the_nodes(rocker, even, monkeypatch):
    monkeypatch.setenv("TPJB_CACHE", "off")  # what is stored may come from another number of threads: 1e-15
    geometry = PadGeometry.of(rocker.pads[0], rocker)
    asked = (0.0, 20.0, 50.0, 137.0, 500.0, 1500.0, 8000.0)
    for convection in asked:
        own = replace(geometry, back_convection=convection)
        exact, near = pad_operators(own, COARSE, even), pad_operators(own, COARSE, even, cooled=True)
        np.testing.assert_allclose(near.compliance, exact.compliance, rtol=1e-9, atol=1e-20)
        np.testing.assert_allclose(near.expansion, exact.expansion, atol=5e-6 * np.abs(exact.expansion).max())
        np.testing.assert_allclose(near.flux, exact.flux, atol=5e-5 * np.abs(exact.flux).max())
        if even:  # a film that is warmer all over: what it loses, small beside what goes from node to node
            lost, right = near.flux.sum(axis=1).mean(), exact.flux.sum(axis=1).mean()
            assert lost == pytest.approx(right, rel=5e-4, abs=1e-3)


def test_beyond_the_nodes_a_pad_is_solved_for_its_own(rocker):
    geometry = replace(PadGeometry.of(rocker.pads[0], rocker), back_convection=3.0 * LARGEST)
    exact = pad_operators(geometry, COARSE, True)
    np.testing.assert_array_equal(pad_operators(geometry, COARSE, cooled=True).flux, exact.flux)
