"""A rerun goes on where a kill stopped it: finished runs are not repeated, stale ones are, tables stay the same."""

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import write_campaign
from tests.command_line import ended
from tests.good_campaigns import directions
from tests.identification.test_identify import rig
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.commands.identify import KEPT
from tpjb_ident.cli.commands.identify import _finished_runs as finished_runs
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs import run_jobs
from tpjb_ident.runs.run_jobs import RunStore, fingerprint
from tpjb_ident.runs.run_jobs import all_runs as gathered_runs
from tpjb_ident.runtime.executors import local_workers

TABLES = ("coefficients", "estimators", "windows", "frequency_fits", "budget")


POINTS = [(2500.0, 25.0), (5000.0, 25.0)]


@pytest.fixture(scope="module")
def path(campaign_of):
    """Six runs as short as they may be: what is kept of them is the same in kind."""
    return campaign_of(rig(POINTS, seed=8, directions=directions(3), dynamic_seconds=1.0))


@pytest.fixture(scope="module")
def whole(path):
    """What comes of all runs, done once and kept nowhere."""
    return all_runs(load_campaign(path), PhasorSettings(), silent)


@pytest.fixture
def counted(monkeypatch):
    """Ids of the runs that are read, one after the other."""
    done: list[str] = []
    plain = run_jobs.one_run

    def one_run(run, *arguments):
        done.append(run.id)
        return plain(run, *arguments)

    monkeypatch.setattr(run_jobs, "one_run", one_run)
    return done


def all_runs(*arguments, **named):
    """What `FinishedRuns` gives back of every run."""
    return gathered_runs(*arguments, **named).digests


def silent(text, done, total):
    pass


def stop_after(count):
    def progress(text, done, total):
        if done == count:
            raise KeyboardInterrupt

    return progress


def same(first, second) -> bool:
    """Whether all that was read of the runs is alike, bit for bit."""
    for a, b in zip(first, second, strict=True):
        names = ("start", "mains", "z", "mean", "scale", "lost", "record")
        blocks = [(getattr(a, name), getattr(b, name)) for name in names]
        for x, y in blocks:
            if (x is None) != (y is None) or (x is not None and not np.array_equal(x, y, equal_nan=True)):
                return False
        if (a.temperatures, a.lines) != (b.temperatures, b.lines):
            return False
        if [c.sentence() for c in a.conditions] != [c.sentence() for c in b.conditions]:
            return False
    return True


@pytest.mark.slow
def test_finished_runs_are_not_repeated_and_come_back_bit_for_bit(path, whole, tmp_path, counted):
    campaign, settings, store = load_campaign(path), PhasorSettings(), RunStore(tmp_path / "kept")
    with pytest.raises(KeyboardInterrupt):
        all_runs(campaign, settings, stop_after(4), store=store)
    assert len(counted) == 4
    again = all_runs(campaign, settings, silent, store=store)
    assert sorted(counted) == sorted(run.id for run in campaign.of_kind("dynamic"))  # each of the six once
    assert same(again, whole)
    counted.clear()
    with local_workers(2) as workers:
        assert same(all_runs(campaign, settings, silent, workers, store), whole)
    assert counted == []
    store.clear()
    assert not (tmp_path / "kept").exists()


@pytest.mark.slow
def test_a_run_that_another_command_has_cleared_is_done_again(path, whole, tmp_path, counted, monkeypatch):
    campaign, settings, store = load_campaign(path), PhasorSettings(), RunStore(tmp_path / "kept")
    all_runs(campaign, settings, silent, store=store)
    counted.clear()
    monkeypatch.setattr(RunStore, "load", lambda store, run: ("", None))
    assert same(all_runs(campaign, settings, silent, store=store), whole)
    assert len(counted) == len(whole)


@pytest.mark.slow
def test_what_has_changed_is_done_again(path, tmp_path, counted):
    copy = Path(shutil.copyfile(path, tmp_path / "copy.h5"))
    store, settings = RunStore(tmp_path / "kept"), PhasorSettings()
    all_runs(load_campaign(copy), settings, silent, store=store)
    counted.clear()
    all_runs(load_campaign(copy), settings, silent, store=store)
    assert counted == []
    with h5py.File(copy, "r+") as file:  # one sample of one channel of one run
        file["runs/d-05000-25-03/X1A"][5] += 1e-3
    all_runs(load_campaign(copy), settings, silent, store=store)
    assert counted == ["d-05000-25-03"]
    counted.clear()
    campaign = load_campaign(copy)
    all_runs(campaign, replace(settings, delays={"force": 1e-6}), silent, store=store)
    assert len(counted) == 6
    gain = replace(campaign.channels["X1A"], gain=1.01 * campaign.channels["X1A"].gain)
    runs = tuple(replace(run, channels={**run.channels, "X1A": gain}) for run in campaign.runs)
    counted.clear()
    all_runs(replace(campaign, runs=runs), replace(settings, delays={"force": 1e-6}), silent, store=store)
    assert len(counted) == 6


@pytest.mark.slow
def test_a_damaged_or_foreign_file_is_no_result(path, tmp_path, counted):
    campaign, settings, store = load_campaign(path), PhasorSettings(), RunStore(tmp_path / "kept")
    whole = all_runs(campaign, settings, silent, store=store)
    files = sorted(store.folder.iterdir())
    files[0].write_bytes(files[0].read_bytes()[:500])
    files[1].write_bytes(b"")
    files[2].write_text("hello")
    shutil.copy(files[4], files[3])  # another run's
    counted.clear()
    assert same(all_runs(campaign, settings, silent, store=store), whole)
    assert len(counted) == 4


def test_csv_runs_have_fingerprints_of_their_own_bytes(tmp_path):
    two = rig(POINTS[:1], seed=8, directions=directions(2), dynamic_seconds=1.0)
    write_campaign(tmp_path / "folder", two, "csv-german")
    run, other = load_campaign(tmp_path / "folder").of_kind("dynamic")[:2]
    mark = fingerprint(run, PhasorSettings())
    assert mark != fingerprint(other, PhasorSettings())
    assert mark == fingerprint(load_campaign(tmp_path / "folder").run(run.id), PhasorSettings())
    file = run.reader.path
    text = file.read_bytes()
    last = max(i for i, byte in enumerate(text) if chr(byte).isdigit())
    file.write_bytes(text[:last] + (b"1" if text[last : last + 1] != b"1" else b"2") + text[last + 1 :])
    assert mark != fingerprint(load_campaign(tmp_path / "folder").run(run.id), PhasorSettings())


@pytest.mark.parametrize("has_runs", [True, False])
def test_a_command_that_is_interrupted_says_that_finished_runs_wait(has_runs, tmp_path, capsys):
    folder = tmp_path / "o" / KEPT
    if has_runs:
        folder.mkdir(parents=True)
    with pytest.raises(KeyboardInterrupt), finished_runs(Command("identify", {}, tmp_path / "o")):
        raise KeyboardInterrupt
    assert (f"finished runs wait in {folder}" in capsys.readouterr().err) is has_runs


def tables(out: Path) -> list[bytes]:
    return [(out / f"{name}.csv").read_bytes() for name in TABLES]


@pytest.mark.slow
def test_a_killed_command_goes_on_and_ends_with_the_same_tables(campaign_of, tmp_path):
    path = campaign_of(rig(POINTS, seed=8))  # long enough to be killed half-way
    ended(0, "identify", path, "--out", tmp_path / "whole")
    assert sorted(p.name for p in (tmp_path / "whole").iterdir() if p.name.startswith(".")) == []
    out = tmp_path / "killed"
    command = [sys.executable, "-P", "-m", "tpjb_ident", "identify", str(path), "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while len(list((out / KEPT).glob("*.npz"))) < 3 and time.monotonic() < until and process.poll() is None:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (out / "coefficients.csv").exists()
    assert len(list((out / KEPT).glob("*.npz"))) >= 3
    ended(0, "identify", path, "--out", out, "--workers", 2)
    assert tables(out) == tables(tmp_path / "whole")
    assert not (out / KEPT).exists()


def test_an_error_leaves_nothing_behind(path, tmp_path):
    copy = Path(shutil.copyfile(path, tmp_path / "copy.h5"))
    with h5py.File(copy, "r+") as file:
        for run in file["runs"]:
            del file[f"runs/{run}/X1A"]
    result = ended(2, "identify", copy, "--out", tmp_path / "out")
    assert "X1A" in result.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["copy.h5"]


DAMAGES = {
    "without mark": lambda meta: meta.pop("fingerprint"),
    "of another kind": lambda meta: meta["result"]["RunDigest"].update(lines={"set": 5}),
    "with a mark that is none": lambda meta: meta.update(fingerprint={"a": 1}),
    "without blocks": lambda meta: meta["result"]["RunDigest"].pop("z"),
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_an_entry_that_somebody_has_changed_is_done_again(path, whole, counted, tmp_path, damage):
    campaign, store = load_campaign(path), RunStore(tmp_path / "kept")
    all_runs(campaign, PhasorSettings(), silent, store=store)
    first = store._file(campaign.runs[0].id)
    with np.load(first, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    meta = json.loads(str(arrays.pop("meta")))
    damage(meta)
    np.savez(first, meta=np.array(json.dumps(meta)), **arrays)
    assert same(all_runs(campaign, PhasorSettings(), silent, store=store), whole)
