"""How a command ends: names that are not UTF-8, warnings of numpy, signals, terminals and pipes that take nothing."""

import io
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
from tests.manifests import PROBE, SWEEP, manifest, write_files
from tpjb_ident.cli import main
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
    assert "RuntimeWarning: the cache cannot be written" in printed
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


HEAD = {"id": "Prüfstand µ", "bearing": "none.toml"}
MANIFEST = manifest({"X1A": PROBE}, SWEEP, head=HEAD, acquisition={"sample_rate": "10 Hz"})
RECORD = "X1A\n" + "".join(f"{i % 7}.5\n" for i in range(40))


@pytest.fixture
def campaign(tmp_path):
    return write_files(tmp_path / "campaign", MANIFEST, {"runs/c-1.csv": RECORD})


def stream(encoding: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding=encoding)


def told(out: io.TextIOWrapper) -> str:
    """What was written to a stream."""
    out.flush()
    return out.buffer.getvalue().decode(out.encoding)


@pytest.fixture
def ends(monkeypatch):
    def run(out, *words):
        errors = stream("ascii")
        monkeypatch.setattr(sys, "argv", ["tpjb", *map(str, words)])
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", errors)
        with pytest.raises(SystemExit) as end:
            main()
        monkeypatch.undo()
        return end.value.code, told(errors)

    kinds = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    former = {kind: signal.getsignal(kind) for kind in kinds}
    yield run
    for kind, handler in former.items():  # a command that has ended ignores them, and so would what is begun later
        signal.signal(kind, handler)


@pytest.mark.parametrize("encoding", ["ascii", "cp932", "cp437"])
def test_a_terminal_without_the_sign_shows_another(ends, campaign, encoding):
    out = stream(encoding)
    code, errors = ends(out, "show", campaign)
    assert code in (0, None), errors
    assert "stand " in told(out)


def test_json_is_what_it_was_whatever_the_stream_can_hold(ends, campaign):
    documents = []
    for encoding in ("utf-8", "ascii"):
        out = stream(encoding)
        ends(out, "show", campaign, "--json")
        documents.append(json.loads(told(out)))
    assert documents[0] == documents[1]
    assert any("Prüfstand µ" in line for line in documents[0]["said"])


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_names_of_broken_bytes_are_printed_recorded_and_found_again(ends, campaign, tmp_path):
    odd = campaign.rename(tmp_path / os.fsdecode(b"b\xff"))
    target = tmp_path / os.fsdecode(b"out\xff")
    out = stream("utf-8")
    code, errors = ends(out, "check", odd, "--out", target, "--json")
    assert code in (0, 2, 3), errors
    assert "bug" not in errors
    assert Path(json.loads(told(out))["results"]) == target
    record = json.loads((target / "run.json").read_text(encoding="utf-8"))
    assert (target / record["commands"]["check"]["inputs_at"]["campaign"]).resolve() == odd
    assert ends(stream("utf-8"), "verify", target)[0] in (0, None)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("more", [(), ("--json",), ("--help",)])
def test_a_full_disk_under_the_output_is_an_error_and_no_bug(ends, campaign, more):
    with open(os.open("/dev/full", os.O_WRONLY), "w", encoding="utf-8", closefd=True) as out:
        code, errors = ends(out, "show", campaign, *more)
        assert code == 2
        assert "No space left on device" in errors
        assert "bug" not in errors
        with pytest.raises(OSError, match="No space"):
            out.close()  # what is left in its buffer


def test_who_stops_reading_makes_no_error(ends, campaign):
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w", encoding="utf-8") as out:
        code, errors = ends(out, "show", campaign)
        assert (code, errors) == (0, "")
        with pytest.raises(BrokenPipeError):
            out.close()
