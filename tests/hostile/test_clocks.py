"""A computer's clock that jumps: an hour ahead, back to 1970, at every look."""

import itertools
import json
import os
import shutil
import time

import numpy as np
import pytest

from model.pad import store
from tests.command_line import ended


def test_solutions_stored_while_the_clock_was_ahead_do_not_push_out_new_ones(tmp_path, monkeypatch):
    monkeypatch.setenv("TPJB_CACHE", str(tmp_path))
    assert store.save_arrays("ahead0", {"a": np.ones(1)})
    monkeypatch.setattr(store, "_MOST", 5 * next(tmp_path.iterdir()).stat().st_size)
    for number in range(1, 5):
        assert store.save_arrays(f"ahead{number}", {"a": np.ones(1)})
    for path in tmp_path.iterdir():
        os.utime(path, (time.time() + 1e6,) * 2)
    for number in range(3):
        assert store.save_arrays(f"new{number}", {"a": np.full(1, float(number))})
    assert [store.load_arrays(f"new{number}", {"a": (1,)})["a"][0] for number in range(3)] == [0.0, 1.0, 2.0]
    assert len(list(tmp_path.iterdir())) == 5


@pytest.mark.slow
def test_a_command_under_a_clock_that_jumps_gives_the_same_and_may_be_verified(small_campaign, tmp_path, monkeypatch):
    """The clock of the day is somewhere else at every look; that which counts on alone goes steadily."""
    now, jumps = time.time, itertools.cycle((0.0, 3.6e3, -8.64e4, 1e9, -time.time() + 1.0))
    monkeypatch.setattr(time, "time", lambda: now() + next(jumps))
    path = shutil.copy(small_campaign, tmp_path / "campaign.h5")
    tables = []
    for name, year in (("a", 1971), ("b", 2100)):
        os.utime(path, (365.25 * 86400 * (year - 1970),) * 2)
        out = tmp_path / name
        ended(0, "locus", path, "--out", out)
        ended(0, "locus", path, "--out", out)  # over results of another time
        ended(0, "verify", out)
        assert list(json.loads((out / "run.json").read_text(encoding="utf-8"))["commands"]) == ["locus"]
        tables.append((out / "locus.csv").read_bytes())
    assert tables[0] == tables[1]
