"""Runs that lack what the solve needs: they cost themselves, at worst their point, never the campaign."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.identification.test_assemble import LOADS, found, law, run_at


def without_cells(run):
    return replace(run, z=np.where(np.arange(4) > 1, np.nan, run.z))


@pytest.fixture(scope="module")
def runs():
    rng = np.random.default_rng(1)
    return [run_at(f"{load:g}-{k}", k * math.pi / 5, load, 0.0, rng, noise=0.1) for load in LOADS for k in range(5)]


def test_without_any_run_that_has_all_channels_every_point_says_so(runs):
    for point in found([without_cells(run) for run in runs]).points:
        assert np.isnan(point.stiffness.h).all()
        assert {"fewer-than-two-directions", "run-without-data"} <= set(point.quality)


def test_a_point_without_cells_leaves_the_other_alone(runs):
    first, second = found([*runs[:5], *map(without_cells, runs[5:])]).points
    true = law(LOADS[0], 0.0)
    np.testing.assert_allclose(first.stiffness.h, true, atol=1e-4 * np.abs(true).max())
    assert first.quality == ("inertia-not-corrected",)
    assert np.isnan(second.stiffness.h).all()


def test_a_run_without_cells_costs_itself_only(runs):
    point, other = found([without_cells(runs[0]), *runs[1:]]).points
    true = law(LOADS[0], 0.0)
    np.testing.assert_allclose(point.stiffness.h, true, atol=1e-4 * np.abs(true).max())
    assert "run-without-data" in point.quality
    assert other.quality == ("inertia-not-corrected",)
