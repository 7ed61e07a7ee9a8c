"""Channels at their own times: several rates and clocks in one run, in every format."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from rigdata import RigDataError, Run, load_campaign
from tests.foreign_files import write_mdf, write_tdms
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
    np.testing.assert_allclose(run.vector("displacement").values, 1e-6 * np.array([X, Y]).T, atol=1e-15)


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


def test_two_time_datasets(tmp_path):
    columns = {"Time": T, "X1A": X, "X1B": Y, "Time 2": T2, "L1H": F, "L1V": -F}
    for clock in ({}, {"clock": "B"}):
        channels = {"Time": TIME, **PROBES, "Time 2": TIME | clock}
        channels |= {name: cell | clock for name, cell in CELLS.items()}
        path = tmp_path / f"{len(clock)}.h5"
        expect_two_devices(stored(path, columns, channels), clock.get("clock", "Time 2"))


def with_rate(rate: str = "250 Hz", **keys: str) -> dict[str, object]:
    return {**PROBES, **{name: cell | {"sample_rate": rate, **keys} for name, cell in CELLS.items()}}


@pytest.mark.parametrize("clock", [{}, {"clock": "B"}])
def test_a_stated_rate_counts_the_times(tmp_path, clock):
    columns = {"X1A": X, "X1B": Y, "L1H": F, "L1V": -F}
    run = stored(tmp_path / "a.h5", columns, with_rate(**clock), 1000.0)
    expect_two_devices(run, clock.get("clock", "250 Hz"), counted=True)
    assert run.devices[0].counted
    write_mat(tmp_path / "r.mat", columns)
    expect_two_devices(campaign(tmp_path, "r.mat", with_rate(**clock), "1 kHz"), clock.get("clock", "250 Hz"), True)


@pytest.mark.parametrize("file", ["r.csv", "r.asc", "r.parquet"])
@pytest.mark.parametrize("cells", [padded, spread])
def test_empty_cells_of_a_slow_column_are_none_of_its_samples(tmp_path, file, cells):
    columns = {"X1A": X, "X1B": Y, "L1H": cells(F), "L1V": cells(-F)}
    TABLES[file](tmp_path / file, columns)
    expect_two_devices(campaign(tmp_path, file, with_rate(), "1 kHz"), "250 Hz", counted=True)
    TABLES[file](tmp_path / file, {"Time": T, **columns})
    expect_two_devices(campaign(tmp_path, file, {"Time": TIME, **with_rate()}), "250 Hz", counted=True)


@pytest.mark.parametrize("file", TABLES)
def test_slow_columns_begin_when_the_record_does(tmp_path, file):
    name = "t" if file == "r.mat" else "Time"
    columns = {name: T + 5.0, "X1A": X, "X1B": Y, "L1H": F, "L1V": -F}
    TABLES[file](tmp_path / file, columns)
    run = campaign(tmp_path, file, {name: TIME, **with_rate()})
    slow = run.devices[1]
    assert not slow.counted
    np.testing.assert_allclose(run.read_device(slow, ["L1H"])[0], 5.0 + np.arange(500) / SLOW, atol=1e-9)
    run = stored(tmp_path / "a.h5", columns, {name: TIME, **with_rate()})
    np.testing.assert_allclose(run.record("L1H").time, 5.0 + np.arange(500) / SLOW, atol=1e-9)


def test_one_missing_reading_is_missing_and_moves_no_other(tmp_path):
    cells = F.copy()
    cells[7] = np.nan
    write_csv(tmp_path / "r.csv", {"X1A": X, "X1B": Y, "L1H": spread(cells), "L1V": spread(-F)})
    force = campaign(tmp_path, "r.csv", with_rate(), "1 kHz").vector("force")
    assert np.flatnonzero(np.isnan(force.values[:, 0])).tolist() == [7]
    lost = spread(cells)
    write_csv(
        tmp_path / "r.csv", {"X1A": X, "X1B": Y, "L1H": lost, "L1V": spread(np.where(np.isnan(cells), cells, -F))}
    )
    force = campaign(tmp_path, "r.csv", with_rate(), "1 kHz").vector("force")
    assert len(force) == 499
    np.testing.assert_allclose(force.time, np.delete(np.arange(500) / SLOW, 7))


def test_a_time_column_wins_over_a_stated_rate_and_that_over_the_runs(tmp_path):
    columns = {"Time": T, "X1A": X, "X1B": Y, "Time 2": T2, "L1H": F, "L1V": -F}
    write_csv(tmp_path / "r.csv", columns)
    channels = {"Time": TIME, **PROBES, "Time 2": TIME | {"clock": "B"}}
    channels |= {name: cell | {"clock": "B", "sample_rate": "999 Hz"} for name, cell in CELLS.items()}
    expect_two_devices(campaign(tmp_path, "r.csv", channels, "7 Hz"), "B")
    columns = {"X1A": X, "X1B": Y, "L1H": F, "L1V": -F}
    for name in PROBES:
        channels = with_rate() | {name: probe | {"sample_rate": "1 kHz"} for name, probe in PROBES.items()}
    assert stored(tmp_path / "a.h5", columns, channels).sample_rate == 1000.0


def test_a_clock_without_times_of_its_own_is_a_device_at_the_nominal_rate(tmp_path):
    write_csv(tmp_path / "r.csv", {"X1A": X, "X1B": Y, "L1H": X, "L1V": Y})
    channels = {**PROBES, **{name: cell | {"clock": "B"} for name, cell in CELLS.items()}}
    run = campaign(tmp_path, "r.csv", channels, "1 kHz")
    first, second = run.devices
    assert (first.name, second.name, second.channels) == ("", "B", ("L1H", "L1V"))
    assert (second.rate, second.length, second.counted) == (RATE, 2000, True)
    np.testing.assert_array_equal(run.vector("force", 0, 5).values[:, 0], X[:5])  # the rows are the same


def test_only_the_other_clock_has_a_time_column(tmp_path):
    write_csv(tmp_path / "r.csv", {"X1A": X, "X1B": Y, "Time 2": T2, "L1H": F, "L1V": -F})
    channels = {**PROBES, "Time 2": TIME | {"clock": "B"}}
    channels |= {name: cell | {"clock": "B"} for name, cell in CELLS.items()}
    run = campaign(tmp_path, "r.csv", channels, "1 kHz")
    expect_two_devices(run, "B")
    assert run.devices[0].counted


def test_time_columns_that_nobody_describes_serve_as_described_ones_do(tmp_path):
    write_csv(tmp_path / "r.csv", {"Time": T, "X1A": X, "X1B": Y, "Time 2": T2, "L1H": F, "L1V": -F})
    expect_two_devices(campaign(tmp_path, "r.csv", {**PROBES, **CELLS}), "Time 2")
    write_csv(tmp_path / "r.csv", {"Time": T, "X1A": X, "X1B": Y})
    run = campaign(tmp_path, "r.csv", PROBES)
    assert (run.sample_rate, run.record("X1A").time[-1]) == (RATE, T[-1])
    assert campaign(tmp_path, "r.csv", PROBES, "2 kHz").sample_rate == 2000.0  # a stated rate is enough


def test_the_first_probes_device_is_the_runs_own(tmp_path):
    columns = {"L1H": F, "L1V": -F, "X1A": X[:1000], "X1B": Y[:1000]}
    channels = {**CELLS, **{name: probe | {"sample_rate": "500 Hz"} for name, probe in PROBES.items()}}
    run = stored(tmp_path / "a.h5", columns, channels, 250.0)
    assert [device.channels for device in run.devices] == [("X1A", "X1B"), ("L1H", "L1V")]
    assert (run.length, run.sample_rate, len(run.record("L1H"))) == (1000, 500.0, 500)
    assert run.vector("displacement").rate == 500.0


@pytest.mark.parametrize(
    ("slow", "rate", "says"),
    [
        (F, "500 Hz", "has 500 samples; at its sample_rate of 500 Hz the run holds 1000"),
        (F[:490], "250 Hz", "has 490 samples; at its sample_rate of 250 Hz the run holds 500"),
        (X, "250 Hz", "has 2000 samples; at its sample_rate of 250 Hz the run holds 500"),
        (F[:0], "250 Hz", "has 0 samples"),
    ],
)
def test_a_rate_that_contradicts_the_samples(tmp_path, slow, rate, says):
    run = stored(tmp_path / "a.h5", {"X1A": X, "X1B": Y, "L1H": slow, "L1V": slow}, with_rate(rate), 1000.0)
    with pytest.raises(RigDataError, match=says) as caught:
        run.record("L1H")
    assert "a.h5:/runs/r, dataset L1H" in str(caught.value)
    assert "sample_rate" in caught.value.problems[0].cure
    assert len(run.record("X1A")) == 2000


@pytest.mark.parametrize("file", ["r.csv", "r.parquet"])
def test_an_empty_slow_column_is_its_own_fault(tmp_path, file):
    columns = {"X1A": X, "X1B": Y, "L1H": spread(F), "L1V": np.full(2000, np.nan)}
    channels = with_rate() | {"L1V": CELLS["L1V"] | {"sample_rate": "10 Hz"}}
    TABLES[file](tmp_path / file, columns)
    run = campaign(tmp_path, file, channels, "1 kHz")
    assert len(run.record("L1H")) == 500
    with pytest.raises(RigDataError, match=r"L1V: .*has (0|2000) samples; at its sample_rate of 10 Hz"):
        run.record("L1V")


@pytest.mark.parametrize("file", TABLES)
def test_times_that_run_backwards_are_a_fault_of_their_device(tmp_path, file):
    names = ("t", "time") if file == "r.mat" else ("Time", "Time 2")
    back = T2.copy()
    back[100] = 0.0
    TABLES[file](tmp_path / file, {names[0]: T, "X1A": X, "X1B": Y, names[1]: back, "L1H": F, "L1V": -F})
    run = campaign(tmp_path, file, {names[0]: TIME, **PROBES, names[1]: TIME, **CELLS})
    with pytest.raises(RigDataError, match=rf"{file}, channel L1H: .*run backwards \(sample 101\). Sort or split"):
        run.record("L1H")
    assert len(run.vector("displacement")) == 2000


def test_a_time_dataset_that_runs_backwards(tmp_path):
    back = T2.copy()
    back[100] = 0.0
    columns = {"Time": T, "X1A": X, "X1B": Y, "Time 2": back, "L1H": F, "L1V": -F}
    run = stored(tmp_path / "a.h5", columns, {"Time": TIME, **PROBES, "Time 2": TIME, **CELLS})
    with pytest.raises(RigDataError, match="device 'Time 2', sample 101: time runs backwards"):
        run.read_device(run.devices[1], ["L1H"])


def test_a_time_column_with_gaps(tmp_path):
    gappy, cells = spread(T2), spread(F)
    gappy[40:80] = cells[40:80] = np.nan  # ten samples lost, with their times
    gappy[120] = np.nan  # one time lost
    write_csv(tmp_path / "r.csv", {"Time": T, "X1A": X, "X1B": Y, "Time 2": gappy, "L1H": cells, "L1V": -cells})
    force = campaign(tmp_path, "r.csv", {"Time": TIME, **PROBES, "Time 2": TIME, **CELLS}).record("L1H")
    assert len(force) == 490
    np.testing.assert_allclose(force.time, np.delete(T2, np.s_[10:20]), atol=1e-9)
    np.testing.assert_allclose(force.values, np.delete(F, np.s_[10:20]), atol=1e-9)


def test_a_time_dataset_of_another_length(tmp_path):
    columns = {"Time": T[:500], "X1A": X, "X1B": Y}
    run = stored(tmp_path / "a.h5", columns, {"Time": TIME, **PROBES}, 1000.0)
    with pytest.raises(RigDataError, match="X1A: has 2000 samples, its time column 500"):
        run.record("X1A")


def test_channels_of_one_quantity_at_two_rates_make_no_vector(tmp_path):
    columns = {"X1A": X, "X1B": Y, "L1H": F, "L1V": X}
    channels = with_rate() | {"L1V": CELLS["L1V"]}
    run = stored(tmp_path / "a.h5", columns, channels, 1000.0)
    with pytest.raises(RigDataError, match=r"L1H \(250 Hz\), L1V \(1000 Hz\)") as caught:
        run.vector("force")
    assert "device by device" in caught.value.problems[0].cure
    with pytest.raises(RigDataError, match="channel L1V: is none of device '250 Hz'"):
        run.read_device(run.devices[1], ["L1V"])


def write_groups_mdf(path: Path) -> None:
    write_mdf(path, [(T, {"X1A": ("um", X), "X1B": ("um", Y)}), (T2, {"L1H": ("N", F), "L1V": ("N", -F)})])


def write_groups_tdms(path: Path) -> None:
    fast = {"wf_increment": 1 / RATE, "wf_start_offset": 0.0}
    slow = {"wf_increment": 1 / SLOW, "wf_start_offset": 0.0005}
    columns = {"X1A": (X, fast), "X1B": (Y, fast), "L1H": (F, slow), "L1V": (-F, slow)}
    write_tdms(path, [("log", name, values, wave) for name, (values, wave) in columns.items()])


def write_lvm(path: Path) -> None:
    columns = {"X1A": (X, RATE, 0.0), "X1B": (Y, RATE, 0.0), "L1H": (F, SLOW, 0.0005), "L1V": (-F, SLOW, 0.0005)}
    lines = ["LabVIEW Measurement\t", "Separator\tTab", "X_Columns\tNo", "***End_of_Header***\t", "", "Channels\t4"]
    heads = {"Samples": [len(v) for v, *_ in columns.values()], "X_Dimension": ["Time"] * 4}
    heads |= {"X0": [x for *_, x in columns.values()], "Delta_X": [1 / rate for _, rate, _ in columns.values()]}
    lines += ["\t".join([key, *map(str, cells)]) for key, cells in heads.items()]
    lines += ["***End_of_Header***", "\t".join(["X_Value", *columns, "Comment"])]
    for i in range(2000):
        lines.append("\t".join(["", *(repr(float(v[i])) if i < len(v) else "" for v, *_ in columns.values())]))
    path.write_text("\r\n".join(lines) + "\r\n", newline="")


@pytest.mark.parametrize(
    ("file", "write"),
    [pytest.param("r.mf4", write_groups_mdf, marks=pytest.mark.slow), ("r.tdms", write_groups_tdms),
     ("r.lvm", write_lvm)],
    ids=["mf4", "tdms", "lvm"],
)  # fmt: skip
@pytest.mark.parametrize("clock", [{}, {"clock": "B"}])
def test_groups_and_waves_of_two_rates(tmp_path, file, write, clock):
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        write(tmp_path / file)
    channels = {**PROBES, **{name: cell | clock for name, cell in CELLS.items()}}
    expect_two_devices(campaign(tmp_path, file, channels), clock.get("clock", "250 Hz"))


def test_all_channels_together_are_laid_along_the_runs_own_times(tmp_path):
    run = stored(tmp_path / "a.h5", {"X1A": X, "X1B": Y, "L1H": F, "L1V": -F}, with_rate(), 1000.0)
    x, force = run.reader.read(["X1A", "L1H"], 4, 40)
    np.testing.assert_array_equal(x, X[4:40])
    np.testing.assert_allclose(force, np.interp(T[4:40], np.arange(500) / SLOW, F))


def test_an_empty_time_dataset_and_the_record_of_another_devices_times(tmp_path):
    columns = {"Time": T[:0], "X1A": X[:0], "X1B": Y[:0], "L1H": F[:1], "L1V": F[:1]}
    run = stored(tmp_path / "a.h5", columns, {"Time": TIME, **with_rate()})
    assert [device.length for device in run.devices] == [0, 1]
    columns = {"Time": T, "X1A": X, "X1B": Y, "Time 2": T2, "L1H": F, "L1V": -F}
    run = stored(tmp_path / "b.h5", columns, {"Time": TIME, **PROBES, "Time 2": TIME, **CELLS})
    assert len(run.record("Time")) == 2000
    with pytest.raises(RigDataError, match="channel Time 2: has 500 samples in place of 2000"):
        run.record("Time 2")


def test_what_is_sampled_apart_is_noted(tmp_path):
    run = stored(tmp_path / "a.h5", {"X1A": X, "X1B": Y, "L1H": F, "L1V": -F}, with_rate(), 1000.0)
    (note,) = run.reader.problems()
    assert note.severity == "note"
    assert note.what == "sampled apart: X1A, X1B (1000 Hz); L1H, L1V (250 Hz)"
