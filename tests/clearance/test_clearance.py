"""Clearance sweeps of the virtual rig: clearance per pad, centre, side angles, two push loads, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from rigdata.virtual_rig import (
    ClearanceSweep,
    DryTest,
    Fault,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    VirtualRig,
    write_campaign,
)
from tpjb_ident.clearance.measure import (
    clearance_change,
    coldest_run,
    measure_clearance,
    measure_run,
    pairs_frame,
    radial_stiffness,
)
from tpjb_ident.conditions import sentences
from tpjb_ident.pivot import fit_pivots

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
CLEARANCE = np.array([80.0, 80.0, 86.0, 80.0, 80.0]) * 1e-6


def sphere(pad, load):
    return 6e-8 * np.asarray(load, dtype=float) ** (2 / 3)


def made(path, **kwargs):
    """Write the campaign first, open it then."""
    truth = RigTruth.constant(
        np.diag([2e8, 4e8]),
        np.diag([4e5, 6e5]),
        pivot_deflection=sphere,
        clearance=kwargs.pop("clearance", tuple(CLEARANCE)),
    )
    rig = VirtualRig(
        truth,
        kwargs.pop("plan", RigPlan(clearance=(ClearanceSweep(),))),
        instruments=Instruments.like_paper(seed=4),
        noise=kwargs.pop("noise", Noise.like_samples()),
        seed=4,
        **kwargs,
    )
    truth_written = write_campaign(path, rig)
    return load_campaign(path), truth_written


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Campaign with dry tests and two sweeps, its truth, its curves."""
    plan = RigPlan(dry=tuple(DryTest(p) for p in range(1, 6)), clearance=(ClearanceSweep(), ClearanceSweep(push=800.0)))
    source, truth = made(tmp_path_factory.mktemp("clearance") / "c.h5", plan=plan)
    return source, truth, fit_pivots(source, ANGLES)


@pytest.fixture(scope="module")
def measured(whole):
    """Both sweeps, the lighter push first."""
    source, _, curves = whole
    return tuple(measure_run(run, ANGLES, curves) for run in source.of_kind("clearance"))


def bearing_centre(truth):
    """Reading of the bearing centre (2,) [m] from the gap voltages."""
    gaps = np.array([truth.gap_voltage_V["X1A"], truth.gap_voltage_V["X1B"]])
    axes = np.radians([45.0, 135.0])
    return np.linalg.solve(np.column_stack([np.cos(axes), np.sin(axes)]), -gaps / 7780.0)


def test_clearance_and_centre_with_one_pad_off(whole):
    source, truth, curves = whole
    found = measure_clearance(source, ANGLES, curves)
    assert found.push_load == pytest.approx(200.0, rel=0.02)
    assert found.clearance == pytest.approx(CLEARANCE, abs=0.3e-6)
    assert found.clearance_pushed == pytest.approx(CLEARANCE + sphere(1, 200.0), abs=0.3e-6)
    assert np.all(np.abs(found.centre - bearing_centre(truth)) < 4 * np.sqrt(np.diag(found.centre_covariance)))
    assert any(s.startswith("irregular: pad #3 +") for s in sentences(found.status))
    assert found.fitted_angle == pytest.approx(ANGLES, abs=2e-3)
    assert found.pivot_scale == pytest.approx(1.0, abs=0.08)
    frame = found.to_frame()
    needed = {"pad", "clearance_m", "clearance_m_se", "clearance_pushed_m", "clearance_pushed_m_se"}
    assert needed <= set(frame.columns)
    assert "µm (se)" in str(found)


def test_two_push_loads_give_the_radial_stiffness(measured):
    light, heavy = measured
    load, stiffness, _ = radial_stiffness(light, heavy)
    true = (heavy.push_load - light.push_load) / (sphere(1, heavy.push_load) - sphere(1, light.push_load))
    assert stiffness == pytest.approx(true, rel=0.15)
    assert load == pytest.approx(500.0, rel=0.02)
    with pytest.raises(ValueError, match="push loads must differ"):
        radial_stiffness(light, light)


def test_a_bearing_that_grew_shows_it_on_every_pad(whole, measured, tmp_path):
    _, _, curves = whole
    hot, _ = made(tmp_path / "hot.h5", clearance=tuple(CLEARANCE + 6e-6))
    cold, _ = measured
    hot = measure_clearance(hot, ANGLES, curves)
    change, change_se = clearance_change(cold, hot)
    assert np.mean(change) == pytest.approx(6e-6, abs=0.15e-6)
    assert change == pytest.approx(6e-6, abs=0.3e-6)
    assert np.all((change_se > 0.0) & (change_se < 0.4e-6))
    assert np.abs(hot.centre - cold.centre).max() < 1e-6
    with pytest.raises(ValueError, match="one bearing"):
        clearance_change(cold, replace(cold, angles=ANGLES + 0.1))


def test_sweeps_side_by_side(whole, measured):
    source, _, _ = whole
    light, heavy = measured
    assert coldest_run(source.of_kind("clearance")).id == light.run
    hot = replace(heavy, run="hot", temperature=light.temperature + 20.0, clearance=light.clearance + 5e-6)
    frame = pairs_frame(light, [heavy, hot])
    assert frame.groupby("compared")["run"].unique().map(list).to_dict() == {
        "push load": [heavy.run], "condition": ["hot"]}  # fmt: skip
    push, condition = frame[frame["run"] == heavy.run], frame[frame["run"] == "hot"]
    assert push["stiffness_N_per_m"].to_numpy() == pytest.approx(radial_stiffness(light, heavy)[1])
    assert condition["change_m"].to_numpy() == pytest.approx(5e-6)
    assert condition["stiffness_N_per_m"].isna().all()
    assert light.temperature == pytest.approx(273.15 + 24.0, abs=1.0)
    assert "irregular" in light.status


def test_the_cold_sweep_counts_however_small_the_hot_ones_push(whole):
    source, _, _ = whole
    light, heavy = source.of_kind("clearance")

    class Warm:
        id, point, channels = "warm", light.point, light.channels

        def record(self, name):
            record = light.record(name)
            return replace(record, values=record.values + 20.0)

    assert coldest_run([Warm(), heavy]).id == heavy.id
    assert coldest_run([Warm()]).id == "warm"


def test_the_push_below_the_dry_tests_is_marked_as_extrapolated(measured):
    light, _ = measured
    assert any(s == "give-extrapolated" and "all pads hold" in s.detail for s in light.status)


def test_a_turning_shafts_runout_averages_out(whole):
    """The sweep of a turning shaft: 1.1 um of runout on top, found again as on the shaft at rest."""
    source, _, curves = whole
    run = source.of_kind("clearance")[0]
    speed = 2 * np.pi * 22.0

    class Turning:
        id, file, kind, channels, sample_rate = "turning", run.file, "clearance", run.channels, run.sample_rate
        point = OperatingPoint(run.point.static_load, run.point.static_load_direction, speed)

        def record(self, name):
            return run.record(name)

        def vector(self, quantity):
            record = run.vector(quantity)
            if quantity == "displacement":
                turn = 1.0009 * speed * record.time  # the set point is missed by as much as on the samples
                record.values[:] += 1.1e-6 * np.column_stack([np.cos(turn), np.sin(turn)])
            return record

    still, turning = (measure_run(r, ANGLES, curves) for r in (run, Turning()))
    assert turning.clearance == pytest.approx(still.clearance, abs=0.1e-6)
    assert np.all(turning.clearance_se < 2 * still.clearance_se + 1e-8)


def test_without_curves_zero_load_is_extrapolated(whole):
    source, _, _ = whole
    found = measure_clearance(source, ANGLES)
    assert np.all(np.abs(found.clearance - CLEARANCE) < 4 * found.clearance_se)
    assert found.clearance == pytest.approx(CLEARANCE, abs=0.6e-6)
    assert "give-from-sweep" in found.status


def test_a_clean_sweep_is_measured_to_a_tenth_of_a_micrometre(tmp_path):
    source, truth = made(tmp_path / "c.h5", noise=Noise.none(), clearance=(80e-6,) * 5)
    found = measure_clearance(source, ANGLES)
    assert found.clearance == pytest.approx(80e-6, abs=0.2e-6)
    assert found.centre == pytest.approx(bearing_centre(truth), abs=0.05e-6)


FAULTS = {
    "probes exchanged": Fault("swapped", channel="X1A", other="X1B"),
    "cells exchanged": Fault("swapped", channel="L1H", other="L1V"),
    "probe reversed": Fault("inverted", channel="X1A"),
    "cell dead": Fault("dead", channel="L1V"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_sweep_that_is_none_is_refused(tmp_path, name):
    source, _ = made(tmp_path / "c.h5", faults=(FAULTS[name],))
    with pytest.raises(RigDataError, match=r"clearance run|stuck, clipped or dead"):
        measure_clearance(source, ANGLES)


def test_no_sweep_is_an_error(tmp_path):
    source, _ = made(tmp_path / "c.h5", plan=RigPlan(dry=(DryTest(1),)))
    with pytest.raises(RigDataError, match="no run of kind clearance"):
        measure_clearance(source, ANGLES)
