"""A campaign that grows: records land whole, in part, again, under other names; the manifest is edited meanwhile."""

import io
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import Fault
from tests.command_line import ended
from tests.good_campaigns import rocker_rig
from tpjb_ident.watch.landing import NewFiles
from tpjb_ident.watch.next_steps import plan_lacks
from tpjb_ident.watch.watcher import Watcher

pytestmark = pytest.mark.slow
DYNAMIC = [f"d-05000-25-0{i}" for i in (1, 2, 3)]


@pytest.fixture(scope="module")
def finished(campaign_of):
    """The whole campaign as CSV: three dynamic runs, three of the locus, dry tests, a sweep."""
    return campaign_of(rocker_rig(3), "csv")


@pytest.fixture(scope="module")
def clipped(campaign_of):
    """The same with a probe that clips in the second dynamic run."""
    return campaign_of(rocker_rig(3, Fault("clipped", run=DYNAMIC[1], channel="X1B", value=0.6)), "csv")


def land(source, live, *runs, name=""):
    """Copy runs of a finished campaign, or one under another name; the copies may be written to."""
    for run in runs:
        shutil.copyfile(source / "runs" / f"{run}.csv", live / "runs" / f"{name or run}.csv")


@pytest.fixture
def live(finished, tmp_path):
    """A campaign folder that holds its manifest and no record."""
    folder = tmp_path / "live"
    (folder / "runs").mkdir(parents=True)
    for path in finished.glob("*.toml"):
        shutil.copyfile(path, folder / path.name)
    return folder


def test_the_page_begins_with_what_was_tested_what_it_gives_and_a_picture(finished, live, tmp_path):
    land(finished, live, *DYNAMIC)
    done = ended(0, "watch", live, "--once", "--settle", "2 s", "--units", "us", "--out", tmp_path / "o")
    page = (tmp_path / "o" / "watch.html").read_text(encoding="utf-8")
    first = page[page.index('<dl class="tested">') : page.index("<nav")]
    for words in ("Bearing:", "Static load:", "1124 lbf", "K, lbf/in", "C, lbf s/in", "How far the plan is"):
        assert words in first, done.output
    assert "Next: <code>" not in first, "runs are still to come"
    assert not re.search(r"MN/m|kN|µm", page)


@pytest.fixture
def watch(live) -> Watcher:
    """Looks at it, every file taken for written at once."""
    return Watcher(live, NewFiles(0.0))


def states(snapshot) -> dict[str, str]:
    return {s.run.id: s.state for s in snapshot.states if s.state != "to run"}


def test_records_are_judged_as_they_land_and_identified_with_the_second_direction(watch, live, finished):
    first = watch.look()
    assert states(first) == {}
    assert first.steps[-1].text.startswith("Next: d-05000-25-01, 5 kN at -90 deg, shaft 22 Hz, excited at 25 Hz")
    assert watch.look() is None
    land(finished, live, *DYNAMIC[:2])
    second = watch.look()
    assert states(second) == dict.fromkeys(DYNAMIC[:2], "good")
    assert second.new == tuple(DYNAMIC[:2])
    (point,) = second.measured.points
    assert point.stiffness.k[1, 1] == pytest.approx(2.0e8, rel=0.03)
    assert second.steps[-1].runs == (DYNAMIC[2],)


def test_a_clipped_run_is_to_be_repeated_before_the_load_is_changed(watch, live, finished, clipped):
    land(finished, live, DYNAMIC[0])
    land(clipped, live, DYNAMIC[1])
    step = watch.look().steps[0]
    assert step.kind == "repeat"
    assert step.text.startswith(f"Repeat {DYNAMIC[1]} before you change the load: channel X1B")
    assert "clipped" in step.text
    land(finished, live, DYNAMIC[1], name=f"{DYNAMIC[1]}_2")
    after = watch.look()
    assert states(after)[DYNAMIC[1]] == "replaced"
    assert states(after)[f"{DYNAMIC[1]}_2"] == "good"
    assert [s.kind for s in after.steps] == ["next"]


def test_a_record_that_was_cut_off_is_named_and_mends_itself_when_the_rest_comes(watch, live, finished):
    land(finished, live, *DYNAMIC)
    whole = (finished / "runs" / f"{DYNAMIC[2]}.csv").read_bytes()
    (live / "runs" / f"{DYNAMIC[2]}.csv").write_bytes(whole[: len(whole) // 3])
    cut = watch.look()
    assert states(cut)[DYNAMIC[2]] == "repeat"
    assert "cut off, or not written to its end" in cut.steps[0].text
    (live / "runs" / f"{DYNAMIC[2]}.csv").write_bytes(whole)
    assert states(watch.look()) == dict.fromkeys(DYNAMIC, "good")


def test_a_file_that_is_being_written_is_neither_judged_nor_missing(live, finished):
    watch = Watcher(live, NewFiles(60.0))
    land(finished, live, DYNAMIC[0])
    assert states(watch.look()) == {DYNAMIC[0]: "being written"}
    assert watch.waits


def test_records_under_other_names_are_placed_by_load_line_and_direction(watch, live, finished):
    land(finished, live, DYNAMIC[1], name="Record_0017")
    snapshot = watch.look()
    (placed,) = snapshot.placed
    assert (placed.like, placed.why) == (DYNAMIC[1], f"is {DYNAMIC[1]} by load and line")
    assert states(snapshot) == {"Record_0017": "good"}
    assert DYNAMIC[1] not in {s.run.id for s in snapshot.states}


def test_what_is_foreign_away_edited_or_taken_meanwhile_stops_nothing(watch, live, finished):
    land(finished, live, *DYNAMIC)
    notes, manifest = live / "runs" / "notes.csv", live / "campaign.toml"
    notes.write_text("this is no record\n")
    foreign = watch.look()
    assert [p.file for p in foreign.problems] == ["runs/notes.csv"]
    assert len(foreign.measured.points) == 1
    notes.unlink()
    watch.look()
    away = live.rename(live.with_name("away"))  # a share
    assert watch.look() is None
    away.rename(live)
    assert watch.look() is None
    text = manifest.read_text("utf-8")
    manifest.write_text(text[: len(text) // 2])
    edited = watch.look()
    assert states(edited) == dict.fromkeys(DYNAMIC, "good")
    assert "goes on with the last one" in str(edited.problems[0])
    manifest.write_text(text)
    assert not watch.look().problems
    (live / "runs" / f"{DYNAMIC[0]}.csv").unlink()
    taken = watch.look()
    assert DYNAMIC[0] not in states(taken)
    assert taken.measured.points[0].n_records == 2


def test_a_probe_that_is_dead_in_two_records_in_a_row_stops_the_campaign(watch, live, finished, campaign_of):
    dead = campaign_of(rocker_rig(3, Fault("dead", run="d-*", channel="X1B")), "csv")
    land(finished, live, DYNAMIC[0])
    for i, run in enumerate(DYNAMIC[1:]):
        land(dead, live, run)
        os.utime(live / "runs" / f"{run}.csv", (time.time() + i + 1,) * 2)
    stop = watch.look().steps[0]
    assert stop.kind == "stop"
    assert stop.text.startswith("Stop: channel X1B: is dead")
    assert stop.runs == tuple(DYNAMIC[1:])


def test_the_command_tells_scripts_by_its_exit_code(live, finished, clipped, tmp_path):
    land(finished, live, *DYNAMIC)
    words = ("watch", live, "--once", "--settle", "0 s", "--within", "0.01 %", "--out", tmp_path / "out")
    good = ended(0, *words)
    assert "more record" in good.stdout or "calibration sets that" in good.stdout
    land(clipped, live, DYNAMIC[1])
    ended(3, *words)
    page = (tmp_path / "out" / "watch.html").read_text("utf-8")
    assert f"Repeat {DYNAMIC[1]} before you change the load" in page
    document = json.loads((tmp_path / "out" / "watch.json").read_text("utf-8"))
    assert {r["id"]: r["state"] for r in document["runs"]}[DYNAMIC[1]] == "repeat"


def test_killed_again_and_again_while_records_are_being_written_it_ends_with_the_same(live, finished, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "tpjb_ident", "watch", str(live), "--out", str(out)]
    watching = ["--every", "0.1 s", "--settle", "0.2 s"]
    records = sorted((finished / "runs").glob("*.csv"))
    for number, record in enumerate(records):
        data = record.read_bytes()
        half = len(data) // 2
        with (live / "runs" / record.name).open("wb", buffering=0) as file:
            file.write(data[:half])
            if number % 4 == 1:
                process = subprocess.Popen([*command, *watching], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                time.sleep(1.5 + 0.5 * (number % 3))
            file.write(data[half:])
        if number % 4 == 3:
            time.sleep(0.3)
            process.send_signal(signal.SIGKILL)
            process.wait()
            page = out / "watch.html"
            assert not page.exists() or page.read_text("utf-8").rstrip().endswith("</html>")
    if process.poll() is None:
        process.kill()
        process.wait()
    documents = []
    for folder in (out, tmp_path / "fresh"):
        ended(0, "watch", live, "--once", "--settle", "0 s", "--out", folder)
        documents.append(json.loads((folder / "watch.json").read_text("utf-8")))
        assert not list(tmp_path.glob(f".{folder.name}.part-*"))
    assert documents[0] == documents[1]
    assert {r["state"] for r in documents[0]["runs"]} == {"good"}
    tables = [(folder / "coefficients.csv").read_bytes() for folder in (out, tmp_path / "fresh")]
    assert tables[0] == tables[1]


@pytest.mark.parametrize("name", [f"{DYNAMIC[0]}.csv", f"{DYNAMIC[0]}_2.csv", "unplanned.csv"])
def test_a_link_that_appears_later_and_leads_out_is_never_opened(watch, live, finished, tmp_path, name, monkeypatch):
    watch.look()
    outside = tmp_path / "secret.csv"
    shutil.copy(finished / "runs" / f"{DYNAMIC[0]}.csv", outside)
    (live / "runs" / name).symlink_to(outside)
    opened = []
    sys_open = io.open

    def noted(file, *arguments, **options):
        opened.append(str(file))
        return sys_open(file, *arguments, **options)

    monkeypatch.setattr(io, "open", noted)
    snapshot = watch.look()
    monkeypatch.undo()
    assert states(snapshot) == {}
    assert snapshot.hashes == {}
    assert [p for p in opened if "secret" in p or name in p] == []
    assert any("leaves the campaign folder by a symlink" in p.what for p in snapshot.problems)
    (live / "runs" / name).unlink()
    land(finished, live, DYNAMIC[0])
    assert states(watch.look()) == {DYNAMIC[0]: "good"}


def test_a_manifest_that_becomes_a_link_is_not_read(watch, live, tmp_path):
    watch.look()
    manifest = live / "campaign.toml"
    moved = tmp_path / "outside.toml"
    manifest.rename(moved)
    moved.write_text(moved.read_text("utf-8").replace('id = "', 'id = "other-'), "utf-8")
    manifest.symlink_to(moved)
    snapshot = watch.look()
    assert not snapshot.campaign.id.startswith("other-")
    assert any("symlink" in p.what for p in snapshot.problems)


def test_a_plan_lacks_a_second_direction_at_one_point():
    point = OperatingPoint(5000.0, -math.pi / 2, 138.0, 2 * math.pi * 25.0)
    runs = [SimpleNamespace(kind=kind, point=point, excitation_direction=0.0) for kind in ("dynamic", "clearance")]
    assert plan_lacks(runs, 0) == ["1 operating point shaken in one direction (5 kN, 25 Hz): K and C need two."]
