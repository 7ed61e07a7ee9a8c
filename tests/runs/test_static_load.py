"""Loads that miss their set points, in size and in direction; what a rig carries without its bearing."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.phasors.phasor_cases import place
from tests.rigs import closed_form as cf
from tpjb_ident.estimate.equation import Rig, Sensor
from tpjb_ident.identification.identify import identify
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.run_jobs import dry_test
from tpjb_ident.runs.static_load import MAX_MISS, MAX_SIDEWAYS, StaticLoads, load_conditions, load_misses, static_loads


def loaded(ratios, load=5000.0, direction=-90.0):
    """A point whose cells read these multiples of the set point, as complex numbers (size, direction)."""
    force = load * np.exp(1j * math.radians(direction)) * np.asarray(ratios, dtype=complex)
    return SimpleNamespace(point=place(load, direction), mean_loads=force)


def test_misses_are_relative_to_what_all_runs_share():
    """A gain and a rotation of the cells move nothing."""
    scatter = np.array([0.01 + 0.003j, -0.01 - 0.003j, 0.01 - 0.003j, -0.01 + 0.003j])
    for common in (1.0, 1.3 * np.exp(0.1j), 0.55):
        points = [loaded(common * (1 + scatter)), loaded(common * (1 - scatter), 8000.0, 30.0)]
        (first, second), found = load_misses(points)
        assert found == pytest.approx(complex(common))
        np.testing.assert_allclose(first, scatter, atol=1e-12)
        np.testing.assert_allclose(second.real, -scatter.real, atol=1e-12)


def test_one_run_far_off_does_not_move_what_all_share():
    (miss,), common = load_misses([loaded([0.99, 1.01, 0.99, 1.01, 1.0, 1.06])])
    assert common == pytest.approx(1.0)
    np.testing.assert_allclose(miss.real, [-0.01, 0.01, -0.01, 0.01, 0.0, 0.06], atol=1e-12)
    (exact,), _ = load_misses([loaded([1.1, 1.1, 1.1, 1.6])])
    np.testing.assert_allclose(exact.real, [0.0, 0.0, 0.0, 0.5 / 1.1], atol=1e-12)


def test_of_two_groups_that_agree_the_one_at_the_set_points_is_common():
    scatter = 1 + 0.003 * np.array([1.0, -1.0, 0.5])
    (miss,), common = load_misses([loaded([*scatter, *(1.05 * scatter)])])
    assert common == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(miss.real, [0.0] * 3 + [0.05] * 3, atol=5e-3)


@pytest.mark.slow
def test_cells_that_read_otherwise_in_half_of_the_runs_are_in_the_interval(tmp_path):
    """A load that seems to miss its set point may as well be a gain of the cells: 4 % at +-1.5 % otherwise."""
    rig = cf.Rig(loads=(3000.0, 5000.0, 8000.0), frequencies=(25.0,), directions=(0.0, 30.0, 60.0, 90.0, 120.0, 150.0))
    cell = {"fault": lambda readings, rng, run: readings * (1.05 if run % 6 >= 3 else 1.0)}
    path = cf.write_rig(tmp_path, rig, cf.with_entries(cf.channels_of(rig), "L1V", **cell))
    for point in identify(load_campaign(path)).points:
        truth = cf.vector(rig.film.h(25.0, point.point.static_load))
        off = np.abs(point.stiffness.vector - truth)
        assert (off < 1.3 * point.stiffness.half_width()).all()
        assert (off[[0, 3]] < 0.02 * truth[[0, 3]]).all()


@pytest.mark.slow
def test_steps_of_a_converter_are_no_harmonics_of_the_film(tmp_path):
    """Of 12 bits over 20 V, half as large as the motion."""
    rig = cf.Rig(loads=(3000.0, 6000.0), seconds=2.4, unbalance=0.1)
    steps = {"fault": lambda readings, rng, run: np.round(readings / 6e-7) * 6e-7}
    path = cf.write_rig(tmp_path, rig, cf.with_entries(cf.channels_of(rig), "X1", **steps))
    for point in identify(load_campaign(path)).points:
        truth, half = (
            cf.vector(rig.film.h(point.point.excitation_hz, point.point.static_load)),
            point.stiffness.half_width(),
        )
        assert "film-not-linear" not in point.quality
        assert (np.abs(point.stiffness.vector - truth) < 2 * half).all()
        assert (half[[0, 3]] < 0.1 * truth[[0, 3]]).all()


@pytest.mark.parametrize("common", [0.45, 2.2, 1.0j, -0.3])
def test_cells_that_cannot_be_right_correct_nothing_but_are_told(common):
    (miss,), found = load_misses([loaded(common * np.array([0.98, 1.0, 1.02]))])
    np.testing.assert_array_equal(miss, 0.0)
    assert found == pytest.approx(common)


def test_runs_without_a_load_have_no_miss():
    idle = SimpleNamespace(point=place(0.0), mean_loads=np.full(3, 1 + 1j))
    (none,), common = load_misses([idle])
    assert common == 1.0
    np.testing.assert_array_equal(none.real, np.zeros(3))
    (beside, other), common = load_misses([idle, loaded([0.99, 1.01, np.nan])])
    assert common == pytest.approx(1.0)
    np.testing.assert_array_equal(beside.real, 0.0)
    np.testing.assert_allclose(other.real, [-0.01, 0.01, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("size", "sideways", "common", "named", "figure"),
    [
        (0.01, 0.01, 1.0, (), ""),
        (MAX_MISS, -MAX_SIDEWAYS, 1.005, (), ""),
        (-0.061, 0.0, 1.0, ("static-load-off",), "6.1 %"),
        (0.0, -0.06, 1.0, ("static-load-turned",), "3.4 deg"),
        (0.0, 0.0, 1.02 * np.exp(0.04j), ("cells-against-set-points",), "+2.00 %"),
        (0.0, 0.0, np.exp(-0.3j), ("static-load-turned",), "-17.2 deg"),
        (0.0, 0.0, 1.2 * np.exp(0.3j), ("static-load-turned", "cells-against-set-points"), "+17.2 deg"),
        (0.0, 0.0, 1.0j, ("cells-contradict-set-points",), "+90.0 deg"),
        (0.0, 0.0, -1.0, ("cells-contradict-set-points",), "+180.0 deg"),
        (0.0, 0.0, 0.98, ("cells-against-set-points",), "-2.00 %"),
        (0.0, 0.0, 1.399, ("cells-against-set-points",), "+39.90 %"),
        (0.0, 0.0, 0.69, ("cells-contradict-set-points",), "0.69 times"),
        (0.0, 0.0, -10.0, ("cells-contradict-set-points",), "10 times"),
    ],
)  # fmt: skip
def test_loads_that_are_off_by_more_than_scatter_are_named_with_their_figure(size, sideways, common, named, figure):
    miss = np.array([1j * sideways, size])
    found = load_conditions(miss, complex(common))
    assert found == named
    assert figure in "".join(c.detail for c in found)
    assert load_conditions(np.zeros(0, complex), 1.0 + 0j) == ()


@pytest.mark.parametrize(
    ("common", "gain", "turn"),
    [
        (1.005 * np.exp(0.04j), 0.003, 0.0),
        (1.04, np.log(1.04) / 1.6, 0.0),
        (1 / 1.04, np.log(1.04) / 1.6, 0.0),
        (np.exp(-0.09j), 0.003, 0.09 / 1.6),
        (np.exp(0.35j), (1 - np.cos(0.35)) / 1.6, 0.35 / 1.6),
        (0.0, 0.003, 0.0),
    ],
)  # fmt: skip
def test_cells_are_as_uncertain_as_all_set_points_differ_from_them(common, gain, turn):
    """Cells or actuators: one of them is wrong, and the records do not tell which."""
    sensors = (
        Sensor("X1A", "displacement", uncertainty=0.005),
        Sensor("L1H", "force", uncertainty=0.003),
        Sensor("L1V", "force", uncertainty=0.2),
    )
    probe, cell, stated = StaticLoads([], complex(common)).doubted(Rig(sensors, 30.0)).channels
    assert probe == sensors[0]
    assert cell.uncertainty == pytest.approx(gain)
    assert cell.axis_uncertainty == pytest.approx(turn)
    assert stated.uncertainty == 0.2


CARRIED = (4e7, 6e7)
RIG = cf.Rig(beside=CARRIED, frequencies=(25.0,), directions=(0.0, 60.0, 120.0), seconds=2.0)


def dry_campaign(folder, **changes):
    channels = cf.with_entries(cf.channels_of(RIG), "L1H", **changes)
    return dry_test(load_campaign(cf.write_rig(folder, RIG, channels)), PhasorSettings(), "mm-eiv")


def test_a_dry_test_says_what_the_rig_carries(tmp_path):
    found = dry_campaign(tmp_path)
    assert not found.conditions
    np.testing.assert_allclose(np.diag(found.stiffness.h[0]).real, CARRIED, rtol=0.02)


def test_a_dry_test_with_a_clipped_cell_is_refused(tmp_path):
    with pytest.raises(RigDataError, match=r"channel L1H.*clipped"):
        dry_campaign(tmp_path, fault=lambda values, *_: np.minimum(values, 0.6 * values.max() + 0.4 * values.mean()))


def test_stingers_of_a_floating_stator_tell_neither_loads_nor_a_zero():
    campaign = SimpleNamespace(mount="floating", channels={})
    points = [loaded(np.full(4, 300.0 / load) + 0j, load) for load in (2000.0, 5000.0)]
    loads = static_loads(campaign, points)
    assert loads.conditions(0) == ("no-static-force",)
    assert [miss.tolist() for miss in loads.misses] == [[0.0] * 4] * 2
    stands = static_loads(SimpleNamespace(mount="cells", channels={}), points)
    assert "cells-not-tared" in stands.conditions(0)
    alone = static_loads(SimpleNamespace(mount=None, channels={}), points[1:])
    assert alone.conditions(0) == ("cells-contradict-set-points",)
    assert "floating" in alone.conditions(0)[0].detail
    little = [loaded(np.full(4, 0.01) + 0j, 5000.0)]
    assert static_loads(SimpleNamespace(mount=None, channels={}), little).conditions(0) == ("no-static-force",)
