"""MATLAB 5 files that brought the process down inside scipy, found by fuzzing: now refused with their byte."""

import struct

import numpy as np
import pytest
from scipy.io import savemat

from rigdata.problem import RigDataError
from rigdata.readers.formats.mat import check_mat5
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
