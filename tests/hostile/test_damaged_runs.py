"""One damaged run costs itself and no other: commands name it and go on, as long as most of its kind are sound."""

import shutil
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest

from rigdata.virtual_rig import operating_points
from tests.command_line import ended
from tests.good_campaigns import SMALL_PLAN, rocker_rig

pytestmark = pytest.mark.slow

RUN = "d-05000-25-02"
EVERY_KIND = replace(SMALL_PLAN, dynamic=operating_points([(2500.0, 25.0), (5000.0, 25.0)]))
DYNAMIC_ALONE = replace(EVERY_KIND, locus=(), dry=(), clearance=())


def in_file(change):
    """A CSV run whose bytes are changed; None: that is not there."""

    def damage(path, run):
        file = path / "runs" / f"{run}.csv"
        data = change(file.read_bytes())
        file.unlink() if data is None else file.write_bytes(data)

    return damage


def garbage(data):
    half = len(data) // 2
    return data[:half] + np.random.default_rng(1).bytes(3000) + data[half:]


def torn_chunk(path, run):
    with h5py.File(path) as file:
        where = file[f"runs/{run}/X1A"].id.get_chunk_info(0)
    with path.open("r+b") as file:
        file.seek(where.byte_offset)
        file.write(b"\xff" * where.size)


def no_group(path, run):
    with h5py.File(path, "r+") as file:
        del file[f"runs/{run}"]


def constant(channel, value):
    def damage(path, run):
        with h5py.File(path, "r+") as file:
            group = file[f"runs/{run}"]
            values = np.full(group[channel].shape, value, "f4")
            del group[channel]
            group[channel] = values

    return damage


CSV = {
    "missing file": in_file(lambda data: None),
    "empty file": in_file(lambda data: b""),
    "cut off": in_file(lambda data: data[:400]),  # in the middle of a line
    "garbage": in_file(garbage),
}
HDF5 = {
    "torn chunk": torn_chunk,
    "missing group": no_group,
    "probe NaN": constant("X1A", np.nan),
    "cell NaN": constant("L1H", np.nan),
    "probe zero": constant("X1A", 0.0),
    "cell zero": constant("L1V", 0.0),
}
DAMAGE = CSV | HDF5


@pytest.fixture
def spoilt(campaign_of, tmp_path):
    """Copies of a good campaign, as HDF5 file or as CSV folder, with some runs damaged."""

    def make(name, *runs):
        plan = DYNAMIC_ALONE if all(run.startswith("d-") for run in runs) else EVERY_KIND
        source = campaign_of(rocker_rig(5, plan=plan), "csv" if name in CSV else "hdf5")
        path = tmp_path / source.name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, path)
        for file in [path, *path.rglob("*.*")]:
            file.chmod(0o755 if file.is_dir() else 0o644)
        for run in runs:
            (DAMAGE | {"accelerometer zero": constant("A1V", 0.0)})[name](path, run)
        return path

    return make


@pytest.mark.parametrize("name", [*DAMAGE, "accelerometer zero"])
def test_identify_goes_on_without_a_damaged_run_and_names_it(spoilt, tmp_path, name):
    path = spoilt(name, RUN)
    told = ended(0, "identify", path, "--workers", 1, "--out", tmp_path / "out")
    assert RUN in told.output
    table = pd.read_csv(tmp_path / "out" / "coefficients.csv").set_index("static_load_N")
    assert list(table.index) == [2500.0, 5000.0]
    assert "left-out" in table["quality"][5000.0] or "run-without-data" in table["quality"][5000.0]
    assert "left-out" not in table["quality"][2500.0]
    found = table.loc[5000.0, ["kxx_N_per_m", "kyy_N_per_m", "cxx_Ns_per_m"]].to_numpy(float)
    np.testing.assert_allclose(found, [1e8, 2e8, 5e5], rtol=0.02)


def test_compare_goes_on_without_a_damaged_run_and_names_it(spoilt, tmp_path):
    told = ended(0, "compare", spoilt("garbage", RUN), "--pivots", "rigid", "--out", tmp_path / "out")
    assert f"1 of 6 dynamic runs take no part: {RUN}" in " ".join(told.stdout.split())
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_check_names_every_damaged_run(spoilt):
    for name in DAMAGE:
        path = spoilt(name, RUN)
        told = ended(2, "check", path)
        assert RUN in told.output, name
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def test_a_record_that_lost_its_end_is_said_to_be_damaged(spoilt, tmp_path):
    path = spoilt("missing file")
    file = path / "runs" / f"{RUN}.csv"
    file.write_bytes(file.read_bytes()[:-30])
    told = ended(0, "identify", path, "--workers", 1, "--out", tmp_path / "out")
    assert "record-damaged" in told.output
    assert f"{RUN}.csv" in told.output


def test_a_point_that_loses_all_its_runs_is_lost_and_the_answer_not_to_be_trusted(spoilt, tmp_path):
    told = ended(
        3, "identify", spoilt("missing group", *(f"d-05000-25-0{i}" for i in (1, 2, 3))), "--out", tmp_path / "out"
    )
    assert "no usable run at 5 kN, 25 Hz" in told.output
    assert pd.read_csv(tmp_path / "out" / "coefficients.csv")["static_load_N"].tolist() == [2500.0]


DYNAMIC = [f"d-0{load}-25-0{i}" for load in (2500, 5000) for i in (1, 2, 3)]


@pytest.mark.parametrize(
    ("command", "name", "runs", "code", "says"),
    [
        ("identify", "probe zero", DYNAMIC, 2, ("X1A", "is dead")),
        ("identify", "accelerometer zero", DYNAMIC, 0, ("accelerometer-dead",)),
        ("pivot", "missing group", ["p-1-up", "p-2-up", "p-3-up"], 2, ("p-1-up", "p-2-up", "p-3-up")),
        ("locus", "missing group", ["c-1"], 3, ("runs-refused: c-1", "no-centre")),
    ],
)
def test_what_is_damaged_in_most_runs_is_no_accident(spoilt, tmp_path, command, name, runs, code, says):
    result = ended(code, command, spoilt(name, *runs), "--out", tmp_path / "out")
    assert all(text in result.output for text in says)
    assert (tmp_path / "out").exists() == (code != 2)
    assert not (tmp_path / "out" / "clearance.csv").exists()
    if command == "identify" and code == 0:
        assert pd.read_csv(tmp_path / "out" / "coefficients.csv")["n_records"].tolist() == [3, 3]


@pytest.mark.parametrize("name", ["torn chunk", "probe zero", "cut off"])
def test_pivot_goes_on_without_a_damaged_run_and_says_which_pad_has_no_curve(spoilt, tmp_path, name):
    told = ended(3, "pivot", spoilt(name, "p-2-up"), "--out", tmp_path / "out")
    assert "pad #2: has no curve" in told.output
    assert told.output.count("p-2-up") >= 1
    assert sorted(set(pd.read_csv(tmp_path / "out" / "pivot_curves.csv")["pad"])) == [1, 3, 4, 5]


@pytest.mark.parametrize("name", ["missing file", "torn chunk", "probe NaN", "cell zero"])
def test_locus_goes_on_without_a_damaged_direction(spoilt, tmp_path, name):
    told = ended(0, "locus", spoilt(name, "l-01000-02"), "--out", tmp_path / "out")
    assert "runs-refused: l-01000-02" in told.output
    assert pd.read_csv(tmp_path / "out" / "locus.csv")["run"].tolist() == ["l-01000-01", "l-01000-03"]
    assert len(pd.read_csv(tmp_path / "out" / "clearance.csv")) == 5


def test_what_a_diagnosis_measures_goes_on_without_damaged_runs_and_names_them(spoilt):
    from model.bearing_file import parse_bearing
    from rigdata.campaign import load_campaign
    from tpjb_ident.diagnosis.campaign import measure_campaign

    bad = [RUN, "p-4-up", "l-01000-02", "c-1"]
    source = load_campaign(spoilt("probe zero", *bad))
    bearing = parse_bearing(source.bearing_text, "b.toml")
    identification, static = measure_campaign(source, bearing, lambda text, done, total: None)
    told = " ".join(c.sentence() for c in identification.conditions)
    assert all(run in told for run in bad), told
    assert [curve.pad for curve in static.curves] == [1, 2, 3, 5]
    assert [p.n_records for p in identification.points] == [3, 2]
    assert len(static.locus.points) == 2
    assert static.clearance is None
