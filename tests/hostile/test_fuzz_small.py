"""A few hundred cases of the fuzzer (tests/studies/fuzz.py) per reader: only documented errors."""

from __future__ import annotations

import logging
import random
import warnings

import pytest

from tests.hostile.fuzz_mutations import mutated
from tests.hostile.fuzz_targets import make_target

CASES = {
    "manifest": 100, "bearing": 100, "pivots": 150, "effects": 150, "csv": 40, "hdf5": 40, "table": 200, "record": 200,
    "mat": 150, "parquet": 60, "tdms": 60, "uff": 60, "mat73": 60, "asc": 60, "mf4": 5,
}  # fmt: skip
LIBRARIES = {"tdms": "nptdms", "uff": "pyuff", "mf4": "asammdf"}


@pytest.fixture
def quiet_libraries():
    """What nptdms tells its log of broken files is not a test's business."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "mf4" else n for n in CASES])
def test_spoilt_files_end_in_data_or_documented_errors(name, tmp_path, quiet_libraries):
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name])
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # what other people's writers warn of is not ours to judge
        target = make_target(name, tmp_path)
    target.feed(target.seeds[0])  # the good file itself is read
    refused = 0
    for number in range(CASES[name]):
        data = mutated(target.seeds, random.Random(f"ci-{name}-{number}"))
        try:
            target.feed(data)
        except target.documented:
            refused += 1
    assert 0 < refused <= CASES[name]
