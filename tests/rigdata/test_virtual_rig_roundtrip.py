"""What the virtual rig writes, read back by rigdata: with no noise the records are the physics."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

import rigdata
from rigdata import virtual_rig as vr
from rigdata.operating_point import OperatingPoint
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K
from tests.seeds import first_quick
from tpjb_ident.check.campaign import check_campaign

LAYOUTS = {"hdf5": 1e-9, "csv": 1e-6, "csv-german": 1e-6, "csv-tabbed": 1e-6, "csv-bare": 1e-6}


def small_plan() -> vr.RigPlan:
    return vr.RigPlan(
        dynamic=vr.operating_points([(5000.0, 25.0), (5000.0, 40.0)]),
        directions=(0.0, math.radians(75.0)),
        locus=vr.locus_points(3),
        dry=(vr.DryTest(1, levels=(500.0, 1500.0)), vr.DryTest(3, levels=(500.0,), branch="cycle")),
        clearance=(vr.ClearanceSweep(seconds=2.0),),
        dynamic_seconds=1.0,
        locus_seconds=0.5,
    )


def quiet_rig(**changes) -> vr.VirtualRig:
    rig = vr.VirtualRig(
        vr.RigTruth.constant(K, C), small_plan(), vr.Instruments.like_paper(seed=3), vr.Noise.none(), seed=5
    )
    return replace(rig, **changes)


def phasor(run, quantity, frequencies=None):
    """Phasor (2,) of a run's own line, where the record holds these lines [Hz]."""
    record = run.vector(quantity)
    frequencies = frequencies or [run.point.excitation_hz]
    turns = 2 * np.pi * np.outer(record.time, frequencies)
    design = np.hstack([np.ones((len(record), 1)), np.cos(turns), np.sin(turns)])
    fit = np.linalg.lstsq(design, record.values, rcond=None)[0]
    own = 1 + frequencies.index(run.point.excitation_hz)
    return fit[own] - 1j * fit[own + len(frequencies)]


def oil_force(run, frequencies=None):
    return phasor(run, "force", frequencies) + 30.0 * phasor(run, "acceleration", frequencies)


def fitted_stiffness(runs):
    d = np.array([phasor(run, "displacement") for run in runs])
    return np.linalg.solve(d, np.array([oil_force(run) for run in runs])).T


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_noise_free_records_give_back_the_stiffness(campaign_of, layout):
    runs = rigdata.load_campaign(campaign_of(quiet_rig(), layout)).of_kind("dynamic")
    for frequency in (25.0, 40.0):
        omega = 2 * np.pi * frequency
        pair = [run for run in runs if run.point.excitation_hz == frequency]
        np.testing.assert_allclose(fitted_stiffness(pair), K + 1j * omega * C, rtol=LAYOUTS[layout])


@pytest.mark.parametrize(
    "layout", first_quick("csv-tabbed", "hdf5", "csv", "csv-german", "csv-bare", "a whole campaign")
)
def test_the_check_finds_nothing_in_a_sound_campaign(campaign_of, layout):
    rig = quiet_rig(noise=vr.Noise.like_samples())
    if layout not in LAYOUTS:
        rig, layout = (
            vr.VirtualRig(vr.RigTruth.constant(K, C), vr.RigPlan.short(), vr.Instruments.like_paper(seed=2), seed=4),
            "hdf5",
        )
    assert check_campaign(campaign_of(rig, layout)) == []


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_means_temperatures_and_speed_come_back(campaign_of, layout):
    rig = quiet_rig(instruments=vr.Instruments.like_paper())
    run = rigdata.load_campaign(campaign_of(rig, layout)).of_kind("locus")[1]
    # the probes' zero is 0 V: the bearing centre stands at the gap voltage of 8 V
    centre = -8.0 / 7.78e-3 * 1e-6 * np.array([math.cos(math.pi / 4) + math.cos(3 * math.pi / 4), math.sqrt(2)])
    position = run.vector("displacement").values.mean(axis=0) - centre
    np.testing.assert_allclose(position, rig.truth.position(rig.plan.locus[1]), atol=1e-11)
    angle = run.point.static_load_direction
    force = run.vector("force").values.mean(axis=0)
    np.testing.assert_allclose(force, 5000.0 * np.array([math.cos(angle), math.sin(angle)]), atol=1e-3)
    assert [t.pad for t in run.temperatures()] == [1, 2, 3, 4, 5]
    np.testing.assert_allclose(run.record("T2").values, 273.15 + 47.5, atol=1e-6)
    np.testing.assert_allclose(run.record("K1").values, 2 * np.pi * 22.0, atol=1e-6)


def test_manifest_set_points_are_those_of_the_plan(campaign_of):
    rig = quiet_rig()
    campaign = rigdata.load_campaign(campaign_of(rig))
    for planned, found in zip(rig.runs, campaign.runs, strict=True):
        assert (planned.id, planned.kind) == (found.id, found.kind)
        if planned.test is None:
            want, have = planned.point, found.point
            assert have.static_load == pytest.approx(want.static_load, rel=1e-12)
            assert have.static_load_direction == pytest.approx(want.static_load_direction, abs=1e-10)
            assert have.shaft_speed == pytest.approx(want.shaft_speed, rel=1e-12)
            assert have.excitation == pytest.approx(want.excitation, rel=1e-12)
    dry = campaign.of_kind("dry_pivot")
    assert [(run.pad, run.branch) for run in dry] == [(1, "up"), (3, "cycle")]


def test_stiffness_is_asked_at_the_point_really_run():
    def stiffness(point: OperatingPoint):
        return K * (point.static_load / 5000.0) + 1j * point.excitation * C

    plan = replace(small_plan(), dynamic=vr.operating_points([(5000.0, 25.0)]), directions=(0.0,))
    truth = replace(vr.RigTruth.constant(K, C), stiffness=stiffness)
    noise = replace(vr.Noise.none(), load_miss=0.05)
    record = quiet_rig(truth=truth, plan=plan, noise=noise).simulate("d-05000-25-01")
    load = record.motion.facts["static_load_N"]
    assert abs(load / 5000 - 1) > 0.005
    line = record.motion.lines[0]
    h = stiffness(OperatingPoint(load, excitation=2 * np.pi * 25))
    np.testing.assert_allclose(h @ line.displacement, line.oil_force, rtol=1e-12, atol=1e-9)


def test_frequencies_can_share_a_record(campaign_of):
    rig = quiet_rig(plan=replace(small_plan(), joint_frequencies=True))
    for layout in ("hdf5", "csv"):
        campaign = rigdata.load_campaign(campaign_of(rig, layout))
        first, other = campaign.run("d-05000-25-01"), campaign.run("d-05000-40-01")
        np.testing.assert_array_equal(first.record("X1A").values, other.record("X1A").values)
        # each of two lines has 1/sqrt(2) of 10 % of 5 kN
        for run in (first, other):
            assert abs(oil_force(run, [25.0, 40.0])[0]) == pytest.approx(500.0 / math.sqrt(2), rel=1e-5)


def test_probes_at_other_angles_and_engineering_units(campaign_of):
    base = vr.Instruments.like_paper()
    probes = (
        vr.Sensor("DX", "displacement", "um", 1e6, math.radians(20.0), span=500.0),
        vr.Sensor.of_type("probe", "DY", axis=math.radians(80.0)),
    )
    rig = quiet_rig(instruments=replace(base, sensors=(*probes, *base.sensors[2:])))
    runs = rigdata.load_campaign(campaign_of(rig)).of_kind("dynamic")[:2]
    np.testing.assert_allclose(fitted_stiffness(runs), K + 1j * runs[0].point.excitation * C, rtol=1e-9)


@pytest.mark.slow
def test_a_campaign_like_the_papers_has_its_runs_and_is_quickly_made(tmp_path):
    rig = vr.VirtualRig(vr.RigTruth.constant(K, C), instruments=vr.Instruments.like_paper(seed=2), seed=4)
    done = []
    start = time.process_time()
    vr.write_campaign(tmp_path / "c.h5", rig, progress=lambda n, total, run: done.append((n, total, run)))
    assert time.process_time() - start < 5.0
    assert len(done) == 92
    assert done[-1] == (92, 92, "c-1")
    campaign = rigdata.load_campaign(tmp_path / "c.h5")
    assert [len(campaign.of_kind(k)) for k in ("dynamic", "locus", "dry_pivot", "clearance")] == [66, 20, 5, 1]
    points = {(r.point.static_load, r.point.excitation_hz) for r in campaign.of_kind("dynamic")}
    assert len(points) == 11
