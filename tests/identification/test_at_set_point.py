"""Displacement and force of every run without what its instruments and its load have done to them."""

import numpy as np
import pytest

from tests.estimate.block_cases import Case, drawn_turning, made, solved
from tests.phasors.phasor_cases import FILM_H
from tpjb_ident.estimate.equation import vector
from tpjb_ident.identification.campaign_solution import at_set_point
from tpjb_ident.terms.mains import Pickup, fit_mains

CASES = {
    "misses": Case(noise=0.0, miss=(0.01, 0.0)),
    "turned": Case(noise=1e-5, directions=6, miss=(0.01, 0.01), turning=drawn_turning(np.random.default_rng(2))),
    "third probe": Case(
        noise=1e-5, probes=3, gains={"D1": 0.02}, stated={"D1": {"uncertainty": 0.05}, "D2": {"uncertainty": 1e-5}}
    ),
    "late": Case(
        noise=1e-5,
        hertz=(30.0, 90.0),
        late={"force": 3e-4},
        stated={"force": {"delay_uncertainty": 3e-4}},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_runs_brought_to_their_set_points_obey_h(name):
    rig, blocks, truth = made(CASES[name])
    solution = solved(rig, blocks, truth)
    D, F = at_set_point(solution)
    raw = vector(rig, blocks, "force") + rig.mass * vector(rig, blocks, "acceleration")
    off = misfit(truth[blocks.point], D, F)
    assert off < 2e-3
    assert off < 0.5 * misfit(truth[blocks.point], vector(rig, blocks, "displacement"), raw)


def misfit(h, D, F):
    """Median of what h leaves of the force."""
    left = F - np.einsum("nij,nj->ni", h, D)
    return np.median(np.linalg.norm(left, axis=1) / np.linalg.norm(F, axis=1))


def test_mains_that_is_found_there_is_what_struck_the_probes():
    """Six runs of one point, one pick-up of unknown phase a run: H and its phases together, from cleaned readings."""
    rig, blocks, truth = made(Case(noise=0.0, loads=(5000.0,), directions=6))
    assert truth.shape[1:] == FILM_H.shape
    D, F = at_set_point(solved(rig, blocks, truth))
    rng = np.random.default_rng(4)
    pattern = 0.03 * np.median(np.abs(D)) * np.array([[1.0, 0.4 - 0.3j]])
    vectors = np.exp(2j * np.pi * rng.random((6, 1))) * pattern
    fit = fit_mains(D + vectors, F, Pickup(pattern, np.abs(pattern[0]), 9), 1e-3)
    np.testing.assert_allclose(fit.pickup, vectors, atol=1e-3 * np.abs(pattern).max())
