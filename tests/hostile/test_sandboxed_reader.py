"""A library that crashes, hangs or eats memory on a damaged file takes its own process along and no other."""

import os
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.problem import RigDataError
from rigdata.readers.formats import sandbox
from rigdata.readers.series import Series
from tests.foreign_files import read_series

DAMAGED = Path(__file__).parent / "damaged"


def through_the_wall(folder, monkeypatch, read_in_sandbox):
    """What a reader of that kind gives, written and read back."""
    talks = SimpleNamespace(talks=read_in_sandbox)
    monkeypatch.setitem(sys.modules, "rigdata.readers.formats.loggers", talks)
    monkeypatch.setattr(sandbox, "_limit_memory", lambda path: None)
    sandbox.main("talks", folder, folder / "answer.npz")
    return sandbox._answered(folder / "answer.npz")


def test_numbers_cross_the_wall_bit_for_bit(tmp_path, monkeypatch):
    given = [
        Series("X1A", "V", np.array([1.0, np.nan, -np.inf, 5e-324]), np.arange(4.0), "group 1"),
        Series("Temperatür", "°C", np.array([]), None, "group 2"),
    ]
    for one, back in zip(given, through_the_wall(tmp_path, monkeypatch, lambda path: given), strict=True):
        assert (one.name, one.unit, one.group) == (back.name, back.unit, back.group)
        assert one.values.tobytes() == back.values.tobytes()
        assert (one.time is None) == (back.time is None)
        assert one.time is None or one.time.tobytes() == back.time.tobytes()


@pytest.mark.parametrize(
    ("error", "says"), [(MemoryError(), "claims more data"), (KeyError("x"), r"cannot be read \(KeyError: 'x'\)")]
)
def test_an_error_behind_the_wall_is_the_files_fault(tmp_path, monkeypatch, error, says):
    def read_in_sandbox(path):
        raise error

    with pytest.raises(RigDataError, match=says):
        through_the_wall(tmp_path, monkeypatch, read_in_sandbox)


def test_what_a_library_prints_is_no_part_of_the_answer(tmp_path, monkeypatch):
    def read_in_sandbox(path):
        print("a channel looks odd")  # asammdf says such things of files that it can read
        return [Series("X1A", "V", np.arange(3.0), None, "")]

    (back,) = through_the_wall(tmp_path, monkeypatch, read_in_sandbox)
    assert back.values.tolist() == [0.0, 1.0, 2.0]


def test_a_child_that_dies_is_told(tmp_path):
    path = tmp_path / "a.mf4"
    path.write_bytes(b"x")
    with pytest.raises(RigDataError, match="crash"):
        sandbox.read_sandboxed("no_such_reader", path)


def test_a_child_that_does_not_end_is_ended(tmp_path, monkeypatch):
    path = tmp_path / "a.mf4"
    path.write_bytes(b"x")
    monkeypatch.setattr(sandbox, "SECONDS", 0.001)  # ten times that: less than Python takes to start
    with pytest.raises(RigDataError, match="took longer than 0 s"):
        sandbox.read_sandboxed("mdf_in_sandbox", path)


@pytest.mark.skipif(os.name != "posix", reason="a shell script stands for the child")
def test_what_a_dying_child_leaves_in_the_temporary_folder_is_cleared_away(tmp_path, monkeypatch):
    path, shelf, told, dying = (tmp_path / name for name in ("a.mf4", "shelf", "told", "dies"))
    path.write_bytes(b"x")
    shelf.mkdir()
    dying.write_text(f'#!/bin/sh\necho "$TMPDIR" > {told}\ntouch "$TMPDIR/copy.mf4"\nexit 9\n')
    dying.chmod(0o700)
    monkeypatch.setattr(tempfile, "tempdir", str(shelf))
    monkeypatch.setattr(sys, "executable", str(dying))
    with pytest.raises(RigDataError, match="exit status 9"):
        sandbox.read_sandboxed("mdf_in_sandbox", path)
    assert Path(told.read_text().strip()).parent == shelf
    assert list(shelf.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crash", "circle", "gigabytes"])
def test_what_fuzzing_found_is_refused(name, monkeypatch):
    pytest.importorskip("asammdf", reason="asammdf is heavy; install the extra mdf to run this")
    monkeypatch.setattr(sandbox, "SECONDS", 10.0)
    with pytest.raises(RigDataError, match=rf"{name}\.mf4"):
        read_series(DAMAGED / f"{name}.mf4", f"{name}.mf4")
