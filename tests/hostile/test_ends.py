"""How a command ends: names that are not UTF-8, warnings of numpy, signals while workers are busy."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from tests.command_line import ended, tpjb
from tpjb_ident.cli.command import Command

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "rigdata" / "samples" / "demo.h5"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.parametrize("words", [("locus",), ("show",), ("check",), ("identify", "--method", "ols")])
def test_names_that_are_not_utf_8_are_names(small_campaign, tmp_path, words):
    campaign = tmp_path / os.fsdecode(b"d\xff.h5")
    shutil.copy(small_campaign, campaign)
    ended(0, words[0], campaign, *words[1:], "--out", tmp_path / os.fsdecode(b"o\xff"), "-q")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.parametrize(
    "words", [("check",), ("predict",), ("export", "--to", "csv"), ("verify",), ("rerun",), ("init",), ("view",)]
)
def test_files_of_such_names_that_are_not_there_are_bad_input(tmp_path, words):
    assert tpjb(words[0], tmp_path / os.fsdecode(b"none\xff.x"), *words[1:]).exit_code == 2


def test_warnings_of_arithmetic_go_to_the_record_and_others_to_people(tmp_path, capsys):
    def work(c):
        with c.results():
            warnings.warn("invalid value encountered in divide", RuntimeWarning, stacklevel=1)
            warnings.warn("Mean of empty slice", RuntimeWarning, stacklevel=1)
            warnings.warn("the cache cannot be written", RuntimeWarning, stacklevel=1)

    command = Command("locus", {}, tmp_path / "o")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert command.run(work, {}) == 0
    printed = " ".join(capsys.readouterr().err.split())
    assert "the cache cannot be written" in printed
    assert "encountered" not in printed
    (entry,) = json.loads((tmp_path / "o" / "run.json").read_text(encoding="utf-8"))["commands"].values()
    assert len(entry["arithmetic"]) == 2


@pytest.fixture
def heard_interrupts():
    """A shell that starts the tests in the background ignores interrupts; programs started here would inherit that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def is_alive(group: int) -> bool:
    """Whether a process of a group is left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.usefixtures("heard_interrupts")
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("words", "seconds", "number", "code"),  # after its folder is made: at once, or while workers are busy
    [
        (("diagnose", "--workers", "2"), 1.0, signal.SIGINT, 130),
        (("identify", "--workers", "1"), 0.0, signal.SIGTERM, 143),
        (("identify", "--workers", "2"), 0.2, signal.SIGINT, 130),
        (("identify", "--workers", "2"), 0.2, signal.SIGTERM, 143),
        (("compare",), 1.0, signal.SIGTERM, 143),
    ],
)
def test_a_command_that_is_told_to_end_does_so_at_once_and_leaves_no_results(tmp_path, words, seconds, number, code):
    command = [sys.executable, "-m", "tpjb_ident", words[0], str(DEMO), *words[1:], "--out", str(tmp_path / "o")]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    until = time.monotonic() + 60.0
    while not list(tmp_path.glob(".o.part-*")) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    time.sleep(seconds)
    os.killpg(process.pid, number)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == code, output
    assert "Traceback" not in output
    assert output.count("interrupted") == (number == signal.SIGINT)
    # workers that are quick may have finished runs by then, which a rerun uses
    left = {path.relative_to(tmp_path).parts[:2] for path in tmp_path.rglob("*")}
    assert left <= {("o",), ("o", ".tpjb-finished-runs")}
    until = time.monotonic() + 20.0
    while is_alive(process.pid) and time.monotonic() < until:  # the system's own helpers end with their pipes
        time.sleep(0.02)
    assert not is_alive(process.pid)
