"""Real disks in a mount namespace of their own: full ones, read-only ones, and one whose power is cut."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def _may_mount() -> bool:
    """Whether this process may have a mount namespace of its own (root, or a kernel that lets users have one)."""
    if not (sys.platform == "linux" and shutil.which("unshare") and os.geteuid() == 0):
        return False
    return subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode == 0


pytestmark = [pytest.mark.slow, pytest.mark.skipif(not _may_mount(), reason="takes root, to mount in a namespace")]


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


def test_a_campaign_on_a_read_only_disk_gives_the_same_bits(small_campaign, undisturbed, tmp_path):
    folder = tmp_path / "campaign"  # of its own: the shared one lies above the results
    folder.mkdir()
    small_campaign = Path(shutil.copy(small_campaign, folder))
    before = hashlib.sha256(small_campaign.read_bytes()).hexdigest()
    sealed = f"mount --bind {folder} {folder} && mount -o remount,ro,bind {folder} && ! touch {folder}/x 2>/dev/null"
    words = ("identify", small_campaign, "--workers", 1, "--out", tmp_path / "out")
    code, errors = in_namespace(f'{sealed} && exec "$0" -m tpjb_ident "$@"', *words)
    assert code == 0, errors
    assert marks(tmp_path / "out", "identify") == undisturbed
    assert hashlib.sha256(small_campaign.read_bytes()).hexdigest() == before


def test_results_for_a_read_only_disk_are_refused_before_any_work(tmp_path):
    sealed = f"mount --bind {tmp_path} {tmp_path} && mount -o remount,ro,bind {tmp_path}"
    code, errors = in_namespace(f'{sealed} && exec "$0" -m tpjb_ident "$@"', *predict("5 kN", tmp_path / "out"))
    assert code == 2
    assert f"--out {tmp_path / 'out'}: cannot be made (Read-only file system). Give another folder." in errors


@pytest.mark.skipif(not shutil.which("mkfs.ext4") or not Path("/dev/loop-control").exists(), reason="takes loop, ext4")
def test_power_cut_at_any_step_leaves_former_or_whole_results():
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile.power_cuts", "--trials", "1", "--commands", "locus", "--reruns", "1"],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "cut after the end, results new" in done.stdout
    assert "cut on the way" in done.stdout
