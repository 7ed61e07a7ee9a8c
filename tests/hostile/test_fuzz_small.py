"""A few hundred cases of the fuzzer (tests/studies/fuzz.py) per reader: only documented errors."""

import logging
import random

import pytest

from rigdata.problem import RigDataError
from tests.hostile.fuzz_mutations import mutated
from tests.hostile.fuzz_targets import make_target
from tests.seeds import first_quick

CASES = {
    "manifest": 100, "bearing": 100, "pivots": 150, "effects": 150, "csv": 40, "hdf5": 40, "table": 200, "record": 200,
    "mat": 150, "parquet": 60, "tdms": 60, "uff": 60, "mat73": 60, "asc": 60, "mf4": 5,
}  # fmt: skip


@pytest.fixture
def quiet_libraries():
    """What nptdms tells its log of broken files is not a test's business."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.usefixtures("quiet_libraries")
@pytest.mark.parametrize("name", first_quick(*CASES))
def test_spoilt_files_end_in_data_or_documented_errors(name, tmp_path):
    target = make_target(name, tmp_path)
    target.feed(target.seeds[0])  # the good file itself is read
    refused, incomplete = 0, []
    for number in range(CASES[name]):
        data = mutated(target.seeds, random.Random(f"short-{name}-{number}"))
        try:
            target.feed(data)
        except target.documented as error:
            refused += 1
            problems = error.problems if isinstance(error, RigDataError) else ()
            incomplete += [p for p in problems if not (p.what and p.cure and p.file)]
    assert incomplete == []
    assert 0 < refused <= CASES[name]


def test_a_table_of_names_alone_is_refused_in_words(tmp_path):
    target = make_target("table", tmp_path)
    with pytest.raises(target.documented):
        target.feed(target.seeds[0].partition(b"\n")[0] + b"\n")
