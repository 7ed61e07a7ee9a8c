"""Faults do what they say, to the run and channel asked for and to nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rigdata
from rigdata.virtual_rig import (
    CsvLayout,
    DryTest,
    Fault,
    Hdf5Layout,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    VirtualRig,
    VirtualRigError,
    operating_points,
    write_campaign,
)
from rigdata.virtual_rig.faults import KINDS
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K
from tpjb_ident.check.campaign import check_campaign

FIRST, SECOND = "d-05000-25-01", "d-05000-25-02"


def rig(*faults: Fault, noise: Noise | None = None, seconds: float = 2.0) -> VirtualRig:
    plan = RigPlan(
        dynamic=operating_points([(5000.0, 25.0)]),
        directions=(0.3, 1.5),
        dry=(DryTest(2, levels=(500.0,)),),
        dynamic_seconds=seconds,
    )
    return VirtualRig(
        RigTruth.constant(K, C), plan, Instruments.like_paper(), noise or Noise.like_samples(), faults, seed=6
    )


def pair(*faults: Fault, run: str = FIRST, noise: Noise | None = None):
    """Columns with and without the faults."""
    return (
        rig(*faults, noise=noise).simulate(run).readings.columns,
        rig(noise=noise).simulate(run).readings.columns,
    )


CHANNEL_FAULTS = {
    "dead": (Fault("dead", FIRST, "X1A", value=1.5), lambda v: np.full_like(v, 1.5)),
    "stuck": (Fault("stuck", FIRST, "X1A", start=1.0), lambda v: np.where(np.arange(2000) < 1000, v, v[1000])),
    "inverted": (Fault("inverted", FIRST, "X1A"), lambda v: 16.0 - v),
    "nan_gap": (
        Fault("nan_gap", FIRST, "X1A", start=0.5, length=0.1),
        lambda v: np.where((np.arange(2000) >= 500) & (np.arange(2000) < 600), np.nan, v),
    ),
    "glitch": (
        Fault("glitch", FIRST, "X1A", start=1.9, length=0.05, value=1e-5),
        lambda v: v - 7780.0 * 1e-5 * ((np.arange(2000) >= 1900) & (np.arange(2000) < 1950)),
    ),
}


@pytest.mark.parametrize("kind", CHANNEL_FAULTS)
def test_channel_faults_change_that_channel_of_that_run(kind):
    fault, expected = CHANNEL_FAULTS[kind]
    faulty, sound = pair(fault)
    np.testing.assert_allclose(faulty["X1A"], expected(sound["X1A"]), rtol=1e-12)
    for name in sound:
        if name != "X1A":
            np.testing.assert_array_equal(faulty[name], sound[name])
    other, untouched = pair(fault, run=SECOND)
    np.testing.assert_array_equal(other["X1A"], untouched["X1A"])


def test_every_spoiling_fault_is_tested_here():
    of_records = {kind for kind, (place, _, _) in KINDS.items() if place == "record"}
    assert of_records - {"swapped", "time_gap", "time_jitter"} == set(CHANNEL_FAULTS) | {"clipped"}


def test_clipped_has_flat_tops():
    faulty, sound = pair(Fault("clipped", FIRST, "L1H", value=0.5), noise=Noise.none())
    assert np.ptp(faulty["L1H"]) == pytest.approx(0.5 * np.ptp(sound["L1H"]))
    assert np.sum(faulty["L1H"] == faulty["L1H"].max()) > 500


def test_swapped_channels():
    faulty, sound = pair(Fault("swapped", FIRST, "X1A", other="X1B"))
    np.testing.assert_array_equal(faulty["X1A"], sound["X1B"])
    np.testing.assert_array_equal(faulty["X1B"], sound["X1A"])


def test_sensor_faults_are_errors_of_the_sensor():
    quiet = Noise.none()
    faulty, sound = pair(Fault("scaled", FIRST, "L1V", value=1.1), noise=quiet)
    np.testing.assert_allclose(faulty["L1V"], 1.1 * sound["L1V"], rtol=1e-12)
    faulty, sound = pair(Fault("delayed", FIRST, "X1*", value=0.004), noise=quiet)
    for name in ("X1A", "X1B"):
        np.testing.assert_allclose(faulty[name][4:], sound[name][:-4], rtol=1e-12)
    faulty, sound = pair(Fault("offset", FIRST, "A1H", value=0.5), noise=quiet)
    np.testing.assert_allclose(faulty["A1H"] - sound["A1H"], 0.5 * 0.01 / 9.80665, rtol=1e-9)
    faulty, sound = pair(Fault("crosstalk", FIRST, "L1H", value=0.1), noise=quiet)
    np.testing.assert_allclose(faulty["L1H"], sound["L1H"] + 0.1 * sound["L1V"], rtol=1e-9)
    faulty, sound = pair(Fault("rotated", FIRST, "L1H", value=np.pi / 2), noise=quiet)
    np.testing.assert_allclose(faulty["L1H"], sound["L1V"], atol=1e-12)


def test_missing_excitation_leaves_the_mean_and_the_noise():
    faulty, sound = pair(Fault("missing_excitation", FIRST), noise=Noise.none())
    assert np.ptp(sound["L1H"]) > 0.4
    assert np.ptp(faulty["L1H"]) == 0.0
    np.testing.assert_allclose(faulty["L1V"][0], -5000 * 5e-4)


def test_duplicate_run_is_the_other_record():
    broken = rig(Fault("duplicate_run", SECOND, other=FIRST))
    copied = broken.simulate(SECOND)
    assert (copied.run.id, copied.source) == (SECOND, FIRST)
    np.testing.assert_array_equal(copied.readings.columns["X1A"], rig().simulate(FIRST).readings.columns["X1A"])
    crossed = rig(Fault("duplicate_run", SECOND, other=FIRST), Fault("duplicate_run", FIRST, other=SECOND))
    assert [crossed.simulate(run.id).source for run in crossed.runs()][:2] == [SECOND, FIRST]


def test_time_gap_takes_rows_out_of_all_channels():
    record = rig(Fault("time_gap", FIRST, start=0.7, length=0.2)).simulate(FIRST).readings
    assert {len(v) for v in record.columns.values()} == {1800}
    assert np.max(np.diff(record.time)) == pytest.approx(0.201)


def test_time_jitter_keeps_the_order():
    record = rig(Fault("time_jitter", FIRST, value=0.3)).simulate(FIRST).readings
    steps = np.diff(record.time)
    assert np.all(steps > 0)
    assert np.std(record.time - np.arange(2000) / 1000) == pytest.approx(0.3e-3 * 0.85, rel=0.1)


def test_wrong_notes_are_in_the_manifest_only(campaign_of):
    faults = (
        Fault("wrong_pad", "p-2-up", value=4),
        Fault("wrong_direction", FIRST, value=np.pi / 2),
        Fault("wrong_frequency", SECOND, value=5.0),
        Fault("wrong_load", SECOND, value=2.0),
    )
    wrong, right = (rigdata.load_campaign(campaign_of(r)) for r in (rig(*faults, seconds=0.5), rig(seconds=0.5)))
    assert wrong.run("p-2-up").pad == 4
    assert wrong.run(FIRST).excitation_direction == pytest.approx(0.3 + np.pi / 2)
    assert wrong.run(SECOND).point.excitation_hz == 30.0
    assert wrong.run(SECOND).point.static_load == 10e3
    for name in (FIRST, SECOND, "p-2-up"):
        np.testing.assert_array_equal(wrong.run(name).record("X1A").values, right.run(name).record("X1A").values)


FILE_FAULTS = [
    ("hdf5", Fault("missing_channel", FIRST, "L1V")),
    ("csv-german", Fault("missing_channel", FIRST, "L1V")),
    ("hdf5", Fault("short_channel", FIRST, "X1B")),
    ("csv-german", Fault("duplicate_column", FIRST, "X1A")),
    ("csv-german", Fault("truncated_line", FIRST)),
    ("hdf5", Fault("missing_file", FIRST)),
    ("csv-german", Fault("missing_file", FIRST)),
    ("hdf5", Fault("empty_file", FIRST)),
    ("csv-german", Fault("empty_file", FIRST)),
]


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "fault"), FILE_FAULTS, ids=lambda v: v if isinstance(v, str) else v.kind)
def test_the_reader_reports_file_faults_of_that_run_only(campaign_of, layout, fault):
    problems = check_campaign(campaign_of(rig(fault, seconds=0.8), layout))
    assert problems
    assert {p.run for p in problems} == {FIRST}


LAYOUTS = [Hdf5Layout(), *(CsvLayout(missing=m, delimiter=";") for m in ("", "NaN", "-", "#N/A"))]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_missing_values_are_nan_in_every_layout(campaign_of, layout):
    fault = Fault("nan_gap", FIRST, "X1A", start=0.5, length=0.1)
    values = rigdata.load_campaign(campaign_of(rig(fault, seconds=0.8), layout)).run(FIRST).record("X1A").values
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(500, 600))


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"kind": "swaped", "channel": "X1A", "other": "X1B"}, "did you mean 'swapped'"),
        ({"kind": "dead"}, "needs channel"),
        ({"kind": "scaled", "channel": "X1A"}, "needs value"),
        ({"kind": "duplicate_run"}, "needs other"),
        ({"kind": "dead", "run": "d-9*", "channel": "X1A"}, "no run matches 'd-9"),
        ({"kind": "dead", "channel": "Q"}, "no channel matches 'Q'"),
        ({"kind": "swapped", "channel": "X1A", "other": "Q"}, "there is no 'Q'"),
    ],
)
def test_unknown_useless_and_incomplete_faults_are_refused(fault, says):
    with pytest.raises(VirtualRigError, match=says):
        rig(Fault(**{"run": FIRST, **fault}))


def test_faults_that_a_layout_cannot_show_are_refused(tmp_path):
    for fault, layout in (
        (Fault("truncated_line", FIRST), "hdf5"),
        (Fault("short_channel", FIRST, "X1A"), "csv"),
        (Fault("time_jitter", FIRST), "csv-bare"),
    ):
        with pytest.raises(VirtualRigError, match=fault.kind):
            write_campaign(tmp_path / "none", rig(fault), layout)
    assert list(tmp_path.iterdir()) == []


def test_the_truth_tells_all_faults(tmp_path):
    fault = Fault("dead", FIRST, "X1A")
    truth = write_campaign(tmp_path / "c.h5", rig(fault))
    assert truth["faults"] == [{"kind": "dead", "run": FIRST, "channel": "X1A", "start": 0.0}]
    assert all(text for _, _, text in KINDS.values())
    assert replace(fault, run="*").affects(SECOND)
    assert fault.is_in("X1A")
    assert not fault.is_in("X1B")
