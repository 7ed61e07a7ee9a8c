"""Channels at their own times: several rates and clocks in one run, in every format."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rigdata import RigDataError, Run, load_campaign
from rigdata.device import rate_of_time, timed_grid
from tests.foreign_files import Columns, write_columns, write_groups
from tests.manifests import PROBES, SET_POINT, manifest, write_files, write_hdf5

RATE, SLOW = 1000.0, 250.0
T, T2 = np.arange(2000) / RATE, 0.0005 + np.arange(500) / SLOW
COUNTED = np.arange(500) / SLOW
X, Y = np.sin(2 * np.pi * 25 * T), np.cos(2 * np.pi * 25 * T)
F = 3.0 * np.sin(2 * np.pi * 25 * T2)
CELL = {"quantity": "force", "axis": "0 deg", "unit": "N"}
TIME = {"quantity": "time", "unit": "s"}
RUN = {"id": "r", "kind": "dynamic", "excitation_frequency": "25 Hz", **SET_POINT}
FAST, FORCES = {"X1A": X, "X1B": Y}, {"L1H": F, "L1V": -F}
TEXTS = ("r.csv", "r.asc", "r.parquet")
#: Time columns of both devices; a MATLAB name holds no blank.
NAMES = dict.fromkeys((*TEXTS, "r.h5"), ("Time", "Time 2")) | {"r.mat": ("t", "time")}


def cells(**keys: str) -> dict[str, object]:
    return {"L1H": CELL | keys, "L1V": CELL | {"axis": "90 deg"} | keys}


def slow_cells(rate: str = "250 Hz", **keys: str) -> dict[str, object]:
    return PROBES | cells(sample_rate=rate, **keys)


def two_times(file: str, second: np.ndarray = T2, **clock: str) -> tuple[Columns, dict[str, object]]:
    """Columns of two devices, and their channels."""
    first, other = NAMES[file]
    channels = {first: TIME, **PROBES, other: TIME | clock, **cells(**clock)}
    return {first: T, **FAST, other: second, **FORCES}, channels


def recorded(path: Path, columns: Columns, channels: Mapping[str, object], rate: float | None = None) -> Run:
    """The run of a file with these columns, or of one that is there; `rate` is the run's."""
    stated = {"sample_rate": f"{rate:g} Hz"} if rate else {}
    if path.suffix == ".h5":
        return load_campaign(write_hdf5(path, manifest(channels, RUN), columns, rate, "r")).run("r")
    if columns:
        write_columns(path, columns)
    text = manifest(channels, RUN | {"file": path.name} | stated)
    return load_campaign(write_files(path.parent, text)).run("r")


def spread(values: np.ndarray, step: int = 4, length: int = 2000) -> np.ndarray:
    column = np.full(length, np.nan)
    column[::step] = values
    return column


def expect_two_devices(run: Run, name: str, counted: bool = False) -> None:
    first, second = run.devices
    assert (first.name, first.channels, first.rate, first.length) == ("", ("X1A", "X1B"), RATE, 2000)
    assert (second.name, second.channels, second.length, second.counted) == (name, ("L1H", "L1V"), 500, counted)
    assert second.rate == pytest.approx(SLOW)
    assert (run.length, run.sample_rate) == (2000, RATE)
    time, values = run.read_device(second, ["L1H", "L1V"], 3, 200)
    times = COUNTED if counted else T2
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


@pytest.mark.parametrize("file", NAMES)
@pytest.mark.parametrize("clock", [{}, {"clock": "B"}])
def test_two_time_columns(tmp_path, file, clock):
    run = recorded(tmp_path / file, *two_times(file, **clock))
    expect_two_devices(run, clock.get("clock", NAMES[file][1]))


@pytest.mark.parametrize("file", ["r.h5", "r.mat"])
@pytest.mark.parametrize("clock", [{}, {"clock": "B"}])
def test_a_stated_rate_counts_the_times(tmp_path, file, clock):
    run = recorded(tmp_path / file, FAST | FORCES, slow_cells(**clock), RATE)
    expect_two_devices(run, clock.get("clock", "250 Hz"), counted=True)
    assert run.devices[0].counted


@pytest.mark.parametrize("file", TEXTS)
@pytest.mark.parametrize("column", [np.asarray, spread])
def test_empty_cells_of_a_slow_column_are_none_of_its_samples(tmp_path, file, column):
    columns = FAST | {"L1H": column(F), "L1V": column(-F)}
    expect_two_devices(recorded(tmp_path / file, columns, slow_cells(), RATE), "250 Hz", counted=True)
    run = recorded(tmp_path / file, {"Time": T, **columns}, {"Time": TIME, **slow_cells()})
    expect_two_devices(run, "250 Hz", counted=True)


@pytest.mark.parametrize("file", NAMES)
def test_slow_columns_begin_when_the_record_does(tmp_path, file):
    name, _ = NAMES[file]
    run = recorded(tmp_path / file, {name: T + 5.0, **FAST, **FORCES}, {name: TIME, **slow_cells()})
    assert not run.devices[1].counted
    for time in (run.read_device(run.devices[1], ["L1H"])[0], run.record("L1H").time):
        np.testing.assert_allclose(time, 5.0 + COUNTED, atol=1e-9)


def test_one_missing_reading_is_missing_and_moves_no_other(tmp_path):
    lost = F.copy()
    lost[7] = np.nan
    for other in (F, lost):
        columns = {"L1H": spread(lost), "L1V": spread(-other)}
        force = recorded(tmp_path / "r.csv", FAST | columns, slow_cells(), RATE).vector("force")
        assert np.flatnonzero(np.isnan(force.values[:, 0])).tolist() == [7]
        np.testing.assert_allclose(force.time, COUNTED, atol=1e-9)


def test_a_time_column_wins_over_a_stated_rate_and_that_over_the_runs(tmp_path):
    columns, channels = two_times("r.csv", clock="B")
    channels |= cells(clock="B", sample_rate="999 Hz")
    expect_two_devices(recorded(tmp_path / "r.csv", columns, channels, 7.0), "B")
    channels = slow_cells() | {"X1B": PROBES["X1B"] | {"sample_rate": "1 kHz"}}
    channels["X1A"] = PROBES["X1A"] | {"sample_rate": "1 kHz"}
    assert recorded(tmp_path / "a.h5", FAST | FORCES, channels).sample_rate == RATE


def test_a_clock_without_times_of_its_own_is_a_device_at_the_nominal_rate(tmp_path):
    run = recorded(tmp_path / "r.csv", {**FAST, "L1H": X, "L1V": Y}, PROBES | cells(clock="B"), RATE)
    first, second = run.devices
    assert (first.name, second.name, second.channels) == ("", "B", ("L1H", "L1V"))
    assert (second.rate, second.length, second.counted) == (RATE, 2000, True)
    np.testing.assert_array_equal(run.vector("force", 0, 5).values[:, 0], X[:5])  # the rows are the same


def test_only_the_other_clock_has_a_time_column(tmp_path):
    columns, channels = two_times("r.csv", clock="B")
    del columns["Time"], channels["Time"]
    run = recorded(tmp_path / "r.csv", columns, channels, RATE)
    expect_two_devices(run, "B")
    assert run.devices[0].counted


def test_time_columns_that_nobody_describes_serve_as_described_ones_do(tmp_path):
    columns, _ = two_times("r.csv")
    expect_two_devices(recorded(tmp_path / "r.csv", columns, PROBES | cells()), "Time 2")
    run = recorded(tmp_path / "r.csv", {"Time": T, **FAST}, PROBES)
    assert (run.sample_rate, run.record("X1A").time[-1]) == (RATE, T[-1])
    assert recorded(tmp_path / "r.csv", {}, PROBES, 2000.0).sample_rate == 2000.0  # a stated rate is enough


def test_the_first_probes_device_is_the_runs_own(tmp_path):
    channels = cells() | {name: probe | {"sample_rate": "500 Hz"} for name, probe in PROBES.items()}
    run = recorded(tmp_path / "a.h5", FORCES | {"X1A": X[:1000], "X1B": Y[:1000]}, channels, SLOW)
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
    run = recorded(tmp_path / "a.h5", FAST | {"L1H": slow, "L1V": slow}, slow_cells(rate), RATE)
    with pytest.raises(RigDataError, match=says) as caught:
        run.record("L1H")
    assert "a.h5:/runs/r, dataset L1H" in str(caught.value)
    assert "sample_rate" in caught.value.problems[0].cure
    assert len(run.record("X1A")) == 2000


@pytest.mark.parametrize("file", ["r.csv", "r.parquet"])
def test_an_empty_slow_column_is_its_own_fault(tmp_path, file):
    columns = FAST | {"L1H": spread(F), "L1V": np.full(2000, np.nan)}
    channels = slow_cells() | {"L1V": CELL | {"axis": "90 deg", "sample_rate": "10 Hz"}}
    run = recorded(tmp_path / file, columns, channels, RATE)
    assert len(run.record("L1H")) == 500
    with pytest.raises(RigDataError, match=r"L1V: .*has (0|2000) samples; at its sample_rate of 10 Hz"):
        run.record("L1V")


@pytest.mark.parametrize("file", NAMES)
def test_times_that_run_backwards_are_a_fault_of_their_device(tmp_path, file):
    back = T2.copy()
    back[100] = 0.0
    run = recorded(tmp_path / file, *two_times(file, back))
    says = rf"{file}, channel L1H: .*run backwards \(sample 101\). Sort or split"
    if file == "r.h5":
        says = "device 'Time 2', sample 101: time runs backwards"
    with pytest.raises(RigDataError, match=says):
        run.read_device(run.devices[1], ["L1H"]) if file == "r.h5" else run.record("L1H")
    assert len(run.vector("displacement")) == 2000


def test_a_time_column_with_gaps(tmp_path):
    gappy, lost = spread(T2), spread(F)
    gappy[40:80] = lost[40:80] = np.nan  # ten samples lost, with their times
    gappy[120] = np.nan  # one time lost
    columns, channels = two_times("r.csv", gappy)
    force = recorded(tmp_path / "r.csv", {**columns, "L1H": lost, "L1V": -lost}, channels).record("L1H")
    assert len(force) == 500  # rows that are left out are readings without a value
    np.testing.assert_allclose(force.time, T2, atol=1e-9)
    assert np.isnan(force.values[10:20]).all()
    np.testing.assert_allclose(np.delete(force.values, np.s_[10:20]), np.delete(F, np.s_[10:20]), atol=1e-9)


def test_rows_that_a_time_dataset_left_out_are_readings_without_a_value(tmp_path):
    columns, channels = two_times("r.h5", np.delete(T2, np.s_[10:20]))
    columns |= {name: np.delete(columns[name], np.s_[10:20]) for name in ("L1H", "L1V")}
    run = recorded(tmp_path / "r.h5", columns, channels)
    assert [device.length for device in run.devices] == [2000, 500]
    force = run.record("L1H")
    np.testing.assert_allclose(force.time, T2, atol=1e-9)
    assert np.flatnonzero(np.isnan(force.values)).tolist() == list(range(10, 20))
    part = run.record("L1H", 5, 25)  # a slice begins and ends where its samples are
    np.testing.assert_array_equal(part.values, force.values[5:25])
    np.testing.assert_allclose(part.time, T2[5:25], atol=1e-9)


STAMPS = {"rounded": np.round, "cut": np.floor, "float32": lambda stamps: np.float64(np.float32(stamps))}


@pytest.mark.parametrize("file", ["r.csv", "r.h5"])
@pytest.mark.parametrize("kind", STAMPS)
@pytest.mark.parametrize("stated", [None, RATE * 1.6])
@pytest.mark.parametrize("lost", [np.s_[:0], np.s_[700:760]])
def test_rounded_stamps_are_those_of_an_even_grid(tmp_path, file, kind, stated, lost):
    """At 1600 Hz, stamps in milliseconds repeat; as floats of 32 bits, at noon, eight in a row are alike."""
    time = 43200.0 + np.arange(2000) / (1.6 * RATE)
    stamps = STAMPS[kind](1000.0 * time) / 1000.0 if kind != "float32" else STAMPS[kind](time)
    columns = {name: np.delete(values, lost) for name, values in {"Time": stamps, **FAST}.items()}
    run = recorded(tmp_path / file, columns, {"Time": TIME, **PROBES}, stated)
    record = run.record("X1A")
    assert len(record) == 2000
    assert run.sample_rate == pytest.approx(1.6 * RATE, rel=2e-4)
    np.testing.assert_allclose(np.diff(record.time), 1 / (1.6 * RATE), rtol=2e-4)
    np.testing.assert_allclose(record.time, time, atol=5e-4 if kind == "cut" else 1e-4)
    missing = np.isnan(record.values)
    assert np.flatnonzero(missing).tolist() == list(range(2000)[lost])


@pytest.mark.parametrize("jitter", [0.06, 0.3])
@pytest.mark.parametrize("digits", [4, 9])
def test_times_of_a_clock_that_jitters_are_no_rounded_ones(jitter, digits):
    time = np.round(T + jitter / RATE * np.random.default_rng(5).uniform(-1, 1, len(T)), digits)
    grid = timed_grid(len(T), "t", time, "", None)
    assert not grid.even
    assert grid.places is None
    assert grid.length == len(T)


@pytest.mark.parametrize(("rate", "resolution"), [(900.0, 1e-3), (990.0, 1e-3), (2000.0, 0.0864)])
def test_rounding_alone_loses_no_rows(rate, resolution):
    """900 samples a second in milliseconds look like 1000 of which every tenth is missing; in days, of six digits."""
    grid = timed_grid(6000, "t", resolution * np.round(np.arange(6000) / rate / resolution), "", None)
    assert grid.even
    assert grid.length == 6000
    assert grid.rate == pytest.approx(rate, rel=3e-4)


def test_gaps_in_a_short_record_leave_its_rate_as_it_is():
    rows = np.ones(5500, dtype=bool)
    for first, count in ((900, 30), (2500, 55), (4400, 80)):  # every span of a quarter of it holds one
        rows[first : first + count] = False
    time = np.arange(len(rows)) / 2000.0
    assert rate_of_time(time[rows]) == rate_of_time(time) == 2000.0
    assert rate_of_time(np.round(time, 3)[rows]) == pytest.approx(2000.0, rel=2e-3)
    assert np.isnan(rate_of_time(-time))
    assert np.isnan(rate_of_time(0.0 * time))


def test_a_time_dataset_of_another_length(tmp_path):
    run = recorded(tmp_path / "a.h5", {"Time": T[:500], **FAST}, {"Time": TIME, **PROBES}, RATE)
    with pytest.raises(RigDataError, match="X1A: has 2000 samples, its time column 500"):
        run.record("X1A")


def test_channels_of_one_quantity_at_two_rates_make_no_vector(tmp_path):
    channels = slow_cells() | {"L1V": cells()["L1V"]}
    run = recorded(tmp_path / "a.h5", FAST | {"L1H": F, "L1V": X}, channels, RATE)
    with pytest.raises(RigDataError, match=r"L1H \(250 Hz\), L1V \(1000 Hz\)") as caught:
        run.vector("force")
    assert "device by device" in caught.value.problems[0].cure
    with pytest.raises(RigDataError, match="channel L1V: is none of device '250 Hz'"):
        run.read_device(run.devices[1], ["L1V"])


@pytest.mark.parametrize("file", [pytest.param("r.mf4", marks=pytest.mark.slow), "r.tdms", "r.lvm"])
@pytest.mark.parametrize("clock", [{}, {"clock": "B"}])
def test_groups_and_waves_of_two_rates(tmp_path, file, clock):
    fast, slow = ({name: (unit, v) for name, v in of.items()} for unit, of in (("um", FAST), ("N", FORCES)))
    write_groups(tmp_path / file, (T, fast), (T2, slow))
    expect_two_devices(recorded(tmp_path / file, {}, PROBES | cells(**clock)), clock.get("clock", "250 Hz"))


def test_all_channels_together_are_laid_along_the_runs_own_times_and_what_is_apart_is_noted(tmp_path):
    run = recorded(tmp_path / "a.h5", FAST | FORCES, slow_cells(), RATE)
    x, force = run.reader.read(["X1A", "L1H"], 4, 40)
    np.testing.assert_array_equal(x, X[4:40])
    np.testing.assert_allclose(force, np.interp(T[4:40], COUNTED, F))
    (note,) = run.reader.problems()
    assert note.severity == "note"
    assert note.what == "sampled apart: X1A, X1B (1000 Hz); L1H, L1V (250 Hz)"


def test_an_empty_time_dataset_and_the_record_of_another_devices_times(tmp_path):
    columns = {"Time": T[:0], "X1A": X[:0], "X1B": Y[:0], "L1H": F[:1], "L1V": F[:1]}
    run = recorded(tmp_path / "a.h5", columns, {"Time": TIME, **slow_cells()})
    assert [device.length for device in run.devices] == [0, 1]
    run = recorded(tmp_path / "r.h5", *two_times("r.h5"))
    assert len(run.record("Time")) == 2000
    with pytest.raises(RigDataError, match="channel Time 2: has 500 samples in place of 2000"):
        run.record("Time 2")
