"""What the blocks say of the rig itself: whether the housing floats, and which devices have clocks of their own."""

from dataclasses import replace

import numpy as np
import pytest

from tests.estimate.block_cases import Case, made, solved
from tests.seeds import first_quick, seeds
from tpjb_ident.estimate.sensors import found_mount
from tpjb_ident.identification.campaign_solution import learnt_rig
from tpjb_ident.identification.clocks import with_found_devices

CASE = Case(hertz=(30.0, 60.0, 90.0))
START = 1e-4


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize("mount", ["cells", "floating"])
def test_accelerations_over_displacements_tell_the_mount(mount, seed):
    rig, blocks, _ = made(replace(CASE, mount=mount), seed)
    assert found_mount(rig.sensors, blocks, None, 0j) == mount
    assert found_mount(rig.sensors, blocks, None, 1.0) == mount
    other = {"cells": "floating", "floating": "cells"}[mount]
    assert found_mount(rig.sensors, blocks, other, 1.0) == other
    rig, blocks, _ = made(replace(CASE, mount=mount, shaft_gives=1.5e-9, gains={"A1": 0.1}), seed)
    assert found_mount(rig.sensors, blocks, None, 0j) == mount


@pytest.mark.parametrize(("ratio", "mount"), [(1.0, "cells"), (-0.9, "cells"), (0.01, "unknown"), (3.0, "unknown")])
def test_without_accelerometers_the_static_load_tells_it(ratio, mount):
    rig, blocks, _ = made(replace(CASE, accelerometers=False))
    assert found_mount(rig.sensors, blocks, None, complex(ratio)) == mount
    assert found_mount(rig.sensors, blocks.part(slice(0, 0)), None, complex(ratio)) == mount


def devices(sensors):
    return {sensor.quantity: sensor.device for sensor in sensors}


@pytest.mark.parametrize("ppm", [100.0, -300.0])
def test_a_clock_that_nobody_stated_is_found(ppm):
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-6 * ppm, "acceleration": 1e-6 * ppm}))
    found = devices(with_found_devices(rig.sensors, blocks, START)[0])
    assert found == {"displacement": "", "force": "cells", "acceleration": "cells"}
    alone, of_cells, _ = made(replace(CASE, rates={"force": 1e-6 * ppm}))
    found = devices(with_found_devices(alone.sensors, of_cells, START)[0])
    assert found == {"displacement": "", "force": "cells", "acceleration": ""}
    three, of_each, _ = made(replace(CASE, rates={"force": 1e-6 * ppm, "acceleration": -1e-6 * ppm}))
    found = devices(with_found_devices(three.sensors, of_each, START)[0])
    assert found == {"displacement": "", "force": "cells", "acceleration": "accelerometers"}


@pytest.mark.parametrize("seed", seeds(4))
def test_one_clock_is_one(seed):
    rig, blocks, _ = made(CASE, seed)
    assert with_found_devices(rig.sensors, blocks, START) == (rig.sensors, {})


@pytest.mark.parametrize("seed", seeds(4))
def test_a_beat_of_one_device_is_no_clock(seed):
    """A line 0.4 Hz beside the drive turns every run's cells otherwise, whatever the frequency."""
    rig, blocks, _ = made(CASE, seed)
    rng = np.random.default_rng(seed)
    slope = blocks.slope.copy()
    cells = rig.of("force")
    beat = 0.02 * 2 * np.pi * 0.4 * np.exp(2j * np.pi * rng.random((len(blocks), 1)))
    slope[:, cells] += 0.3 * beat * blocks.z[:, cells]
    assert with_found_devices(rig.sensors, replace(blocks, slope=slope), START) == (rig.sensors, {})


def test_stated_clocks_are_as_stated():
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-4}, stated={"displacement": {"device": "a"}}))
    assert with_found_devices(rig.sensors, blocks, START) == (rig.sensors, {})


def test_a_device_that_is_found_starts_late_by_what_nobody_states():
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-4}, stated={"acceleration": {"delay_uncertainty": 3e-3}}))
    sensors, rates = with_found_devices(rig.sensors, blocks, START)
    late = {s.name: s.delay_uncertainty for s in sensors}
    assert (late["D1"], late["F1"], late["A1"]) == (0.0, START, 3e-3)
    assert rates["cells"] == pytest.approx(1e-4, abs=1e-5)


@pytest.mark.parametrize(
    ("gain", "name"), first_quick((0.05, "probe-gains-differ"), (0.0, None), (0.5, "records-contradicted"))
)
def test_probes_that_differ_are_told_though_their_gains_are_taken_as_uncertain_as_that(gain, name):
    case = replace(CASE, probes=3, gains={"D1": gain}, stated={"displacement": {"uncertainty": 0.005}})
    rig, blocks, truth = made(case)
    learnt = learnt_rig(rig, solved(rig, blocks, truth))
    assert (learnt is rig) is (name is None)
    told = solved(learnt, blocks, truth).conditions()
    assert [str(condition) for condition in told] == ([] if name is None else [name])
    assert all("beyond the uncertainty stated of D1" in condition.detail for condition in told)
