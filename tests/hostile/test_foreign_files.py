"""Damaged files of loggers: refused with their byte, or by a process of its own that takes nobody along."""

import os
import struct
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat

from rigdata.problem import RigDataError
from rigdata.readers.formats import sandbox
from rigdata.readers.formats.mat import check_mat5
from rigdata.readers.series import Series
from tests.foreign_files import read_series

TIME = np.arange(120) / 100.0


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"time": TIME, "X1A": np.sin(TIME), "X1B": 2 * TIME})
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_sound_files_of_every_class_pass(tmp_path, compressed):
    import scipy.sparse

    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = TIME, "text"
    content = {
        "z": TIME + 1j, "s": {"a": TIME, "b": {"c": np.int16([1, 2])}}, "cell": cell, "word": "Zeit µ",
        "sparse": scipy.sparse.csc_matrix(np.eye(9)), "flag": np.array([True, False]), "none": np.zeros((0, 0)),
        "records": np.array([(1, 2.0)] * 9, dtype=[("i", "i4"), ("x", "f8")]), "single": np.float32(TIME),
    }  # fmt: skip
    path = tmp_path / "all.mat"
    savemat(path, content, do_compression=compressed)
    check_mat5(path)
    assert {s.name for s in read_series(path, "all.mat")} >= {"s.a", "single"}


@pytest.mark.parametrize("kind", [0, 8, 10, 11, 14, 19, 0xFFFF, 0x7FFFFFFF])
def test_a_type_that_is_none_is_refused_before_scipy_looks_it_up(good, kind):
    data = bytearray(good.read_bytes())
    at = data.index(struct.pack("<II", 9, 8 * len(TIME)))
    struct.pack_into("<I", data, at, kind)
    good.write_bytes(data)
    with pytest.raises(RigDataError, match="damaged"):
        read_series(good, "a.mat")


def test_a_version_4_file_that_claims_more_than_fits(tmp_path):
    path = tmp_path / "old.mat"
    path.write_bytes(struct.pack("<5i", 0, 2**31 - 1, 2**30, 0, 2) + b"a\0" + bytes(64))
    with pytest.raises(RigDataError, match=r"old\.mat"):
        read_series(path, "old.mat")


DAMAGED = Path(__file__).parent / "damaged"


def through_the_wall(folder, monkeypatch, read_in_sandbox):
    """What a reader of that kind gives, written and read back."""
    talks = SimpleNamespace(talks=read_in_sandbox)
    monkeypatch.setitem(sys.modules, "rigdata.readers.formats.loggers", talks)
    monkeypatch.setattr(sandbox, "_limit", lambda path, seconds: None)
    sandbox.main("talks", folder, 60, folder / "answer.npz")
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


@pytest.mark.parametrize(
    ("reader", "seconds", "says"),  # ten times the second's: less than Python takes to start
    [("no_such_reader", sandbox.SECONDS, "crash"), ("mdf_in_sandbox", 0.001, "took longer than 0 s")],
)
def test_a_child_that_dies_is_told_and_one_that_does_not_end_is_ended(tmp_path, monkeypatch, reader, seconds, says):
    (tmp_path / "a.mf4").write_bytes(b"x")
    monkeypatch.setattr(sandbox, "SECONDS", seconds)
    with pytest.raises(RigDataError, match=says):
        sandbox.read_sandboxed(reader, tmp_path / "a.mf4")


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
