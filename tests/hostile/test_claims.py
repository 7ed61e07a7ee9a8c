"""Sizes that a header claims are summed before anything is read: refused in 2 s and 300 MB."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.problem import RigDataError
from rigdata.readers import base
from rigdata.readers.file_reader import FileReader
from rigdata.readers.series import Contents, Series
from tests.foreign_files import read_series
from tests.hostile import claims
from tests.manifests import PROBES, manifest

ROOT = Path(__file__).parents[2]
#: Seconds of processor time, and growth of memory [MB], that a file that is refused may take.
SECONDS, MEGABYTES = 2.0, 300.0


def campaign(folder: Path, described: int, runs: int, samples: int = claims.SAMPLES) -> Path:
    """An HDF5 campaign of clearance runs without times, of which some are described."""
    text = manifest(PROBES, *({"id": f"c-{number + 1}", "kind": "clearance"} for number in range(described)))
    return claims.hdf5_campaign(folder, text, runs, samples)


@pytest.mark.slow
def test_files_that_claim_gigabytes_are_refused_before_they_are_read(tmp_path):
    paths = [campaign(tmp_path, 8, 8), *(make(tmp_path) for make in claims.FOREIGN.values())]
    assert max(path.stat().st_size for path in paths) < 1e6
    command = [sys.executable, "-P", "-m", "tests.hostile.claims", *map(str, paths)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=ROOT)
    answers = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(answers) == len(paths)
    for path, (seconds, megabytes, answer) in zip(paths, answers, strict=True):
        assert float(seconds) < SECONDS, path.name
        assert float(megabytes) < MEGABYTES, path.name
        assert f"{path.name}: claims" in answer


def test_the_claims_of_all_runs_count_together(tmp_path, monkeypatch):
    monkeypatch.setattr(base, "CLAIM_FREE", 8 * 2 * 1000 * 3)
    monkeypatch.setattr(base, "CLAIM_MULTIPLES", 0)
    assert len(load_campaign(campaign(tmp_path, 3, 3, 1000)).runs) == 3
    with pytest.raises(RigDataError, match=r"claims\.h5: claims 0 MB of samples"):
        load_campaign(campaign(tmp_path, 4, 4, 1000))


def test_links_within_the_file_count_every_time(tmp_path, monkeypatch):
    monkeypatch.setattr(base, "CLAIM_FREE", 0)
    path = campaign(tmp_path, 2, 1, 100_000)
    monkeypatch.setattr(base, "CLAIM_MULTIPLES", -(-8 * 2 * 100_000 // path.stat().st_size))
    with h5py.File(path, "a") as file:
        file["runs/c-2"] = file["runs/c-1"]
    with pytest.raises(RigDataError, match="claims 3 MB"):
        load_campaign(path)


@pytest.mark.slow
def test_mdf_is_refused_by_what_it_claims_in_the_process_that_reads_it(tmp_path):
    pytest.importorskip("asammdf", reason="asammdf is heavy; install the extra mdf to run this")
    path = claims.mdf(tmp_path)
    assert path.stat().st_size < 10_000
    with pytest.raises(RigDataError, match=r"claims\.mf4: claims 34360 MB of samples"):
        read_series(path, path.name)
    assert len(read_series(claims.mdf(tmp_path, 20), path.name)) == 1


@pytest.mark.slow
def test_short_channels_are_not_spread_over_a_long_clock_and_times_without_end_are_refused():
    reader = FileReader(Path("x"), "x.tdms")
    clock = Series("fast", "", np.zeros(1000), np.arange(1000.0))
    slow = [Series(f"s{i}", "", np.zeros(2), np.array([0.0, 999.0])) for i in range(1000)]
    assert reader._arranged(Contents([clock, *slow])).nbytes == 8 * (2 * 1000 + 2 * 1000 + 2)
    series = [Series(f"s{i}", "", np.zeros(2), np.array([0.0, 1.05**i])) for i in range(1002)]
    with pytest.raises(RigDataError, match="more than 1000 different times"):
        reader._arranged(Contents(series))
