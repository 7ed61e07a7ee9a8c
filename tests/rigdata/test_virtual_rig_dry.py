"""Dry pivot tests and clearance sweeps: load histories, deflection, friction, contact, the polygon."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rigdata import virtual_rig as vr
from rigdata.virtual_rig.motion import held_back, load_history, swept_position

HERTZ = 1.4e-8


def hertzian(pad: int, load: np.ndarray) -> np.ndarray:
    return (1 + 0.1 * pad) * HERTZ * load ** (2 / 3)


TRUTH = replace(
    vr.RigTruth.constant(np.diag([2e8, 4e8]), np.diag([4e5, 6e5])),
    pivot_deflection=hertzian,
    clearance=(80e-6, 84e-6, 78e-6, 81e-6, 80e-6),
)


def dry_record(test: vr.DryTest, flaws: vr.DryImperfections | None = None, seed: int = 1):
    noise = replace(vr.Noise.none(), dry=flaws or vr.DryImperfections())
    rig = vr.VirtualRig(TRUTH, vr.RigPlan(dry=(test,)), vr.Instruments.like_paper(), noise, seed=seed)
    record = rig.simulate(f"p-{test.pad}-{test.branch}")
    motion, time = record.motion, record.motion.time
    angle = TRUTH.pivot_angles[test.pad - 1]
    frame = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return time, motion.at("force", time) @ frame, motion.at("displacement", time) @ frame, record.motion.facts


def test_default_steps_are_those_of_the_samples():
    time, load = load_history(vr.DryTest(1), 500.0)
    assert len(time) == 6500
    assert load[0] == 250.0
    for step in range(10):
        hold = load[(time > 1.3 * step + 0.31) & (time < 1.3 * step + 1.29)]
        np.testing.assert_allclose(hold, 500.0 * (step + 1))


def test_down_and_cycle_branches():
    _, down = load_history(vr.DryTest(1, levels=(500.0, 1000.0, 2000.0), branch="down"), 500.0)
    assert (down[0], down[-1] < 300.0) == (2000.0, True)
    assert np.all(np.diff(down) <= 0)
    _, cycle = load_history(vr.DryTest(1, levels=(500.0, 1000.0, 2000.0), branch="cycle"), 500.0)
    top = np.argmax(cycle)
    assert np.all(np.diff(cycle[: top + 1]) >= 0)
    assert np.all(np.diff(cycle[top:]) <= 0)
    for level in (500.0, 1000.0):
        assert np.sum(cycle == level) == pytest.approx(2 * 500, abs=3)
    assert np.sum(cycle == 2000.0) == pytest.approx(500, abs=2)


def test_unequal_holds_overshoot_and_leakage():
    test = vr.DryTest(1, levels=(500.0, 1000.0), hold=(0.5, 2.0), ramp=0.1, overshoot=0.1, load_drift=-0.01)
    time, load = load_history(test, 1000.0)
    assert time[-1] == pytest.approx(0.1 + 0.5 + 0.1 + 2.0, abs=2e-3)
    assert load[np.searchsorted(time, 0.1 + 1e-6)] == pytest.approx(500.0 + 25.0, rel=2e-3)
    late = (time > 1.7) & (time < 2.69)
    since = time[late] - 0.7
    np.testing.assert_allclose(load[late], 1000 * (1 - 0.01 * since) + 50 * np.exp(-since / 0.1), rtol=1e-6)


def test_a_perfect_dry_test_is_clearance_plus_deflection():
    for pad in (1, 3):
        _, load, position, _ = dry_record(vr.DryTest(pad))
        np.testing.assert_allclose(position[:, 0], TRUTH.clearance[pad - 1] + hertzian(pad, load[:, 0]), rtol=1e-12)
        np.testing.assert_allclose(position[:, 1], 0.0, atol=1e-18)
        np.testing.assert_allclose(load[:, 1], 0.0, atol=1e-9)


def test_load_off_direction_and_shaft_moving_sideways():
    flaws = vr.DryImperfections(direction=(math.radians(1), math.radians(2)), side=(0.08, 0.22))
    angles, shares = [], []
    for seed in range(40):
        _, load, position, facts = dry_record(vr.DryTest(2, levels=(500.0, 4000.0)), flaws, seed)
        angle = np.arctan2(load[-1, 1], load[-1, 0])
        share = np.ptp(position[:, 1]) / np.ptp(position[:, 0])
        assert math.degrees(angle) == pytest.approx(facts["load_direction_error_deg"])
        assert share == pytest.approx(abs(facts["side_share"]))
        # the pivot carries the component toward it
        assert position[-1, 0] == pytest.approx(TRUTH.clearance[1] + hertzian(2, load[-1, 0]), rel=1e-9)
        angles.append(math.degrees(angle))
        shares.append(facts["side_share"])
    assert min(np.abs(angles)) >= 1.0
    assert max(np.abs(angles)) <= 2.0
    assert min(angles) < 0 < max(angles)
    assert min(np.abs(shares)) >= 0.08
    assert max(np.abs(shares)) <= 0.22


def test_friction_holds_back_going_up_and_keeps_on_going_down():
    test = vr.DryTest(1, branch="cycle")
    _, load, position, _ = dry_record(test, vr.DryImperfections(friction=0.02))
    top = np.argmax(load[:, 0])
    for level in (1000.0, 3000.0):
        up = position[:top][np.isclose(load[:top, 0], level), 0][-1]
        down = position[top:][np.isclose(load[top:, 0], level), 0][-1]
        assert up - TRUTH.clearance[0] == pytest.approx(hertzian(1, 0.98 * level), rel=1e-9)
        assert down - TRUTH.clearance[0] == pytest.approx(hertzian(1, 1.02 * level), rel=1e-9)


def test_friction_waits_on_reversal():
    load = np.concatenate([np.linspace(0, 1000, 101), np.linspace(1000, 900, 101)[1:]])
    felt = held_back(load, 0.02)
    assert felt[100] == pytest.approx(980.0)
    # nothing moves until 1.02 F has come down to 980 N
    waiting = (np.arange(len(load)) > 100) & (load * 1.02 > 980.0)
    np.testing.assert_allclose(felt[waiting], 980.0)
    assert felt[-1] == pytest.approx(1.02 * 900.0)
    np.testing.assert_array_equal(held_back(load, 0.0), load)


def test_contact_is_missing_on_upper_pads_only():
    flaws = vr.DryImperfections(contact_gap=(3e-6, 3e-6), contact_load=500.0)
    for pad, upper in ((1, False), (2, False), (3, True), (4, True), (5, False)):
        _, load, position, facts = dry_record(vr.DryTest(pad), flaws)
        gap = position[:, 0] - TRUTH.clearance[pad - 1] - hertzian(pad, load[:, 0])
        expected = -3e-6 * np.exp(-load[:, 0] / 500.0) if upper else np.zeros(len(load))
        np.testing.assert_allclose(gap, expected, atol=1e-15)
        assert (facts["contact_gap_m"] > 0) == upper


def swept(truth: vr.RigTruth, push: float = 200.0, lag: float = math.radians(5)) -> tuple[np.ndarray, np.ndarray]:
    direction = np.linspace(0.0, 2 * np.pi, 7201)
    return direction, swept_position(truth, push, direction, lag)


def test_rigid_pivots_give_the_polygon_of_the_clearances():
    rigid = replace(TRUTH, pivot_deflection=lambda pad, load: 0 * load)
    _, position = swept(rigid)
    angles = np.array(rigid.pivot_angles)
    reach = position @ np.stack([np.cos(angles), np.sin(angles)])
    assert np.all(reach <= np.array(rigid.clearance) + 1e-15)
    # at every moment the shaft touches a pad, and in the end all of them and all corners
    assert np.max(np.min(np.array(rigid.clearance) - reach, axis=1)) < 1e-13
    np.testing.assert_allclose(reach.max(axis=0), rigid.clearance, rtol=1e-12)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for k, clearance in enumerate(rigid.clearance):
        after = (k + 1) % len(angles)
        corner = np.linalg.solve(normals[[k, after]], [clearance, rigid.clearance[after]])
        assert np.min(np.linalg.norm(position - corner, axis=1)) < 1e-9


def test_a_pad_out_of_reach_has_no_side():
    truth = replace(TRUTH, clearance=(80e-6, 80e-6, 300e-6, 80e-6, 80e-6), pivot_deflection=lambda pad, load: 0 * load)
    _, position = swept(truth)
    angle = truth.pivot_angles[2]
    assert (position @ [math.cos(angle), math.sin(angle)]).max() < 300e-6


def test_sweep_goes_once_around_with_its_push():
    rig = vr.VirtualRig(
        TRUTH, vr.RigPlan(clearance=(vr.ClearanceSweep(push=150.0, seconds=4.0),)), noise=vr.Noise.none()
    )
    record = rig.simulate("c-1")
    columns = record.readings.columns
    force = np.stack([columns["L1H"], columns["L1V"]]) / rig.instruments.named("L1H").scale
    np.testing.assert_allclose(np.hypot(*force), 150.0, rtol=1e-9)
    turned = np.unwrap(np.arctan2(force[1], force[0]))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi * 1999 / 2000)
    assert np.ptp(columns["A1H"]) == 0.0
    assert columns["K1"][0] == 0.0
