"""Instrument errors: their canonical meaning, and the stiffness that the records then show."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rigdata import virtual_rig as vr
from rigdata.virtual_rig.campaign import apparent_stiffness, campaign_truth
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K

OMEGA = 2 * np.pi * 40.0
H = K + 1j * OMEGA * C
RIGID = replace(vr.Instruments.like_paper(), cell_stiffness=(math.inf, math.inf))


def seen_in_records(instruments: vr.Instruments) -> np.ndarray:
    """Dynamic stiffness by calibrating the readings as stated: nothing of the generator's own algebra."""
    plan = vr.RigPlan(dynamic=vr.operating_points([(5000.0, 40.0)]), directions=(0.2, 1.4))
    rig = vr.VirtualRig(vr.RigTruth.constant(K, C), plan, instruments, vr.Noise.none(), seed=8)
    columns = {"displacement": [], "force": [], "acceleration": []}
    for run in rig.runs:
        readings = rig.simulate(run.id).readings
        time = readings.time
        design = np.stack([np.ones(len(time)), np.cos(OMEGA * time), np.sin(OMEGA * time)], axis=1)
        for quantity, list_ in columns.items():
            axes, phasors = [], []
            for sensor in instruments.of(quantity):
                value = sensor.polarity * readings.columns[sensor.name] / sensor.scale
                fit = np.linalg.lstsq(design, value, rcond=None)[0]
                phasors.append(fit[1] - 1j * fit[2])
                axes.append([math.cos(sensor.axis), math.sin(sensor.axis)])
            list_.append(np.linalg.solve(np.array(axes), phasors))
    d, f, a = (np.array(columns[q]) for q in ("displacement", "force", "acceleration"))
    return np.linalg.solve(d, f + instruments.housing_mass * a).T


@pytest.mark.parametrize(
    "errors",
    [
        {},
        {"probe_gain": 1.03},
        {"probe_rotation": 0.05},
        {"loadcell_gain": 0.98},
        {"loadcell_crosstalk": 0.04},
        {"channel_delay": 150e-6},
        {"housing_mass": 12.0},
        {"probe_gain": 0.97, "probe_rotation": -0.03, "loadcell_crosstalk": 0.02, "housing_mass": -8.0},
    ],
    ids=lambda e: "-".join(e) or "none",
)
def test_apparent_stiffness_is_what_the_records_show(errors):
    instruments = vr.Instruments.like_paper(seed=1).with_errors(**errors)
    np.testing.assert_allclose(seen_in_records(instruments), apparent_stiffness(H, OMEGA, instruments), rtol=1e-8)


# What each effect must do by its definition in physics.md, worked out by hand (rigid cells: no housing motion).
TURN = np.array([[math.cos(0.05), math.sin(0.05)], [-math.sin(0.05), math.cos(0.05)]])
BY_HAND = {
    "probe_gain": (1.03, H / 1.03),
    "probe_rotation": (0.05, H @ TURN.T),
    "loadcell_gain": (0.98, 0.98 * H),
    "loadcell_crosstalk": (0.04, np.array([[1.0, 0.04], [0.04, 1.0]]) @ H),
    "channel_delay": (150e-6, H * np.exp(1j * OMEGA * 150e-6)),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_each_effect_means_what_physics_md_says(name):
    size, expected = BY_HAND[name]
    instruments = RIGID.with_errors(**{name: size})
    np.testing.assert_allclose(apparent_stiffness(H, OMEGA, instruments), expected, rtol=1e-10, atol=1.0)


@pytest.mark.parametrize("error", [0.0, 12.0])
def test_housing_mass_error_takes_its_inertia_out_of_the_force(error):
    """F_cell + stated mass a_h = F_oil - error a_h, with a_h = -omega^2 F_oil / (k - m omega^2)."""
    instruments = vr.Instruments.like_paper().with_errors(housing_mass=error)
    share = error * OMEGA**2 / (np.array([4e8, 6e8]) - (30.0 + error) * OMEGA**2)
    np.testing.assert_allclose(apparent_stiffness(H, OMEGA, instruments), (1 + share)[:, None] * H, rtol=1e-12)


def test_cell_gain_shows_in_the_mean_force_and_probe_gain_in_the_position():
    plan = vr.RigPlan(locus=vr.locus_points(1))
    truth = vr.RigTruth.constant(K, C)
    instruments = RIGID.with_errors(loadcell_gain=1.02, probe_gain=1.05)
    columns = vr.VirtualRig(truth, plan, instruments, vr.Noise.none()).simulate("l-05000-01").readings.columns
    assert columns["L1V"].mean() / instruments.named("L1V").scale == pytest.approx(-5100.0)
    x, y = truth.position(plan.locus[0])
    probe = instruments.named("X1A")
    along = (probe.zero - columns["X1A"].mean()) / probe.scale
    assert along == pytest.approx(1.05 * (x + y) / math.sqrt(2), rel=1e-9)


def test_truth_holds_the_apparent_coefficients_and_the_gap_voltages():
    instruments = vr.Instruments.like_paper(seed=5).with_errors(probe_gain=1.1)
    plan = vr.RigPlan(dynamic=vr.operating_points([(5000.0, 40.0)]))
    truth = campaign_truth(vr.VirtualRig(vr.RigTruth.constant(K, C), plan, instruments), {})
    point = truth["points"][0]
    np.testing.assert_allclose(point["K"], K)
    np.testing.assert_allclose(point["C"], C)
    np.testing.assert_allclose(point["K_apparent"], K / 1.1)
    assert truth["gap_voltage_V"] == {s.name: s.zero for s in instruments.of("displacement")}
