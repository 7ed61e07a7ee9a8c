"""What records say of the rig itself: mount, cells, clocks; readings of every run without what these did to them."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments, RigPlan, RigTruth, VirtualRig, operating_points, write_campaign
from tests.estimate.block_cases import Case, drawn_turning, made, solved
from tests.phasors.phasor_cases import FILM_H
from tests.rigs import closed_form as cf
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandRig, band_plans
from tests.seeds import first_quick, seeds
from tpjb_ident.conditions import untrusted
from tpjb_ident.estimate.equation import found_mount, vector
from tpjb_ident.identification.campaign_solution import CampaignSolution, at_set_point, with_found_devices
from tpjb_ident.identification.identify import identify
from tpjb_ident.terms.mains import Pickup, fit_mains
from tpjb_ident.terms.registry import learnt_rig

CASE = Case(hertz=(30.0, 60.0, 90.0))
START = 1e-4


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize("mount", ["cells", "floating"])
def test_accelerations_over_displacements_tell_the_mount(mount, seed):
    rig, blocks, _ = made(replace(CASE, mount=mount), seed)
    assert found_mount(rig, blocks, None, 0j) == mount
    assert found_mount(rig, blocks, None, 1.0) == mount
    other = {"cells": "floating", "floating": "cells"}[mount]
    assert found_mount(rig, blocks, other, 1.0) == other
    rig, blocks, _ = made(replace(CASE, mount=mount, shaft_gives=1.5e-9, gains={"A1": 0.1}), seed)
    assert found_mount(rig, blocks, None, 0j) == mount


@pytest.mark.parametrize(("ratio", "mount"), [(1.0, "cells"), (-0.9, "cells"), (0.01, "unknown"), (3.0, "unknown")])
def test_without_accelerometers_the_static_load_tells_it(ratio, mount):
    rig, blocks, _ = made(replace(CASE, accelerometers=0))
    assert found_mount(rig, blocks, None, complex(ratio)) == mount
    assert found_mount(rig, blocks.part(slice(0, 0)), None, complex(ratio)) == mount


def devices(sensors):
    return {sensor.quantity: sensor.clock for sensor in sensors}


@pytest.mark.parametrize("ppm", [100.0, -300.0])
def test_a_clock_that_nobody_stated_is_found(ppm):
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-6 * ppm, "acceleration": 1e-6 * ppm}))
    found = devices(with_found_devices(rig, blocks, START).channels)
    assert found == {"displacement": "", "force": "cells", "acceleration": "cells"}
    turning = replace(blocks, shaft=np.ones(len(blocks), complex))  # a line of the shaft beats with the drive
    assert with_found_devices(rig, turning, START) is rig
    alone, of_cells, _ = made(replace(CASE, rates={"force": 1e-6 * ppm}))
    found = devices(with_found_devices(alone, of_cells, START).channels)
    assert found == {"displacement": "", "force": "cells", "acceleration": ""}
    three, of_each, _ = made(replace(CASE, rates={"force": 1e-6 * ppm, "acceleration": -1e-6 * ppm}))
    found = devices(with_found_devices(three, of_each, START).channels)
    assert found == {"displacement": "", "force": "cells", "acceleration": "accelerometers"}


@pytest.mark.parametrize("seed", seeds(4))
def test_one_clock_is_one(seed):
    rig, blocks, _ = made(CASE, seed)
    assert with_found_devices(rig, blocks, START) is rig


@pytest.mark.parametrize("seed", seeds(4))
def test_a_beat_of_one_device_is_no_clock(seed):
    """A line 0.4 Hz beside the drive turns every run's cells otherwise, whatever the frequency."""
    rig, blocks, _ = made(CASE, seed)
    rng = np.random.default_rng(seed)
    slope = blocks.slope.copy()
    cells = rig.pick("force")
    beat = 0.02 * 2 * np.pi * 0.4 * np.exp(2j * np.pi * rng.random((len(blocks), 1)))
    slope[:, cells] += 0.3 * beat * blocks.z[:, cells]
    assert with_found_devices(rig, replace(blocks, slope=slope), START) is rig


def test_stated_clocks_are_as_stated():
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-4}, stated={"displacement": {"clock": "a"}}))
    assert with_found_devices(rig, blocks, START) is rig


def test_a_device_that_is_found_starts_late_by_what_nobody_states():
    rig, blocks, _ = made(replace(CASE, rates={"force": 1e-4}, stated={"acceleration": {"delay_uncertainty": 3e-3}}))
    found = with_found_devices(rig, blocks, START)
    late = {s.name: s.delay_uncertainty for s in found.channels}
    assert (late["D1"], late["F1"], late["A1"]) == (0.0, START, 3e-3)
    assert found.rates["cells"] == pytest.approx(1e-4, abs=1e-5)


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


CONTRADICT = {"accelerometers-contradict-cells"}


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [(4e8, 6e8), (1.5e9, 8e8)])
def test_cell_stiffness_is_read_from_the_records(tmp_path, stiffness):
    plan = RigPlan(dynamic=operating_points([(5000.0, 40.0)]))
    instruments = replace(Instruments.like_paper(5, 3), cell_stiffness=stiffness)
    truth = RigTruth.constant(k=np.diag([2e8, 4e8]), c=np.diag([4e5, 6e5]))
    write_campaign(tmp_path / "c.h5", VirtualRig(truth=truth, instruments=instruments, plan=plan, seed=3))
    found = identify(load_campaign(tmp_path / "c.h5")).cell_stiffness
    assert found == pytest.approx(stiffness, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["random", "multisine"])
def test_cell_stiffness_is_read_from_runs_over_a_band(tmp_path, kind):
    write_band_campaign(tmp_path / "band.h5", BandRig(kind=kind, seconds=8.0), band_plans(), seed=4)
    found = identify(load_campaign(tmp_path / "band.h5")).cell_stiffness
    assert found == pytest.approx((4e8, 6e8), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "named"),
    [({}, set()), ({"gain": -1.0}, CONTRADICT), ({"late": 3e-3}, CONTRADICT)],
    ids=["right", "inverted", "late"],
)
def test_a_foundation_with_a_resonance_is_a_support_and_wrong_accelerometers_are_none(tmp_path, wrong, named):
    """At 25, 40 and 55 Hz beside 44 Hz no one spring makes the accelerations of the cells' forces."""
    rig = cf.Rig(foundation=(2000.0, 1.5e8), frequencies=(25.0, 40.0, 55.0), seconds=2.0)
    result = identify(load_campaign(cf.write_rig(tmp_path, rig, cf.with_entries(cf.channels_of(rig), "A1", **wrong))))
    assert {str(flag) for point in result.points for flag in untrusted(point.quality)} == named
    assert wrong or result.cell_stiffness is None
    for point in result.points if not wrong else ():
        h = rig.film.h(np.array([point.point.excitation_hz]), 5000.0)[0].ravel()
        off = np.abs(point.stiffness.vector - np.concatenate([h.real, h.imag]))
        assert (off < 1.5 * point.stiffness.half_width()).all()


CASES = {
    "misses": Case(noise=0.0, miss=(0.01, 0.0)),
    "turned": Case(noise=1e-5, directions=6, miss=(0.01, 0.01), turning=drawn_turning(np.random.default_rng(2))),
    "third probe": Case(
        noise=1e-5, probes=3, gains={"D1": 0.02}, stated={"D1": {"uncertainty": 0.05}, "D2": {"uncertainty": 1e-5}}
    ),
    "late": Case(noise=1e-5, hertz=(30.0, 90.0), late={"force": 3e-4}, stated={"force": {"delay_uncertainty": 3e-4}}),
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


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize(("noise", "scatter"), [(0.06, 0.0), (0.02, 0.1)])
def test_runs_differ_by_what_their_noise_does_not_explain(noise, scatter, seed):
    rig, blocks, truth = made(Case(directions=24, noise=noise, scatter=scatter), seed)
    answer = CampaignSolution((), None, (), solved(rig, blocks, truth))
    differences = [answer.run_difference(p) for p in range(len(truth))]
    assert np.sqrt(np.mean(answer.misfits**2)) > 0.06
    if scatter:
        assert 0.08 < np.mean(differences) < 0.18
    else:
        assert max(differences) < 0.03
