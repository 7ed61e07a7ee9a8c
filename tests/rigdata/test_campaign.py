"""Campaigns: loading, lazy access, vectors, fingerprints, and paths that must not leave the folder."""

import hashlib
import os
import pickle
import threading
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

import rigdata
from rigdata.problem import RigDataError
from tests.manifests import PROBE, SET_POINT, manifest, write_files
from tpjb_ident.check.campaign import check_campaign

VOLTS = PROBE | {"unit": "V", "sensitivity": "7.78 mV/um", "polarity": -1}
THERMOMETER = {"quantity": "temperature", "position": 0.75, "unit": "degC"}
MANIFEST = manifest(
    {
        "X1A": VOLTS | {"axis": "45 deg"},
        "X1B": VOLTS | {"axis": "115 deg"},
        "L1H": {"quantity": "force", "axis": "0 deg", "unit": "N"},
        "T2": THERMOMETER | {"pad": 2},
        "T1": THERMOMETER | {"pad": 1},
        "K1": {"quantity": "speed", "unit": "V", "sensitivity": "100 mV/Hz"},
        "spare": {"quantity": "ignore"},
    },
    {"id": "l-1", "file": "runs/l-1.csv", "kind": "locus", **SET_POINT},
    {"id": "p-1", "file": "runs/p-1.csv", "kind": "dry_pivot", "pad": 1},
    head={"id": "rocker-A", "bearing": "rocker.toml", "description": "free text"},
    acquisition={"sample_rate": "100 Hz"},
)
X, Y = 3e-6, -5e-6
VOLTAGES = [-(np.cos(a) * X + np.sin(a) * Y) * 7780.0 for a in np.radians([45.0, 115.0])]
RECORD = "X1A,X1B,L1H,T2,T1,K1,spare\n" + f"{VOLTAGES[0]:.9f},{VOLTAGES[1]:.9f},100,41,40,2.2,text\n" * 50
FILES = {"rocker.toml": 'name = "rocker"\n', "runs/l-1.csv": RECORD, "runs/p-1.csv": RECORD}


def write(folder: Path, text: str = MANIFEST) -> Path:
    return write_files(folder, text, FILES)


@pytest.fixture
def folder(tmp_path):
    return write(tmp_path / "c")


@pytest.fixture
def campaign(folder):
    return rigdata.load_campaign(folder)


def test_what_a_campaign_tells(campaign):
    assert (campaign.id, campaign.description, campaign.bearing_name) == ("rocker-A", "free text", "rocker.toml")
    assert campaign.bearing_text == 'name = "rocker"\n'
    assert campaign.housing_mass == 30.0
    assert [r.id for r in campaign.runs] == ["l-1", "p-1"]
    assert [r.id for r in campaign.of_kind("dry_pivot")] == ["p-1"]
    assert "2 runs" in str(campaign)
    run = campaign.run("l-1")
    assert (run.kind, run.point.static_load, run.pad, run.branch) == ("locus", 5000.0, None, "up")
    assert run.sample_rate == 100.0
    assert run.file == "runs/l-1.csv"
    assert "spare" not in run.channels
    with pytest.raises(RigDataError, match="Did you mean 'l-1'"):
        campaign.run("l-11")
    with pytest.raises(RigDataError, match="not described"):
        run.record("spare")
    with pytest.raises(FrozenInstanceError):
        run.id = "other"


def test_probes_at_any_two_angles_become_x_and_y(campaign):
    vector = campaign.run("l-1").vector("displacement", 3, 8)
    assert vector.values == pytest.approx(np.tile([X, Y], (5, 1)), abs=1e-12)
    assert vector.names == ("X1A", "X1B")
    assert vector.rate == 100.0


def test_speed_and_temperatures(campaign):
    run = campaign.run("l-1")
    assert run.speed().values[0] == pytest.approx(2 * np.pi * 22)
    assert [(t.name, t.pad, t.position) for t in run.temperatures()] == [("T1", 1, 0.75), ("T2", 2, 0.75)]
    assert run.record("T1").values[0] == pytest.approx(313.15)


def test_vectors_that_cannot_be_made(campaign, tmp_path):
    collinear = write(tmp_path / "b", MANIFEST.replace('axis = "115 deg"', 'axis = "-135 deg"'))
    for source, quantity, says in (
        (campaign, "force", "has 1 channels, two are needed"),
        (campaign, "acceleration", "has 0 channels"),
        (rigdata.load_campaign(collinear), "displacement", "along one line"),
    ):
        with pytest.raises(RigDataError, match=says):
            source.run("l-1").vector(quantity)


def test_fingerprint_names_every_file_and_a_campaign_goes_on_without_a_vanished_run(folder):
    prints = rigdata.load_campaign(folder).fingerprint()
    assert set(prints) == {"campaign.toml", "rocker.toml", "runs/l-1.csv", "runs/p-1.csv"}
    assert prints["runs/l-1.csv"] == hashlib.sha256((folder / "runs/l-1.csv").read_bytes()).hexdigest()
    (folder / "runs/p-1.csv").unlink()
    campaign = rigdata.load_campaign(folder)
    assert campaign.fingerprint()["runs/p-1.csv"] == "missing"
    assert len(campaign.run("l-1").record("X1A")) == 50
    with pytest.raises(RigDataError, match="not there"):
        campaign.run("p-1").record("X1A")


def test_the_folder_that_somebody_stands_in_has_its_name(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert rigdata.load_campaign(".").path.name == folder.name


def test_a_campaign_travels_to_worker_processes_and_threads_share_it(campaign):
    expected = campaign.run("l-1").record("X1A").values
    assert np.array_equal(pickle.loads(pickle.dumps(campaign)).run("l-1").record("X1A").values, expected)
    results: list[float] = []
    fresh = rigdata.load_campaign(campaign.path)
    work = [threading.Thread(target=lambda: results.append(fresh.run("l-1").record("X1A").values[0])) for _ in range(8)]
    for thread in work:
        thread.start()
    for thread in work:
        thread.join()
    assert results == [expected[0]] * 8


@pytest.mark.parametrize("is_folder", [False, True])
def test_missing_bearing_file_is_a_warning(folder, is_folder):
    (folder / "rocker.toml").unlink()
    if is_folder:
        (folder / "rocker.toml").mkdir()
    campaign = rigdata.load_campaign(folder)
    assert campaign.bearing_text == ""
    (note,) = campaign.notes
    assert note.severity == "warning"
    assert "rocker.toml" in str(note)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("../secret.csv", "leaves the campaign folder"),
        ("runs/../../secret.csv", "leaves the campaign folder"),
        ("..\\\\secret.csv", "leaves the campaign folder"),
        ("/etc/passwd", "not relative"),
        ("C:/secret.csv", "not relative"),
        ("C:secret.csv", "not relative"),
        ("\\\\\\\\server\\\\share\\\\x.csv", "not relative"),
        ("//server/share/x.csv", "not relative"),
        ("~/x.csv", "not relative"),
        ("", "is empty"),
        ("a\\u0000b", "NUL"),
        ("a\\nb", "control"),
        ("x" * 2000, "too long"),
    ],
)
@pytest.mark.parametrize("key", ["file", "bearing"])
def test_paths_that_leave_the_folder(tmp_path, name, says, key):
    old = 'bearing = "rocker.toml"' if key == "bearing" else 'file = "runs/p-1.csv"'
    folder = write(tmp_path / "c", MANIFEST.replace(old, f'{key} = "{name}"'))
    (tmp_path / "secret.csv").write_text("X1A\n1\n")
    with pytest.raises(RigDataError) as caught:
        rigdata.load_campaign(folder)
    if not (key == "bearing" and name == ""):
        assert says in str(caught.value)
    assert any(p.severity == "error" for p in check_campaign(folder))


@pytest.mark.parametrize("linked", ["runs/p-1.csv", "runs", "campaign.toml"])
def test_symlinks_out_of_the_folder(folder, linked):
    outside = folder.with_name("outside")
    (folder / linked).rename(outside)
    (folder / linked).symlink_to(outside)
    with pytest.raises(RigDataError, match="by a symlink"):
        rigdata.load_campaign(folder)


def test_symlinks_that_stay_inside_and_a_folder_that_is_one(folder):
    link = folder.with_name("link")
    (folder / "runs/p-1.csv").rename(folder / "store.csv")
    (folder / "runs/p-1.csv").symlink_to(folder / "store.csv")
    link.symlink_to(folder)
    assert rigdata.load_campaign(link).run("p-1").length == 50
    (folder / "store.csv").rename(folder / "away.csv")
    (folder / "store.csv").symlink_to(folder / "runs/p-1.csv")  # a circle
    assert any(p.severity == "error" for p in check_campaign(folder))


def test_a_pipe_in_place_of_a_file_does_not_hang(folder):
    for name in ("runs/p-1.csv", "campaign.toml"):
        (folder / name).unlink()
        os.mkfifo(folder / name)
        with pytest.raises(RigDataError, match="ordinary file"):
            rigdata.load_campaign(folder).run("p-1").record("X1A")


@pytest.mark.parametrize("name", ["nowhere", "a\0b", "x" * 5000, ""])
def test_paths_that_are_no_campaign(tmp_path, name):
    with pytest.raises(RigDataError):
        rigdata.load_campaign(str(tmp_path / name))
    assert check_campaign(str(tmp_path / name))


def test_a_record_or_a_pipe_is_no_campaign(folder, monkeypatch):
    os.mkfifo(folder / "pipe.h5")
    for name, says in (("runs/l-1.csv", "is a record"), ("pipe.h5", "ordinary file")):
        with pytest.raises(RigDataError, match=says):
            rigdata.load_campaign(folder / name)

    def no_rights(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "is_dir", no_rights)
    with pytest.raises(RigDataError, match="Permission denied"):
        rigdata.load_campaign(folder)


def test_problems_travel_back_from_worker_processes_and_cannot_steer_a_terminal(tmp_path):
    with pytest.raises(RigDataError) as caught:
        rigdata.load_campaign(write(tmp_path, MANIFEST.replace("[housing]", "[housng]")))
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.problems == caught.value.problems
    assert str(again) == str(caught.value)
    problem = rigdata.Problem("error", "a\x1b[31m.csv", "line 1", "\u202eabc\x07", "mend")
    assert str(problem).isprintable()
    assert "\\x1b[31m" in str(problem)


def test_manifests_given_as_a_file_in_another_encoding_or_left_out(folder):
    (folder / "campaign.toml").write_bytes(MANIFEST.encode("utf-8-sig"))
    for path in (folder, folder / "campaign.toml"):
        assert rigdata.load_campaign(path).id == "rocker-A"
    (folder / "campaign.toml").write_bytes(MANIFEST.replace("free text", "Prüfstand").encode("cp1252"))
    with pytest.raises(RigDataError, match="line 4"):
        rigdata.load_campaign(folder)
    (folder / "campaign.toml").rename(folder / "c.h5")
    with pytest.raises(RigDataError, match=r"c\.h5"):
        rigdata.load_campaign(folder)


def test_raw_data_is_not_touched(folder):
    paths = sorted(p for p in folder.rglob("*") if p.is_file())
    before = {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in paths}
    for path in paths:
        path.chmod(0o444)
    check_campaign(folder)
    rigdata.load_campaign(folder).run("l-1").vector("displacement")
    assert {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in paths} == before
    assert sorted(p for p in folder.rglob("*") if p.is_file()) == paths
