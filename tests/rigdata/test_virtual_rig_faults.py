"""Faults strike the run and channel asked for and nothing else; instrument errors mean what they are called."""

import math
from dataclasses import replace

import numpy as np
import pytest

import rigdata
from rigdata import virtual_rig as vr
from rigdata.virtual_rig.campaign import apparent_stiffness, campaign_truth
from rigdata.virtual_rig.rig import KINDS
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K

FIRST, SECOND = "d-05000-25-01", "d-05000-25-02"


def rig(*faults: vr.Fault, noise: vr.Noise | None = None, seconds: float = 2.0) -> vr.VirtualRig:
    plan = vr.RigPlan(
        dynamic=vr.operating_points([(5000.0, 25.0)]),
        directions=(0.3, 1.5),
        dry=(vr.DryTest(2, levels=(500.0,)),),
        dynamic_seconds=seconds,
    )
    return vr.VirtualRig(
        vr.RigTruth.constant(K, C), plan, vr.Instruments.like_paper(), noise or vr.Noise.like_samples(), faults, seed=6
    )


def pair(*faults: vr.Fault, run: str = FIRST, noise: vr.Noise | None = None):
    """Columns with and without the faults."""
    return tuple(rig(*of, noise=noise).simulate(run).readings.columns for of in (faults, ()))


#: Fault of the first run, and its changed columns by what they are without it, one sample a millisecond.
CHANNEL_FAULTS = {
    "dead": (("X1A", 1.5), lambda v: {"X1A": np.full(2000, 1.5)}),
    "stuck": (("X1A", None, 1.0), lambda v: {"X1A": np.where(np.arange(2000) < 1000, v["X1A"], v["X1A"][1000])}),
    "inverted": (("X1A",), lambda v: {"X1A": 16.0 - v["X1A"]}),
    "nan_gap": (("X1A", None, 0.5, 0.1), lambda v: {"X1A": np.where(np.arange(2000) // 100 == 5, np.nan, v["X1A"])}),
    "glitch": (("X1A", 1e-5, 1.9, 0.05), lambda v: {"X1A": v["X1A"] - 7780.0 * 1e-5 * (np.arange(2000) // 50 == 38)}),
    "swapped": (("X1A", None, 0.0, np.inf, "X1B"), lambda v: {"X1A": v["X1B"], "X1B": v["X1A"]}),
    "scaled": (("L1V", 1.1), lambda v: {"L1V": 1.1 * v["L1V"]}),
    "offset": (("A1H", 0.5), lambda v: {"A1H": v["A1H"] + 0.5 * 0.01 / 9.80665}),
    "crosstalk": (("L1H", 0.1), lambda v: {"L1H": v["L1H"] + 0.1 * v["L1V"]}),
    "rotated": (("L1H", np.pi / 2), lambda v: {"L1H": v["L1V"]}),
}


@pytest.mark.parametrize("kind", CHANNEL_FAULTS)
def test_channel_faults_change_that_channel_of_that_run(kind):
    entries, expected = CHANNEL_FAULTS[kind]
    fault = vr.Fault(kind, FIRST, *entries)
    noise = None if fault.rule["place"] == "record" else vr.Noise.none()  # a sensor's error is there before its noise
    faulty, sound = pair(fault, noise=noise)
    changed = expected(sound)
    for name, values in sound.items():
        if name in changed:
            np.testing.assert_allclose(faulty[name], changed[name], rtol=1e-9, atol=1e-12)
        else:
            np.testing.assert_array_equal(faulty[name], values)
    other, untouched = pair(fault, run=SECOND, noise=noise)
    for name in changed:
        np.testing.assert_array_equal(other[name], untouched[name])


def test_every_spoiling_fault_is_tested_here():
    of_channels = {kind for kind, entry in KINDS.items() if entry["place"] in ("record", "sensor")}
    assert of_channels - set(CHANNEL_FAULTS) == {"clipped", "delayed", "time_gap", "time_jitter"}


def test_clipped_has_flat_tops_and_delayed_is_late():
    faulty, sound = pair(vr.Fault("clipped", FIRST, "L1H", value=0.5), noise=vr.Noise.none())
    assert np.ptp(faulty["L1H"]) == pytest.approx(0.5 * np.ptp(sound["L1H"]))
    assert np.sum(faulty["L1H"] == faulty["L1H"].max()) > 500
    faulty, sound = pair(vr.Fault("delayed", FIRST, "X1*", value=0.004), noise=vr.Noise.none())
    for name in ("X1A", "X1B"):
        np.testing.assert_allclose(faulty[name][4:], sound[name][:-4], rtol=1e-12)


def test_missing_excitation_leaves_the_mean_and_the_noise():
    faulty, sound = pair(vr.Fault("missing_excitation", FIRST), noise=vr.Noise.none())
    assert np.ptp(sound["L1H"]) > 0.4
    assert np.ptp(faulty["L1H"]) == 0.0
    np.testing.assert_allclose(faulty["L1V"][0], -5000 * 5e-4)


def test_duplicate_run_is_the_other_record():
    broken = rig(vr.Fault("duplicate_run", SECOND, other=FIRST))
    copied = broken.simulate(SECOND)
    assert (copied.run.id, copied.source) == (SECOND, FIRST)
    np.testing.assert_array_equal(copied.readings.columns["X1A"], rig().simulate(FIRST).readings.columns["X1A"])
    crossed = rig(vr.Fault("duplicate_run", SECOND, other=FIRST), vr.Fault("duplicate_run", FIRST, other=SECOND))
    assert [crossed.simulate(run.id).source for run in crossed.runs][:2] == [SECOND, FIRST]


def test_time_gap_takes_rows_out_of_all_channels_and_time_jitter_keeps_the_order():
    record = rig(vr.Fault("time_gap", FIRST, start=0.7, length=0.2)).simulate(FIRST).readings
    assert {len(v) for v in record.columns.values()} == {1800}
    assert np.max(np.diff(record.time)) == pytest.approx(0.201)
    time = rig(vr.Fault("time_jitter", FIRST, value=0.3)).simulate(FIRST).readings.time
    assert np.all(np.diff(time) > 0)
    assert np.std(time - np.arange(2000) / 1000) == pytest.approx(0.3e-3 * 0.85, rel=0.1)


def test_wrong_notes_are_in_the_manifest_only(campaign_of):
    faults = (
        vr.Fault("wrong_pad", "p-2-up", value=4),
        vr.Fault("wrong_direction", FIRST, value=np.pi / 2),
        vr.Fault("wrong_frequency", SECOND, value=5.0),
        vr.Fault("wrong_load", SECOND, value=2.0),
    )
    wrong, right = (rigdata.load_campaign(campaign_of(r)) for r in (rig(*faults, seconds=0.5), rig(seconds=0.5)))
    assert wrong.run("p-2-up").pad == 4
    assert wrong.run(FIRST).excitation_direction == pytest.approx(0.3 + np.pi / 2)
    assert wrong.run(SECOND).point.excitation_hz == 30.0
    assert wrong.run(SECOND).point.static_load == 10e3
    for name in (FIRST, SECOND, "p-2-up"):
        np.testing.assert_array_equal(wrong.run(name).record("X1A").values, right.run(name).record("X1A").values)


LAYOUTS = ["hdf5", *(vr.CsvLayout(missing=m, delimiter=";") for m in ("", "NaN", "-", "#N/A"))]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_missing_values_are_nan_in_every_layout(campaign_of, layout):
    fault = vr.Fault("nan_gap", FIRST, "X1A", start=0.5, length=0.1)
    values = rigdata.load_campaign(campaign_of(rig(fault, seconds=0.8), layout)).run(FIRST).record("X1A").values
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(500, 600))


@pytest.mark.parametrize(
    ("fault", "layout", "says"),
    [
        ({"kind": "swaped", "channel": "X1A", "other": "X1B"}, "", "Did you mean 'swapped'"),
        ({"kind": "dead"}, "", "needs channel"),
        ({"kind": "scaled", "channel": "X1A"}, "", "needs value"),
        ({"kind": "duplicate_run"}, "", "needs other"),
        ({"kind": "dead", "run": "d-9*", "channel": "X1A"}, "", "no run matches 'd-9"),
        ({"kind": "dead", "channel": "Q"}, "", "no channel matches 'Q'"),
        ({"kind": "swapped", "channel": "X1A", "other": "Q"}, "", "there is no 'Q'"),
        ({"kind": "truncated_line"}, "hdf5", "truncated_line"),
        ({"kind": "short_channel", "channel": "X1A"}, "csv", "short_channel"),
        ({"kind": "time_jitter"}, "csv-bare", "time_jitter"),
    ],
)
def test_faults_that_are_none_or_that_a_layout_cannot_show_are_refused(tmp_path, fault, layout, says):
    if layout:
        made = rig(vr.Fault(**{"run": FIRST, **fault}))
        with pytest.raises(vr.VirtualRigError, match=says):
            vr.write_campaign(tmp_path / "none", made, layout)
    else:
        with pytest.raises(vr.VirtualRigError, match=says):
            rig(vr.Fault(**{"run": FIRST, **fault}))
    assert list(tmp_path.iterdir()) == []


def test_the_truth_tells_all_faults(tmp_path):
    fault = vr.Fault("dead", FIRST, "X1A")
    truth = vr.write_campaign(tmp_path / "c.h5", rig(fault))
    assert truth["faults"] == [{"kind": "dead", "run": FIRST, "channel": "X1A", "start": 0.0}]
    assert all(entry["does"] for entry in KINDS.values())
    assert replace(fault, run="*").affects(SECOND)
    assert fault.is_in("X1A")
    assert not fault.is_in("X1B")


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
