"""Times of day in text files, and LabVIEW measurement files."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rigdata import RigDataError, load_campaign
from rigdata.readers.file_reader import read_series
from rigdata.readers.text.cells import stamp_seconds
from rigdata.survey.exports import read_export
from tests.manifests import PROBE, SET_POINT, manifest

RATE, COUNT = 1000.0, 400
TIME = np.arange(COUNT) / RATE
X = np.sin(2 * np.pi * 25 * TIME) - 0.3
RUN = {"id": "one", "file": "one.csv", "kind": "locus", **SET_POINT}


def write_manifest(folder, clock):
    """A campaign of one file: a clock and a probe."""
    text = manifest({clock: {"quantity": "time", "unit": "s"}, "X1A": PROBE | {"axis": "45 deg"}}, RUN)
    (folder / "campaign.toml").write_text(text, "utf-8")


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
    (tmp_path / "one.csv").write_text("\n".join([f"{name}{delimiter}X1A", *rows]) + "\n", "utf-8")
    write_manifest(tmp_path, name)
    record = load_campaign(tmp_path).run("one").record("X1A")
    assert record.rate == pytest.approx(RATE, rel=1e-6)
    np.testing.assert_allclose(record.time, TIME, atol=1e-7)
    np.testing.assert_allclose(record.values, 1e-6 * X, atol=1e-14)
    export = read_export(tmp_path / "one.csv")
    assert list(export.clocks) == [name]
    assert [s.name for s in export.series] == ["X1A"]
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
    ],
)
def test_stamps_coarser_than_the_samples_are_spread_evenly_and_midnight_is_no_step_back(cells, step):
    time, bad = stamp_seconds(cells)
    assert bad == 0
    np.testing.assert_allclose(np.diff(time), step, rtol=0.01 if step < 0.1 else 1e-8)


def test_a_cell_that_is_no_stamp_is_named_by_its_line(tmp_path):
    rows = [f"2019-07-22T11:31:{22 + t:09.6f},{x:.9f}" for t, x in zip(TIME, X)]
    rows[300] = "yesterday,0.1"
    (tmp_path / "one.csv").write_text("\n".join(["timestamp,X1A", *rows]) + "\n")
    write_manifest(tmp_path, "timestamp")
    with pytest.raises(RigDataError, match=r"line 302, column 1 \(timestamp\): 'yesterday' is not a time stamp"):
        load_campaign(tmp_path).run("one").record("X1A")


def lvm(x_columns: str, separator: str = "\t", decimal: str = ".", segments: int = 1) -> str:
    """Two channels at 1 kHz and one at 100 Hz, as LabVIEW writes them."""

    def number(value: float) -> str:
        return f"{value:.9f}".replace(".", decimal)

    stated = {"\t": "Tab", ",": "Comma", ";": "Semicolon"}[separator]
    lines = [
        "LabVIEW Measurement",
        f"Writer_Version{separator}2",
        f"Separator{separator}{stated}",
        f"Decimal_Separator{separator}{decimal}",
        f"X_Columns{separator}{x_columns}",
        "***End_of_Header***",
        "",
    ]
    slow = COUNT // 10
    for part in range(segments):
        begin = f"11:31:{22 + part * COUNT / RATE:012.9f}".replace(".", decimal)
        heading = [
            ["Channels", "3"],
            ["Samples", str(COUNT), str(COUNT), str(slow)],
            ["Date", *["2019/07/22"] * 3],
            ["Time", *[begin] * 3],
            ["Y_Unit_Label", "V", "mV", "degC"],
            ["X_Dimension", *["Time"] * 3],
            ["X0", *[number(0.0)] * 3],
            ["Delta_X", number(1 / RATE), number(1 / RATE), number(10 / RATE)],
        ]
        lines += [separator.join([*row, ""]) for row in heading] + ["***End_of_Header***" + separator * 3]
        multi = x_columns == "Multi"
        names = ["X_Value", "X1A", "X_Value", "L1H", "X_Value", "T1"] if multi else ["X_Value", "X1A", "L1H", "T1"]
        lines.append(separator.join([*names, "Comment"]))
        for i in range(COUNT):
            x = number(i / RATE)
            y = [number(X[i] + part), number(-X[i]), number(40.0 + i) if i < slow else ""]
            cells = {
                "One": [x, *y],
                "No": ["", *y],
                "Multi": [x, y[0], x, y[1], number(10 * i / RATE) if y[2] else "", y[2]],
            }
            lines.append(separator.join([*cells[x_columns], "a remark" if i == 3 else ""]))
        lines.append("")
    return "\r\n".join(lines)


@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", "."), (";", ",")])
@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
def test_labview_measurement_files_of_every_layout(tmp_path, x_columns, separator, decimal):
    path = tmp_path / "a.lvm"
    path.write_text(lvm(x_columns, separator, decimal), newline="")
    x, force, warm = read_series(path, "a.lvm")
    assert [(s.name, s.unit) for s in (x, force, warm)] == [("X1A", "V"), ("L1H", "mV"), ("T1", "degC")]
    assert (x.rate, warm.rate) == (RATE, RATE / 10)
    np.testing.assert_allclose(x.values, X, atol=1e-9)
    assert (len(warm), warm.values[-1]) == (COUNT // 10, pytest.approx(40.0 + COUNT // 10 - 1))


def test_segments_of_a_labview_file_follow_each_other(tmp_path):
    path = tmp_path / "a.lvm"
    path.write_text(lvm("One", segments=3), newline="")
    x = read_series(path, "a.lvm")[0]
    assert len(x) == 3 * COUNT
    np.testing.assert_allclose(x.time, np.arange(3 * COUNT) / RATE, atol=1e-9)
    assert x.values[-1] == pytest.approx(X[-1] + 2)


def test_a_labview_file_whose_rows_end_before_the_column_of_comments(tmp_path):
    lines = [line.removesuffix("\t") for line in lvm("One").replace("a remark", "").split("\r\n")]
    (tmp_path / "a.lvm").write_text("\r\n".join(lines), newline="")
    np.testing.assert_allclose(read_series(tmp_path / "a.lvm", "a.lvm")[1].values, -X, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.lvm", "time,X1A\n0,1\n", "does not begin with 'LabVIEW Measurement'"),
        ("b.lvm", lvm("One").replace(f"{X[7]:.9f}", "seven"), "text among its numbers"),
        ("c.lvm", lvm("One")[:300], "holds no channel over time"),
        ("a.tmds", "x", "did you mean .tdms"),
        ("b.xlsx", "x", "export it as .csv"),
        ("c.tdm", "x", "did you mean .tdms"),
    ],
)
def test_what_cannot_be_read_says_why(tmp_path, name, content, says):
    (tmp_path / name).write_text(content, newline="")
    with pytest.raises(RigDataError, match=says):
        read_series(tmp_path / name, name)


def test_a_universal_file_without_time_records_says_what_it_holds(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "a.uff"
    frequency = np.arange(16.0)
    data = pyuff.prepare_58(
        binary=0, func_type=4, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, x=frequency, data=frequency * (1 + 1j),
        id1="H", abscissa_spec_data_type=18, ordinate_spec_data_type=12, orddenom_spec_data_type=13,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(data, "add")
    with pytest.raises(RigDataError, match="no record over time, only 1 x function type 4"):
        read_series(path, "a.uff")


@pytest.mark.parametrize("rows", [False, True])
def test_a_matrix_is_named_by_the_texts_beside_it(tmp_path, rows):
    data = np.stack([TIME, X, -X], axis=1)
    names, units = np.array(["Time", "X1A", "L1H"], dtype=object), np.array(["ms", "V", "mV"], dtype=object)
    savemat(tmp_path / "a.mat", {"Data": data.T if rows else data, "ChannelNames": names, "ChannelUnits": units})
    x, force = read_series(tmp_path / "a.mat", "a.mat")
    assert [(s.name, s.unit) for s in (x, force)] == [("X1A", "V"), ("L1H", "mV")]
    np.testing.assert_allclose(x.values, X)
    assert x.rate == pytest.approx(1e3 * RATE)


def test_a_matrix_in_a_file_of_version_seven_three_is_named_likewise(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["Data"] = np.stack([TIME, X, -X])  # MATLAB's columns are rows here
        cells = []
        for i, name in enumerate(["Time", "X1A", "L1H"]):
            text = file.create_dataset(f"#refs#/{i}", data=np.array([[ord(c)] for c in name], dtype=np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(text.ref)
        file.create_dataset("ChannelNames", data=np.array([cells], dtype=object).T, dtype=h5py.ref_dtype)
    x, force = read_series(tmp_path / "a.mat", "a.mat")
    assert (x.name, force.name) == ("X1A", "L1H")
    np.testing.assert_allclose(x.values, X)
    assert x.rate == pytest.approx(RATE)
