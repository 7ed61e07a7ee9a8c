"""The output folder: whole or not at all, never over somebody's files."""

import json
import os
import tempfile
from pathlib import Path

import pytest

from tpjb_ident.cli.command import write_record
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import READY, former_runs, output_folder


def fill(target, command, names, inputs=(), error=None):
    with output_folder(target, command, inputs) as folder:
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(command)
        if error is not None:
            raise error
        write_record(folder, target, command, {"a": 1}, {"in.h5": "0" * 64})


def names_in(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def test_an_error_leaves_nothing_or_the_former_results(tmp_path):
    with pytest.raises(RuntimeError):
        fill(tmp_path / "out", "pivot", ["a.csv"], error=RuntimeError)
    assert list(tmp_path.iterdir()) == []
    fill(tmp_path / "out", "pivot", ["a.csv"])
    with pytest.raises(KeyboardInterrupt):
        fill(tmp_path / "out", "identify", ["a.csv"], error=KeyboardInterrupt)
    assert (tmp_path / "out" / "a.csv").read_text() == "pivot"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_commands_share_a_folder_and_its_record_and_drop_what_they_no_longer_make(tmp_path):
    out = tmp_path / "deep" / "out"
    fill(out, "pivot", ["a.csv", "figures/old.svg"])
    assert names_in(tmp_path) == ["deep/out/a.csv", "deep/out/figures/old.svg", "deep/out/run.json"]
    fill(out, "identify", ["coefficients.csv"])
    fill(out, "pivot", ["a.csv"])
    assert names_in(tmp_path) == [f"deep/out/{name}" for name in ("a.csv", "coefficients.csv", "run.json")]
    data = json.loads((out / "run.json").read_text())
    assert data["schema"] == "tpjb-run/2"
    assert set(data["commands"]) == {"pivot", "identify"}
    assert data["commands"]["pivot"]["outputs"] == ["a.csv"]
    assert data["commands"]["identify"]["inputs_sha256"] == {"in.h5": "0" * 64}
    assert data["commands"]["identify"]["versions"]["numpy"]


def test_files_that_are_not_ours_are_not_replaced_and_stay(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.csv").write_text("precious")
    with pytest.raises(BadInputError, match=r"a\.csv, which tpjb did not write"):
        fill(tmp_path / "out", "pivot", ["a.csv"])
    assert (tmp_path / "out" / "a.csv").read_text() == "precious"
    assert names_in(tmp_path) == ["out/a.csv"]
    fill(tmp_path / "out", "pivot", ["b.csv"])
    assert names_in(tmp_path / "out") == ["a.csv", "b.csv", "run.json"]


@pytest.mark.parametrize("folder", ["campaign", "campaign/runs", "campaign/results/today", "link/results"])
@pytest.mark.parametrize("inputs", [(), ("campaign",)])
def test_a_campaign_s_folder_is_never_written_to(tmp_path, folder, inputs):
    campaign = tmp_path / "campaign"
    campaign.mkdir()
    (campaign / "campaign.toml").write_text("")
    (tmp_path / "link").symlink_to(campaign, target_is_directory=True)
    with pytest.raises(BadInputError, match="raw data"):
        fill(tmp_path / folder, "pivot", ["a.csv"], tuple(tmp_path / name for name in inputs))
    assert names_in(campaign) == ["campaign.toml"]


def test_a_folder_that_cannot_be_made_is_named_as_given(tmp_path):
    with pytest.raises(BadInputError, match=r"--out /proc/nowhere/out: cannot be made"):
        fill(Path("/proc/nowhere/out"), "pivot", ["a.csv"])
    (tmp_path / "out").write_text("x")
    with pytest.raises(BadInputError, match="is a file"):
        fill(tmp_path / "out", "pivot", ["a.csv"])


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"schema": "other"}', '{"schema": "tpjb-run/1", "commands": {"x": 1}}']
)
def test_a_broken_record_counts_as_none(tmp_path, text):
    (tmp_path / "run.json").write_text(text)
    assert former_runs(tmp_path) == {}


def test_a_record_cannot_make_us_delete_outside_the_folder(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    victim = tmp_path / "victim.txt"
    victim.write_text("x")
    lie = {"schema": "tpjb-run/1", "commands": {"pivot": {"outputs": ["../victim.txt"]}}}
    (out / "run.json").write_text(json.dumps(lie))
    fill(out, "pivot", ["a.csv"])
    assert victim.exists()


def moved_half(target):
    """Make a folder as a kill leaves it between the first and the last file of a set."""
    fill(target, "identify", ["a.csv", "old.csv"])
    with output_folder(target.parent / "other", "identify") as folder:
        (folder / "a.csv").write_text("new a")
        (folder / "b.csv").write_text("new b")
        (folder / ".stale").write_text(json.dumps(["old.csv", "../victim.txt"]))
        write_record(folder, target, "identify", {"a": 2}, {})
    (target.parent / "other").rename(target / READY)
    (target / READY / "a.csv").replace(target / "a.csv")
    (target / "run.json").unlink()


def test_what_a_kill_left_half_moved_is_finished_by_the_next_command(tmp_path):
    target = tmp_path / "out"
    (tmp_path / "victim.txt").write_text("x")
    moved_half(target)
    assert former_runs(target) == {}
    fill(target, "pivot", ["c.csv"])
    assert names_in(target) == ["a.csv", "b.csv", "c.csv", "run.json"]
    assert (target / "b.csv").read_text() == "new b"
    assert former_runs(target)["identify"]["settings"] == {"a": 2}
    assert (tmp_path / "victim.txt").exists()


def test_a_folder_that_a_killed_run_left_beside_is_cleared_and_a_living_one_stands_in_the_record(tmp_path):
    dead, out = tmp_path / ".out.part-dead", tmp_path / "out"
    dead.mkdir()
    (dead / "half.csv").write_text("x")
    with output_folder(out, "pivot") as living:
        assert not dead.exists()
        fill(out, "predict", ["p.csv"])
        assert living.exists()
        (living / "b.csv").write_text("b")
        write_record(living, out, "pivot", {}, {})
        fill(out, "identify", ["a.csv"])  # begins and ends between the other's record and its end
    assert names_in(tmp_path) == ["out/a.csv", "out/b.csv", "out/p.csv", "out/run.json"]
    assert set(former_runs(out)) == {"predict", "pivot", "identify"}


def test_a_folder_that_another_run_clears_away_before_it_is_locked_is_made_anew(tmp_path, monkeypatch):
    made = tempfile.mkdtemp

    def cleared_once(**options):
        monkeypatch.setattr(tempfile, "mkdtemp", made)
        folder = made(**options)
        os.rmdir(folder)
        return folder

    monkeypatch.setattr(tempfile, "mkdtemp", cleared_once)
    fill(tmp_path / "out", "pivot", ["a.csv"])
    assert names_in(tmp_path) == ["out/a.csv", "out/run.json"]


def test_every_output_is_recorded_with_its_fingerprint_and_where_the_inputs_lie(tmp_path):
    source = tmp_path / "data" / "in.h5"
    source.parent.mkdir()
    source.write_text("x")
    with output_folder(tmp_path / "out", "pivot") as folder:
        (folder / "a.csv").write_text("")
        write_record(folder, tmp_path / "out", "pivot", {"campaign": source, "gone": tmp_path / "none"}, {})
    entry = former_runs(tmp_path / "out")["pivot"]
    assert entry["outputs_sha256"] == {"a.csv": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"}
    assert entry["inputs_at"] == {"campaign": "../data/in.h5"}
