"""The README's commands and Python lines do what it says."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
#: Run by other tests (the demo from the wheel, the recovery tests); here only their spelling is checked.
RUN_ELSEWHERE = ("compare", "diagnose", "plan", "view")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.S)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder where the checkout's relative paths hold but nothing is written into the checkout."""
    folder = tmp_path_factory.mktemp("desk")
    for name in ("rigdata", "model"):
        (folder / name).symlink_to(ROOT / name, target_is_directory=True)
    return folder


def tpjb(arguments, folder):
    return subprocess.run(
        [sys.executable, "-P", "-m", "tpjb_ident", *arguments], cwd=folder, capture_output=True, text=True
    )


def test_every_link_leads_somewhere():
    targets = re.findall(r"\]\(([^)]+)\)", README)
    assert targets
    assert [t for t in targets if not t.startswith("http") and not (ROOT / t).exists()] == []


def test_the_two_commands_name_what_exists():
    for command in ("tpjb_ident demo", "tests"):
        assert f"`python3 {command}`" in README
        assert f"`py {command}`" in README
        assert (ROOT / command.split()[0] / "__main__.py").exists()


@pytest.mark.slow
def test_every_command_line_runs(desk):
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("tpjb ")]
    assert len(lines) >= 9
    for line in lines:
        arguments = shlex.split(line, comments=True)[1:]
        if arguments[0] in RUN_ELSEWHERE:
            arguments = [arguments[0], "--help"]
        done = tpjb(arguments, desk)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


@pytest.mark.slow
def test_the_python_lines_run(desk):
    for block in blocks("python"):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-P", "-c", block], cwd=desk, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout
