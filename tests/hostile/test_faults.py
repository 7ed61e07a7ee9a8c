"""A kill, a full disk, two runs at once: results are whole or absent, raw data untouched."""

import os
import resource
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


def names_below(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*"))


def test_killed_at_random_moments_a_rerun_gives_the_same_bits(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile.kills", "--kills", "4", "--seed", "11", "--commands", "locus"],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "killed" in done.stdout


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
