"""What real exports write around their numbers: units, statistics, minus signs, times of day; LabVIEW files."""

from pathlib import Path

import numpy as np
import pytest

from rigdata import RigDataError, Run, load_campaign
from rigdata.device import timed_grid
from rigdata.readers.text.cells import stamp_seconds
from rigdata.survey.exports import read_export
from tests.foreign_files import lvm_text, read_series
from tests.manifests import PROBE, SET_POINT, Table, manifest, write_files

RATE, COUNT = 1000.0, 400
TIME = np.arange(COUNT) / RATE
X = np.sin(2 * np.pi * 25 * TIME) - 0.3
RUN = {"id": "one", "file": "one.csv", "kind": "locus", **SET_POINT}


def exported(folder: Path, head: str, rows: list[str], clock: str = "", **tables: Table) -> Run:
    """The one run of a campaign with a CSV file of these lines; which column is the clock, and more tables."""
    channels = {"X1A": PROBE, **({clock: {"quantity": "time", "unit": "s"}} if clock else {})}
    text = manifest(channels, RUN, **tables)
    return load_campaign(write_files(folder, text, {"one.csv": "\n".join([head, *rows, ""])})).run("one")


@pytest.mark.parametrize(
    ("stamp", "delimiter", "decimal", "name"),
    [
        (lambda t: f"2019-07-22T11:31:{22 + t:09.6f}Z", ",", ".", "timestamp"),
        (lambda t: f"2019-07-22 11:31:{22 + t:09.6f}+02:00", ";", ".", "Time"),
        (lambda t: "22.07.2019 " + f"11:31:{22 + t:09.6f}".replace(".", ","), ";", ",", "Zeit"),
        (lambda t: f"07/22/2019 11:31:{22 + t:09.6f}", "\t", ".", "Date/Time"),
        (lambda t: f"11:31:{22 + t:09.6f}", ",", ".", "time"),
    ],
)
def test_stamps_of_several_countries_are_seconds_from_the_first(tmp_path, stamp, delimiter, decimal, name):
    rows = [delimiter.join([stamp(t), f"{x:.9f}".replace(".", decimal)]) for t, x in zip(TIME, X)]
    record = exported(tmp_path, f"{name}{delimiter}X1A", rows, name).record("X1A")
    assert record.rate == pytest.approx(RATE, rel=1e-6)
    np.testing.assert_allclose(record.time, TIME, atol=1e-7)
    np.testing.assert_allclose(record.values, 1e-6 * X, atol=1e-14)
    export = read_export(tmp_path / "one.csv")
    assert (list(export.clocks), [s.name for s in export.series]) == ([name], ["X1A"])
    assert export.rate == pytest.approx(RATE, rel=1e-6)


def test_a_column_of_dates_beside_the_times_is_no_trouble(tmp_path):
    rows = [f"22.07.2019;11:31:{22 + t:09.6f};{x:.9f}" for t, x in zip(TIME, X)]
    (tmp_path / "one.csv").write_text("\n".join(["Datum;Uhrzeit;X1A", *rows]) + "\n")
    export = read_export(tmp_path / "one.csv")
    assert (list(export.clocks), [s.name for s in export.series]) == (["Uhrzeit"], ["X1A"])


@pytest.mark.parametrize(
    ("cells", "step"),
    [
        ([f"11:31:22.{int(1000 * i / 4000):03d}" for i in range(400)], 1 / 4000),  # milliseconds at 4 kHz
        (["23:59:59.8", "23:59:59.9", "00:00:00.0", "00:00:00.1"], 0.1),
        (["01.02.2019 23:59:59.9", "02.02.2019 00:00:00.0", "02.02.2019 00:00:00.1"], 0.1),  # in February
    ],
)
def test_stamps_coarser_than_the_samples_are_spread_evenly_and_midnight_is_no_step_back(cells, step):
    time, bad = stamp_seconds(cells)
    assert bad == 0
    grid = timed_grid(len(time), "stamps", time, "", None)
    assert (grid.even, grid.length) == (step < 0.1, len(time))
    assert grid.rate == pytest.approx(1 / step, rel=1e-3)


def test_a_cell_that_is_no_stamp_is_named_by_its_line(tmp_path):
    rows = [f"2019-07-22T11:31:{22 + t:09.6f},{x:.9f}" for t, x in zip(TIME, X)]
    rows[300] = "yesterday,0.1"
    with pytest.raises(RigDataError, match=r"line 302, column 1 \(timestamp\): 'yesterday' is not a time stamp"):
        exported(tmp_path, "timestamp,X1A", rows, "timestamp").record("X1A")


#: Two channels at 1 kHz and one at 100 Hz.
GROUPS = [
    (TIME, {"X1A": ("V", X), "L1H": ("mV", -X)}),
    (10 * TIME[: COUNT // 10], {"T1": ("degC", 40.0 + np.arange(COUNT // 10))}),
]


def written(folder, **layout):
    (folder / "a.lvm").write_text(lvm_text(GROUPS, **layout), newline="")
    return read_series(folder / "a.lvm", "a.lvm")


@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", "."), (";", ",")])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_labview_measurement_files_of_every_layout(tmp_path, x_columns, separator, decimal):
    x, force, warm = written(tmp_path, x_columns=x_columns, separator=separator, decimal=decimal)
    assert [(s.name, s.unit) for s in (x, force, warm)] == [("X1A", "V"), ("L1H", "mV"), ("T1", "degC")]
    assert (x.rate, warm.rate) == (RATE, RATE / 10)
    np.testing.assert_allclose(x.values, X, atol=1e-9)
    assert (len(warm), warm.values[-1]) == (COUNT // 10, pytest.approx(40.0 + COUNT // 10 - 1))


def test_segments_of_a_labview_file_follow_each_other(tmp_path):
    x = written(tmp_path, x_columns="One", segments=3)[0]
    assert len(x) == 3 * COUNT
    np.testing.assert_allclose(x.time, np.arange(3 * COUNT) / RATE, atol=1e-9)
    assert x.values[-1] == pytest.approx(X[-1] + 2)


def test_a_labview_file_whose_rows_end_before_the_column_of_comments(tmp_path):
    lines = [line.removesuffix("\t") for line in lvm_text(GROUPS, "One").replace("a remark", "").split("\r\n")]
    (tmp_path / "a.lvm").write_text("\r\n".join(lines), newline="")
    np.testing.assert_allclose(read_series(tmp_path / "a.lvm", "a.lvm")[1].values, -X, atol=1e-9)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("time,X1A\n0,1\n", "does not begin with 'LabVIEW Measurement'"),
        (lvm_text(GROUPS, "One").replace(f"{X[7]:.9f}", "seven"), "text among its numbers"),
        (lvm_text(GROUPS, "One")[:300], "holds no channel over time"),
    ],
    ids=["table", "text among numbers", "cut off"],
)
def test_what_cannot_be_read_says_why(tmp_path, content, says):
    (tmp_path / "a.lvm").write_text(content, newline="")
    with pytest.raises(RigDataError, match=says):
        read_series(tmp_path / "a.lvm", "a.lvm")


def counted(number: int, step: float) -> list[str]:
    """Rows of times, `step` apart, and readings."""
    return [f"{step * i:.12f},{i}" for i in range(number)]


@pytest.mark.parametrize("name", ["X1A [mV]", "X1A (mV)", "X1A / mV", "X1A/mV"])
def test_a_unit_behind_a_channels_name_is_held_against_the_manifest(tmp_path, name):
    """Names in brackets were read as the channel's, and what stood in the brackets went unheard."""
    run = exported(tmp_path, f"Zeit,{name}", counted(50, 0.001))
    (problem,) = (p for p in run.reader.problems() if p.severity == "error")
    assert "states 'mV', the manifest unit = 'um'" in problem.what
    same = exported(tmp_path, f"Zeit,{name.replace('mV', 'um')}", counted(2, 0.001))
    assert not [p for p in same.reader.problems() if p.severity == "error"]


@pytest.mark.parametrize(
    ("name", "factor"),
    [("Zeit [ms]", 1e3), ("Zeit/ms", 1e3), ("Zeit (Millisekunden)", 1e3), ("Zeit [min]", 1 / 60), ("Zeit / us", 1e6)],
)
def test_times_count_in_the_unit_of_their_name(tmp_path, name, factor):
    run = exported(tmp_path, f"{name},X1A", counted(500, 0.001 * factor))
    assert run.sample_rate == pytest.approx(1000.0, rel=1e-4)


@pytest.mark.parametrize("factor", [1e3, 1e6, 1 / 60, 1 / 86400])
def test_times_that_miss_the_stated_rate_by_another_unit_are_refused(tmp_path, factor):
    """A thousandth of the rate was believed: the frequencies of the run were thousandths too."""
    stated = {"acquisition": {"sample_rate": "1 kHz"}}
    with pytest.raises(
        RigDataError, match=r"one.csv, column Zeit: its times, taken for seconds.*1000 Hz\. State their"
    ):
        _ = exported(tmp_path, "Zeit,X1A", counted(500, 0.001 * factor), "Zeit", **stated).sample_rate
    # half of the campaign's rate is a run's own
    assert exported(tmp_path, "Zeit,X1A", counted(500, 0.002), "Zeit", **stated).sample_rate == pytest.approx(500.0)


def test_lines_of_statistics_at_the_end_are_no_samples(tmp_path):
    run = exported(tmp_path, "Zeit,X1A", [*counted(50, 0.001), ",24.5", ",49"], "Zeit")
    assert run.length == 50
    (problem,) = (p for p in run.reader.problems() if p.severity == "warning")
    assert problem.place == "line 52 and on"


def test_minus_signs_and_hours_as_spreadsheets_write_them(tmp_path):
    stamps = ["11:59:59.998 AM", "11:59:59.999 AM", "12:00:00.000 PM", "12:00:00.001 PM"]
    run = exported(tmp_path, "Zeit,X1A", [f"03/14/2019 {stamp},\u2212{i}.5" for i, stamp in enumerate(stamps)])
    assert run.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(run.record("X1A").values, [-0.5e-6, -1.5e-6, -2.5e-6, -3.5e-6])
