"""What a load that points aside does to coefficients and to positions, from phasors and loci made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.dynamic.phasor_cases import OMEGA, WINDOWS, run_phasors
from tpjb_ident.clearance.locus import Locus, LocusPoint
from tpjb_ident.diagnosis.observations.observe import moved_by_miss
from tpjb_ident.dynamic.corrections.load_direction import direction_slopes, run_ratios, turned_back
from tpjb_ident.dynamic.corrections.static_load import load_misses
from tpjb_ident.dynamic.estimators.estimate import estimate_dynamic_stiffness
from tpjb_ident.dynamic.runs.point_data import gather

#: Change of the cross-coupled coefficients per radian, relative to the direct ones.
SK, SC = -0.9, -0.3


def law(load: float, turn: float):
    k, c = 2.0e8 * (load / 5e3) ** 0.7, 8.0e7
    return np.array(
        [[0.85 * k + 1j * c, turn * (SK * k + 1j * SC * c)], [turn * (SK * k + 1j * SC * c), 1.15 * k + 1j * c]]
    )


def run(name, direction, load, turn, rng, noise):
    """A run whose load points `turn` [rad] aside."""
    spread = rng.standard_normal((WINDOWS, 4)) + 1j * rng.standard_normal((WINDOWS, 4))
    phase = np.exp(2j * np.pi * rng.random())
    F = 500.0 * phase * np.array([np.cos(direction), np.sin(direction)]) + noise * spread[:, :2]
    D = np.linalg.solve(law(load, turn), F.T).T + 1e-9 * noise * spread[:, 2:]
    return run_phasors(name, direction, load, D, F, load * np.array([np.sin(turn), -np.cos(turn)]))


def campaign(seed, turn=0.0035, loads=(2500.0, 3750.0, 5000.0, 6250.0, 7500.0, 8750.0), noise=0.1):
    rng = np.random.default_rng(seed)
    runs = [
        run(f"{load:g}-{i}", i * np.pi / 6, load, turn * rng.standard_normal(), rng, noise)
        for load in loads
        for i in range(6)
    ]
    points = gather(runs)
    misses, _ = load_misses(points)
    return points, misses, [estimate_dynamic_stiffness(p.D, p.F, OMEGA, p.run_index) for p in points]


def turns_of(points, misses, first):
    ratios = [run_ratios(*one) for one in zip(points, misses, first, strict=True)]
    return direction_slopes([(-90.0, 22.0)] * len(points), ratios)


@pytest.mark.slow
def test_what_its_own_uncertainty_leaves_covers_what_is_left():
    """Over many campaigns the error of H that a wrong slope makes is as large as `left` says."""
    z = []
    for seed in range(40):
        points, misses, first = campaign([7, seed], loads=(3000.0, 5000.0, 8000.0), noise=2.0)
        for p, miss, turn in zip(points, misses, turns_of(points, misses, first), strict=True):
            k, c = 2.0e8 * (p.point.static_load / 5e3) ** 0.7, 8.0e7
            true = np.array([[0, SK * k + 1j * SC * c], [SK * k + 1j * SC * c, 0]])
            shape = np.array([p.D[p.run_index == r].mean(axis=0) for r in range(6)])
            error = (turn.slope - true) @ (np.linalg.pinv(shape) @ (miss.sideways[:, None] * shape)).T
            z.append(np.concatenate([error.real.ravel(), error.imag.ravel()]) / np.sqrt(np.diag(turn.left)))
    spread = float(np.sqrt(np.mean(np.square(z))))
    assert 0.6 < spread < 1.3


def test_loads_that_point_where_they_should_change_nothing():
    points, misses, first = campaign(3, turn=0.0)
    for p, miss, turn in zip(points, misses, turns_of(points, misses, first), strict=True):
        assert np.abs(turned_back(p, miss, turn)).max() < 1e-6
        assert np.abs(turn.left).max() < 1.0


class _Known:
    """An identification that knows no point: load misses then move a position round only."""

    points = ()


def round_locus(angles, centre):
    points = []
    for a in angles:
        place = 60e-6 * np.array([math.cos(a + 0.3), math.sin(a + 0.3)]) + centre
        points.append(LocusPoint("r", OperatingPoint(5e3, a, 138.0, 0.0), 5e3, a, place, np.eye(2) * 1e-16))
    return Locus(tuple(points), np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("count", [20, 6, 4])
def test_a_round_locus_turns_with_the_load_wherever_its_centre(count):
    locus = round_locus(2 * np.pi * np.arange(count) / count, np.array([3e-4, -1e-4]))
    for p, moved in zip(locus.points, moved_by_miss(locus, _Known()), strict=True):
        a = p.point.static_load_direction + 0.3
        np.testing.assert_allclose(moved[:, 1], 60e-6 * np.array([-math.sin(a), math.cos(a)]), atol=1e-10)
        assert np.all(moved[:, 0] == 0.0)
