"""A kill, a full or read-only disk, a power cut, two runs at once: results are whole or absent, raw data untouched."""

import hashlib
import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import ended

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")]
ROOT = Path(__file__).parents[2]
TABLES = ("coefficients", "estimators", "windows", "frequency_fits", "budget")


def command(*words, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "tpjb_ident", *(str(w) for w in words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, **options,
    )  # fmt: skip


def end(process):
    told, errors = process.communicate(timeout=300)
    assert "Traceback" not in errors
    return process.returncode, told, errors


def study(name, *words):
    """What a study of this folder prints of `tpjb locus`, which has to end well."""
    words = [sys.executable, "-m", f"tests.hostile.{name}", "--commands", "locus", *words]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def names_below(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*"))


def test_killed_at_random_moments_a_rerun_gives_the_same_bits():
    assert "killed" in study("kills", "--kills", "3", "--seed", "11")


def test_a_full_disk_is_one_message_and_nothing_is_left(small_campaign, tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))  # what a full disk allows

    out = tmp_path / "out"
    code, _, errors = end(command("identify", small_campaign, "--workers", 1, "--out", out, preexec_fn=limit))
    assert code == 2, errors
    assert f"--out {out}: File too large" in errors
    assert "room on the disk" in errors
    assert names_below(tmp_path) == []


def test_two_runs_into_one_folder_at_once_leave_one_whole_set(small_campaign, tmp_path):
    out = tmp_path / "out"
    both = [command("identify", small_campaign, "--workers", 1, "--out", out) for _ in range(2)]
    for process in both:
        code, _, errors = end(process)
        assert code == 0, errors
    ended(0, "verify", out)
    assert names_below(tmp_path) == sorted(
        ["out", "out/run.json", *(f"out/{t}.{suffix}" for t in TABLES for suffix in ("csv", "parquet"))]
    )


def _may_mount() -> bool:
    """Whether this process may have a mount namespace of its own (root, or a kernel that lets users have one)."""
    if not (sys.platform == "linux" and shutil.which("unshare") and os.geteuid() == 0):
        return False
    return subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode == 0


mounts = pytest.mark.skipif(not _may_mount(), reason="takes root, to mount in a namespace")


def in_namespace(script: str, *words: object) -> tuple[int, str]:
    """Run a script of the shell in a mount namespace of its own, $0 being Python; exit code and messages."""
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", script, sys.executable, *map(str, words)],
        capture_output=True, text=True, timeout=300, check=False, cwd=ROOT,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    return done.returncode, done.stderr


def predict(load: str, out: Path) -> list[object]:
    """Words of a command that is soon done and writes three files."""
    return ["predict", ROOT / "model" / "bearings" / "rocker.toml", "--load", load, "--thermal", "isothermal",
            "--out", out]  # fmt: skip


def marks(out: Path, command: str) -> dict[str, str]:
    return json.loads((out / "run.json").read_text())["commands"][command]["outputs_sha256"]


@mounts
def test_no_size_of_a_full_disk_leaves_half_a_result(tmp_path):
    disk, listing = tmp_path / "disk", tmp_path / "listing"
    disk.mkdir()
    for size in (4, 16):  # a page for the folder alone, room for all files but the last
        script = (
            f'mount -t tmpfs -o size={size}k tmpfs {disk} && "$0" -m tpjb_ident "$@"; code=$?; '
            f"ls -A {disk} > {listing}; exit $code"
        )
        code, errors = in_namespace(script, *predict("5 kN", disk / "out"))
        assert code == 2, errors
        assert f"--out {disk / 'out'}: No space left on device; nothing was written" in errors
        assert listing.read_text() == ""


@mounts
def test_a_former_result_survives_a_disk_that_has_become_full(tmp_path):
    disk, first, second = (tmp_path / name for name in ("disk", "first", "second"))
    disk.mkdir()
    fill = f"dd if=/dev/zero of={disk}/ballast bs=4k count=$(($(stat -f -c %a {disk}) - 3)) 2>/dev/null"
    again = f'{{ "$0" -m tpjb_ident "$@" --speed "30 Hz"; code=$?; cp -a {disk}/out {second}; exit $code; }}'
    script = (
        f'mount -t tmpfs -o size=1m tmpfs {disk} && "$0" -m tpjb_ident "$@" && cp -a {disk}/out {first} && '
        f"{fill} && {again}"
    )
    code, errors = in_namespace(script, *predict("5 kN", disk / "out"))
    assert code == 2, errors
    assert "No space left on device" in errors
    contents = [{p.name: p.read_bytes() for p in folder.iterdir()} for folder in (first, second)]
    assert contents[0] == contents[1]
    assert set(marks(first, "predict")) == set(contents[0]) - {"run.json"}


@mounts
def test_a_campaign_on_a_read_only_disk_gives_the_same_bits(small_campaign, identified, tmp_path):
    folder = tmp_path / "campaign"  # of its own: the shared one lies above the results
    folder.mkdir()
    small_campaign = Path(shutil.copy(small_campaign, folder))
    before = hashlib.sha256(small_campaign.read_bytes()).hexdigest()
    sealed = f"mount --bind {folder} {folder} && mount -o remount,ro,bind {folder} && ! touch {folder}/x 2>/dev/null"
    words = ("identify", small_campaign, "--workers", 1, "--out", tmp_path / "out")
    code, errors = in_namespace(f'{sealed} && exec "$0" -m tpjb_ident "$@"', *words)
    assert code == 0, errors
    assert marks(tmp_path / "out", "identify") == marks(identified, "identify")
    assert hashlib.sha256(small_campaign.read_bytes()).hexdigest() == before


@mounts
def test_results_for_a_read_only_disk_are_refused_before_any_work(tmp_path):
    sealed = f"mount --bind {tmp_path} {tmp_path} && mount -o remount,ro,bind {tmp_path}"
    code, errors = in_namespace(f'{sealed} && exec "$0" -m tpjb_ident "$@"', *predict("5 kN", tmp_path / "out"))
    assert code == 2
    assert f"--out {tmp_path / 'out'}: cannot be made (Read-only file system). Give another folder." in errors


@mounts
@pytest.mark.skipif(not shutil.which("mkfs.ext4") or not Path("/dev/loop-control").exists(), reason="takes loop, ext4")
def test_power_cut_at_any_step_leaves_former_or_whole_results():
    told = study("power_cuts", "--trials", "1", "--reruns", "1")
    assert "cut after the end, results new" in told
    assert "cut on the way" in told
