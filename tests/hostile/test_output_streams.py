"""Terminals and pipes that cannot take what is printed: no result is lost to them, and nobody sees a traceback."""

import io
import json
import os
import sys
from pathlib import Path

import pytest

from tests.manifests import PROBE, SWEEP, manifest, write_files
from tpjb_ident.cli import main

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

    return run


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
