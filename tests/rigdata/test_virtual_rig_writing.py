"""Campaigns on disk: the same bytes for the same seed, whole or not at all, and never over something else; without
noise what is read back is the physics."""

import hashlib
import json
import math
import time
import tomllib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import rigdata
from rigdata import virtual_rig as vr
from rigdata.operating_point import OperatingPoint
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K
from tests.good_campaigns import sample
from tests.seeds import first_quick
from tpjb_ident.check.campaign import check_campaign

TRUTH = vr.RigTruth.constant(np.diag([2e8, 4e8]), np.diag([4e5, 6e5]))


def rig(seed: int = 1, **changes) -> vr.VirtualRig:
    plan = vr.RigPlan(
        dynamic=vr.operating_points([(2500.0, 25.0)]),
        directions=(0.0, 1.5),
        locus=vr.locus_points(2),
        dry=(vr.DryTest(1, levels=(500.0,)),),
        dynamic_seconds=0.5,
        locus_seconds=0.5,
    )
    return replace(vr.VirtualRig(TRUTH, plan, vr.Instruments.like_paper(seed=seed), seed=seed), **changes)


def digest(path: Path) -> dict[str, str]:
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    return {p.relative_to(path).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.mark.parametrize("layout", ["hdf5", "csv-german"])
def test_same_seed_same_bytes_other_seed_other_bytes(tmp_path, layout):
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        vr.write_campaign(tmp_path / name, rig(seed), layout)
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    other = digest(tmp_path / "c")
    assert all(other[name] != code for name, code in digest(tmp_path / "a").items() if "run" in name or name == ".")


def test_both_forms_hold_the_same_readings(campaign_of):
    one, other = (rigdata.load_campaign(campaign_of(rig(), layout)) for layout in ("hdf5", "csv-german"))
    for run in one.runs:
        for name in ("X1A", "L1V", "A1H", "T5", "K1"):
            first, second = run.record(name).values, other.run(run.id).record(name).values
            assert np.abs(first - second).max() <= 0.02 * np.min(np.diff(np.unique(first)))


def test_an_existing_target_is_never_replaced(tmp_path):
    for layout, name in (("hdf5", "c.h5"), ("csv", "c")):
        vr.write_campaign(tmp_path / name, rig(1), layout)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.tex").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "c")
    before = digest(tmp_path / "c"), digest(tmp_path / "c.h5")
    for name, layout in (("notes.txt", "hdf5"), ("folder", "csv"), ("c", "csv"), ("c.h5", "hdf5"), ("link", "csv")):
        with pytest.raises(vr.VirtualRigError, match="exists"):
            vr.write_campaign(tmp_path / name, rig(2), layout)
    assert (digest(tmp_path / "c"), digest(tmp_path / "c.h5")) == before
    assert (tmp_path / "folder" / "thesis.tex").read_text() == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c", "c.h5", "folder", "link", "notes.txt"]


@pytest.mark.parametrize("layout", ["hdf5", "csv"])
def test_a_failure_on_the_way_leaves_nothing_behind(tmp_path, layout):
    def broken(point):
        return np.full((2, 2), np.nan) if point.static_load_direction > -1.0 else np.diag([2e8, 4e8])

    truth = replace(TRUTH, stiffness=broken)
    with pytest.raises(vr.VirtualRigError, match="no finite motion"):
        vr.write_campaign(tmp_path / "c", rig(truth=truth), layout)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(vr.VirtualRigError, match="not a folder"):
        vr.write_campaign(tmp_path / "no" / "c", rig(), layout)


def test_the_truth_is_not_in_the_campaign(tmp_path):
    hidden = rig(instruments=vr.Instruments.like_paper(seed=1).with_errors(probe_gain=1.0437, housing_mass=7.31))
    truth = vr.write_campaign(tmp_path / "c", hidden, "csv")
    text = (tmp_path / "c" / "campaign.toml").read_text()
    assert "1.0437" not in text
    assert tomllib.loads(text)["housing"] == {"mass": "30 kg"}
    truth.write(tmp_path / "truth.json")
    stored = json.loads((tmp_path / "truth.json").read_text())
    assert stored["schema"] == "tpjb-truth/1"
    assert stored["housing_mass_kg"] == 37.31
    assert stored["sensor_errors"]["X1A"]["gain"] == 1.0437
    assert set(stored["runs"]) == {run.id for run in hidden.runs}
    assert stored["runs"]["d-02500-25-01"]["lines"][0]["frequency_Hz"] == 25.0
    np.testing.assert_allclose(stored["pivot_curves"][0]["stiffness_N_per_m"], 6e8, rtol=1e-9)


def test_a_rigid_rig_has_a_truth_file_too(tmp_path):
    rigid = replace(TRUTH, pivot_deflection=lambda pad, load: 0 * load)
    cells = replace(vr.Instruments.like_paper(), cell_stiffness=(float("inf"), 6e8))
    vr.write_campaign(tmp_path / "c.h5", rig(truth=rigid, instruments=cells)).write(tmp_path / "truth.json")
    stored = json.loads((tmp_path / "truth.json").read_text())
    assert stored["cell_stiffness_N_per_m"] == [None, 6e8]
    assert set(stored["pivot_curves"][0]["stiffness_N_per_m"]) == {None}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.h5", "truth.json"]


def test_float32_holds_16_bit_readings_exactly(campaign_of):
    exact = rig().simulate("d-02500-25-01").readings.columns["X1A"]
    with h5py.File(campaign_of(rig())) as narrow:
        stored = narrow["runs/d-02500-25-01/X1A"]
        assert stored.dtype == np.float32
        np.testing.assert_array_equal(np.rint(stored[:] / (20 / 2**16)), np.rint(exact / (20 / 2**16)))
        assert narrow["runs/d-02500-25-01"].attrs["sample_rate_hz"] == 1000.0


def swept(angles: tuple[float, ...]) -> object:
    truth = vr.RigTruth.constant(np.eye(2) * 1e8, np.eye(2), pivot_angles=angles, clearance=(8e-5,) * 3)
    return vr.VirtualRig(truth, vr.RigPlan(clearance=(vr.ClearanceSweep(),)), vr.Instruments.like_paper(3)).simulate(
        "c-1"
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: vr.write_campaign("x", rig(), "tdms"), "no layout 'tdms'"),
        (lambda: vr.RigPlan(dry=(vr.DryTest(1), vr.DryTest(1, ramp=1.0))).runs(TRUTH.pivot_angles), "the id 'p-1-up'"),
        (
            lambda: vr.RigPlan(dynamic=vr.operating_points([(5000.0, 600.0)])).runs(()),
            "600 Hz cannot be sampled at 1000 Hz",
        ),
        (lambda: vr.RigPlan(dynamic=vr.operating_points([(5000.0, 0.0)])).runs(()), "0 Hz cannot be sampled"),
        (lambda: swept((0.0, 1.0, 2.0)), "fall out"),
        (lambda: swept((-math.pi / 2, math.pi / 2, math.pi / 2)), "fall out"),
    ],
)
def test_impossible_numbers_are_refused_where_they_are_given(make, message):
    with pytest.raises(vr.VirtualRigError, match=message):
        make()


def test_ids_tell_speeds_and_load_directions_apart():
    points = (
        *vr.operating_points([(2500.0, 25.0)]),
        *vr.operating_points([(2500.0, 25.0)], speed=200.0),
        *vr.operating_points([(2500.0, 25.0)], direction=0.0),
    )
    plan = vr.RigPlan(dynamic=points, directions=(0.0,), repeats=2)
    ids = [run.id for run in plan.runs(TRUTH.pivot_angles)]
    assert len(set(ids)) == 6
    assert ids[0] == "d-02500-w-90-n22-25-01-r1"


@pytest.mark.samples
def test_manifest_has_the_shape_of_the_samples(tmp_path):
    theirs = tomllib.loads((sample("rocker-baseline") / "campaign.toml").read_text())
    ours = vr.VirtualRig(TRUTH, vr.RigPlan.short(), vr.Instruments.like_paper(), seed=1)
    brief = {"dynamic_seconds": 0.01, "locus_seconds": 0.01}
    dry = tuple(vr.DryTest(pad, levels=(500.0,), hold=0.01) for pad in range(1, 6))
    short = replace(ours, plan=replace(ours.plan, **brief, dry=dry, clearance=(vr.ClearanceSweep(seconds=0.1),)))
    vr.write_campaign(tmp_path / "c", short, "csv-german")
    made = tomllib.loads((tmp_path / "c" / "campaign.toml").read_text())
    for manifest in (theirs, made):
        for key in ("id", "bearing", "description"):
            del manifest[key]
    for run in made["runs"]:
        assert run.pop("sample_rate", "500 Hz") == "500 Hz"
    assert made == theirs


@pytest.mark.samples
def test_csv_has_the_shape_of_the_samples(tmp_path):
    plan = vr.RigPlan(dynamic=vr.operating_points([(2500.0, 25.0)]), directions=(0.0,))
    vr.write_campaign(tmp_path / "c", rig(plan=plan), "csv-german")
    theirs = (sample("rocker-baseline") / "runs" / "d-02500-25-01.csv").read_bytes()
    made = (tmp_path / "c" / "runs" / "d-02500-25-01.csv").read_bytes()
    assert theirs.splitlines()[:7] == made.splitlines()[:7]
    for line in (8, 1000, 2006):
        first, second = (text.splitlines()[line].split(b";") for text in (theirs, made))
        # as many decimals in the columns that count: time, probes, cells, accelerometers
        assert [len(f.split(b",")[1]) for f in first[:7]] == [len(f.split(b",")[1]) for f in second[:7]]
    assert theirs.count(b"\r\n") == made.count(b"\r\n")


@pytest.mark.slow
@pytest.mark.samples
def test_noise_is_of_the_samples_kind_and_size(tmp_path):
    """White floor, 1/f, runout and unbalance of `Noise.like_samples` against a sample campaign's locus runs."""
    noise = replace(vr.Noise.like_samples(), bits=16)
    ours = vr.VirtualRig(TRUTH, vr.RigPlan(locus=vr.locus_points(20)), vr.Instruments.like_paper(), noise, seed=3)
    vr.write_campaign(tmp_path / "c.h5", ours)
    found = []
    for file in (sample("spherical-baseline"), tmp_path / "c.h5"):
        with h5py.File(file) as handle:
            runs = [handle[f"runs/l-05000-{i:02d}"] for i in range(1, 21)]
            found.append({n: np.median([residual(run[n][:], run["K1"][:]) for run in runs], axis=0) for n in CHANNELS})
    for name in CHANNELS:
        high, low, total = found[1][name] / found[0][name]
        assert 0.85 < high < 1.15, name
        assert 0.7 < low < 1.4, name
        assert 0.85 < total < 1.15, name


CHANNELS = ("X1A", "X1B", "L1H", "L1V", "A1H", "T1", "K1")


def residual(values: np.ndarray, tacho: np.ndarray) -> np.ndarray:
    """Density above 200 Hz, density at 2-10 Hz and robust rms of what is left without lines and drift."""
    time = np.arange(len(values)) / 1000
    running = 10 * float(tacho.mean())
    columns = [np.ones(len(time)), time]
    for frequency in (running, 2 * running, 50.0, 100.0, 150.0):
        columns += [np.cos(2 * np.pi * frequency * time), np.sin(2 * np.pi * frequency * time)]
    design, keep = np.stack(columns, axis=1), np.ones(len(time))
    series = values.astype(float)
    for _ in range(6):
        # normal equations: many small fits, for which lstsq's threads only get into each other's way
        weighted = design * keep[:, None]
        rest = series - design @ np.linalg.solve(weighted.T @ design, weighted.T @ series)
        scale = np.median(np.abs(rest)) / 0.6745
        keep = (np.abs(rest) < 5 * scale).astype(float)
    spectrum = np.abs(np.fft.rfft(rest * keep)) ** 2
    frequency = np.fft.rfftfreq(len(time), 1e-3)
    band = [np.sqrt(np.mean(spectrum[(frequency > a) & (frequency < b)])) for a, b in ((200, 500), (1.5, 10))]
    return np.array([*band, scale])


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
