"""Channels at their own times: several rates and clocks in one run, in every format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from rigdata import RigDataError, Run, load_campaign
from tests.manifests import PROBES, SET_POINT, manifest

RATE, SLOW, SECONDS = 1000.0, 250.0, 2.0
T, T2 = np.arange(2000) / RATE, 0.0005 + np.arange(500) / SLOW
X, Y = np.sin(2 * np.pi * 25 * T), np.cos(2 * np.pi * 25 * T)
F = 3.0 * np.sin(2 * np.pi * 25 * T2)
CELL = {"quantity": "force", "axis": "0 deg", "unit": "N"}
CELLS = {"L1H": CELL, "L1V": CELL | {"axis": "90 deg"}}
TIME = {"quantity": "time", "unit": "s"}
RUN = {"id": "r", "kind": "dynamic", "excitation_frequency": "25 Hz", **SET_POINT}
#: Column -> values, None where a table has an empty cell.
Columns = Mapping[str, np.ndarray]


def padded(values: np.ndarray, length: int = 2000) -> np.ndarray:
    return np.concatenate([values, np.full(length - len(values), np.nan)])


def spread(values: np.ndarray, step: int = 4, length: int = 2000) -> np.ndarray:
    column = np.full(length, np.nan)
    column[::step] = values
    return column


def write_csv(path: Path, columns: Columns) -> None:
    pd.DataFrame({name: padded(values) for name, values in columns.items()}).to_csv(path, index=False)


def write_asc(path: Path, columns: Columns) -> None:
    frame = pd.DataFrame({name: padded(values) for name, values in columns.items()})
    frame.to_csv(path, index=False, sep="\t", decimal=",", lineterminator="\r\n", encoding="cp1252")


def write_parquet(path: Path, columns: Columns) -> None:
    pd.DataFrame({name: padded(values) for name, values in columns.items()}).to_parquet(path, index=False)


def write_mat(path: Path, columns: Columns) -> None:
    savemat(path, {name.replace(" ", "_"): values for name, values in columns.items()}, oned_as="column")


TABLES: dict[str, Callable[[Path, Columns], None]] = {
    "r.csv": write_csv, "r.asc": write_asc, "r.parquet": write_parquet, "r.mat": write_mat,
}  # fmt: skip


def campaign(folder: Path, file: str, channels: Mapping[str, object], rate: str = "", **tables: object) -> Run:
    run = RUN | {"file": file} | ({"sample_rate": rate} if rate else {})
    (folder / "campaign.toml").write_text(manifest(channels, run, **tables), encoding="utf-8")
    return load_campaign(folder).run("r")


def stored(path: Path, columns: Columns, channels: Mapping[str, object], rate: float | None = None) -> Run:
    with h5py.File(path, "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = manifest(channels, RUN), "x"
        group = file.create_group("runs/r")
        if rate:
            group.attrs["sample_rate_hz"] = rate
        for name, values in columns.items():
            group[name] = values
    return load_campaign(path).run("r")


def expect_two_devices(run: Run, name: str, counted: bool = False) -> None:
    first, second = run.devices
    assert (first.name, first.channels, first.rate, first.length) == ("", ("X1A", "X1B"), RATE, 2000)
    assert (second.name, second.channels, second.length, second.counted) == (name, ("L1H", "L1V"), 500, counted)
    assert second.rate == pytest.approx(SLOW)
    assert (run.length, run.sample_rate) == (2000, RATE)
    time, values = run.read_device(second, ["L1H", "L1V"], 3, 200)
    times = np.arange(500) / SLOW if counted else T2
    if counted:
        assert time is None
    else:
        np.testing.assert_allclose(time, times[3:200], atol=1e-9)
    np.testing.assert_allclose(values, np.array([F, -F])[:, 3:200], atol=1e-9)
    record = run.record("L1V")
    np.testing.assert_allclose(record.time, times, atol=1e-9)
    np.testing.assert_allclose(record.values, -F, atol=1e-9)
    assert record.rate == second.rate
    np.testing.assert_allclose(run.vector("force").values, np.array([F, -F]).T, atol=1e-9)
    rows = run.row_reader(("force",)).read(0, 10)
    np.testing.assert_allclose(rows.rows["force"], np.array([F, -F])[:, :10], atol=1e-9)
    np.testing.assert_allclose(run.vector("displacement").values, 1e-6 * np.array([X, Y]).T, atol=1e-15)
    with pytest.raises(RigDataError, match=r"not sampled at the same times: X1A \(1000 Hz\).*L1H \(250 Hz\)"):
        run.row_reader(("displacement", "force")).read(0, 10)


@pytest.mark.parametrize("file", TABLES)
@pytest.mark.parametrize("lettered", [False, True])
def test_two_time_columns(tmp_path, file, lettered):
    names = ("t", "time") if file == "r.mat" else ("Time", "Time 2")
    columns = {names[0]: T, "X1A": X, "X1B": Y, names[1]: T2, "L1H": F, "L1V": -F}
    TABLES[file](tmp_path / file, columns)
    clock = {"clock": "B"} if lettered else {}
    channels = {names[0]: TIME, **PROBES, names[1]: TIME | clock}
    channels |= {name: cell | clock for name, cell in CELLS.items()}
    expect_two_devices(campaign(tmp_path, file, channels), "B" if lettered else names[1])
