"""Coefficients for rotordynamic programs."""

from __future__ import annotations

import math
import time
import tomllib

import numpy as np
import pandas as pd
import pytest

from tpjb_ident.errors import NotTrustedError
from tpjb_ident.exports.formats import COLUMNS, FORMATS, ExportError, export_format, static_points
from tpjb_ident.exports.rotor_programs import (
    ross_text,
    speed_tables,
    write_ansys,
    write_dyrobes,
    write_ross,
    write_xltrc,
)
from tpjb_ident.exports.structural import sep005
from tpjb_ident.exports.table import write_csv, write_excel, write_mat, write_parquet
from tpjb_ident.exports.write import export


def table(points):
    rows = []
    for load, frequency in points:
        row = {"static_load_N": load, "static_load_direction_deg": -90.0, "shaft_speed_Hz": 22.0,
               "excitation_Hz": frequency}  # fmt: skip
        row |= {column: (i + 1) * 1e5 * load + frequency for i, column in enumerate(COLUMNS.values())}
        rows.append(row)
    return pd.DataFrame(rows)


SERIES = [(5000.0, 25.0), (5000.0, 10.0), (5000.0, 40.0), (2500.0, 25.0)]
SIX = [(5000.0, f) for f in (10.0, 20.0, 25.0, 30.0, 40.0, 50.0)]


@pytest.fixture
def points():
    return static_points(table(SERIES)).points


@pytest.fixture(params=sorted(FORMATS))
def to(request):
    """Every format whose library is there."""
    if request.param == "excel":
        pytest.importorskip("openpyxl")
    return request.param


def test_points_are_grouped_and_sorted():
    chosen = static_points(table(SERIES))
    points = chosen.points
    assert [(p.load, len(p.frequency)) for p in points] == [(2500.0, 1), (5000.0, 3)]
    assert np.allclose(points[1].frequency, 2 * math.pi * np.array([10.0, 25.0, 40.0]))
    assert points[1].coefficients["kxx"].tolist() == [5e8 + 10, 5e8 + 25, 5e8 + 40]
    assert chosen.left_out == chosen.doubtful == ()


def test_points_without_an_answer_are_left_out_aloud():
    frame = table(SERIES)
    frame.loc[3, "cyy_Ns_per_m"] = math.nan
    chosen = static_points(frame)
    assert [p.load for p in chosen.points] == [5000.0]
    assert chosen.left_out == ("2500 N, 25 Hz",)


def test_ross_reads_one_table_with_arrays_of_one_length(points):
    data = tomllib.loads(ross_text(points[1], "campaign\nx"))
    assert len(data) == 1
    name, element = next(iter(data.items()))
    assert name == f"BearingElement_{element['tag']}"
    assert "excitation" in name
    assert {len(element[key]) for key in element if key[0] in "kcm" and key != "color"} == {3}
    assert len(element["frequency"]) == 3
    assert element["kyx"] == points[1].coefficients["kyx"].tolist()
    assert element["mxx"] == [0.0, 0.0, 0.0]


def test_one_frequency_becomes_constant_coefficients(points):
    element = next(iter(tomllib.loads(ross_text(points[0], "c")).values()))
    assert "frequency" not in element
    assert len(element["kxx"]) == 1


def test_ross_itself_would_interpolate_what_was_written(tmp_path):
    """The spline that ROSS uses (UnivariateSpline, default smoothing) must keep stiffness and damping."""
    from scipy.interpolate import UnivariateSpline

    points = static_points(table(SIX)).points
    write_ross(tmp_path, points, "c")
    (path,) = tmp_path.glob("ross_*.toml")
    element = next(iter(tomllib.loads(path.read_text(encoding="utf-8")).values()))
    for key in ("kxx", "kyy", "cxx", "cyy"):
        spline = UnivariateSpline(element["frequency"], element[key])
        assert np.allclose(spline(element["frequency"]), element[key], rtol=1e-7)


def test_csv_has_speed_in_rpm_and_frequency_in_rad_per_s(tmp_path, points):
    write_csv(tmp_path, points, "c")
    frame = pd.read_csv(tmp_path / "bearing_coefficients.csv")
    assert set(frame["shaft_speed_rpm"]) == {1320.0}
    assert frame["frequency_rad_per_s"].iloc[0] == pytest.approx(2 * math.pi * 25)


def test_matlab_gets_matrices(tmp_path, points):
    from scipy.io import loadmat

    write_mat(tmp_path, points, "c")
    bearing = loadmat(tmp_path / "bearing_coefficients.mat")["bearing"].ravel()
    assert bearing[1]["K"].shape == (2, 2, 3)
    assert bearing[1]["K"][0, 1, 2] == points[1].coefficients["kxy"][2]
    assert bearing[1]["C"][1, 0, 0] == points[1].coefficients["cyx"][0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f.drop(columns="kxy_N_per_m"), "no column kxy_N_per_m"),
        (lambda f: pd.concat([f, f]), "stands twice"),
        (lambda f: f.assign(kxx_N_per_m=math.nan), "finite"),
    ],
)
def test_what_cannot_be_exported_is_refused(change, says):
    with pytest.raises(ExportError, match=says):
        static_points(change(table(SERIES)))


def test_an_unknown_format_is_answered_with_the_nearest():
    with pytest.raises(ExportError, match="Did you mean 'dyrobes'"):
        export_format("dyrobe")


def doubtful_table():
    """Intervals, flags, and at 5 kN, 40 Hz a probe of wrong polarity; 2.5 kN is ill-conditioned."""
    frame = table(SERIES)
    for column in COLUMNS.values():
        frame[f"{column}_lo"], frame[f"{column}_hi"] = 0.9 * frame[column], 1.1 * frame[column]
    frame["quality"] = ["ok", "large-amplitude", "ok", "ill-conditioned; large-amplitude"]
    for end in ("", "_lo", "_hi"):
        frame.loc[2, f"kxx_N_per_m{end}"] = -64e6
    return frame


def test_what_is_not_to_be_trusted_stays_behind(to, tmp_path):
    written = export(doubtful_table(), to, tmp_path)
    assert [len(p.frequency) for p in written.chosen.points] == [2]
    assert len(written.chosen.doubtful) == 2
    assert "kxx is negative (-64 MN/m)" in written.chosen.doubtful[0]
    assert "ill-conditioned" in written.chosen.doubtful[1]


def test_intervals_and_flags_leave_with_every_format(to, tmp_path):
    export(doubtful_table(), to, tmp_path, force=True)
    if to in {"ross", "xltrc", "dyrobes", "ansys"}:
        frame = pd.read_csv(tmp_path / "bearing_coefficients_intervals.csv")
        texts = [path.read_text(encoding="utf-8") for path in tmp_path.glob(f"{to}_*")]
        assert sum("NOT TO BE TRUSTED" in text for text in texts) == 2
    elif to == "mat":
        from scipy.io import loadmat

        bearing = loadmat(tmp_path / "bearing_coefficients.mat")["bearing"].ravel()[1]
        assert bearing["K_lo"].shape == bearing["C_hi"].shape == (2, 2, 3)
        assert bearing["trusted"].ravel().tolist() == [1, 1, 0]
        return
    else:
        read = {"csv": pd.read_csv, "parquet": pd.read_parquet, "excel": pd.read_excel}[to]
        frame = read(next(tmp_path.glob("bearing_coefficients.*")))
    assert frame["trusted"].tolist() == [False, True, True, False]
    assert frame["quality"].tolist()[1] == "large-amplitude"
    assert np.allclose(frame["cyy_Ns_per_m_hi"], 1.1 * frame["cyy_Ns_per_m"])


def test_nothing_leaves_where_nothing_can_be_trusted(tmp_path):
    frame = doubtful_table().assign(quality="negative-damping")
    with pytest.raises(NotTrustedError, match="no point can be trusted"):
        export(frame, "csv", tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_a_prediction_that_did_not_converge_stays_behind(tmp_path):
    frame = table(SERIES).assign(converged=[True, False, True, True], status="")
    assert "did not converge" in export(frame, "csv", tmp_path).chosen.doubtful[0]


def test_the_command_line_says_what_stayed_behind_and_exits_with_three(tmp_path):
    from tests.command_line import tpjb

    doubtful_table().to_csv(tmp_path / "coefficients.csv", index=False)
    refused = tpjb("export", tmp_path, "--to", "csv", "--out", tmp_path / "o")
    assert refused.exit_code == 3
    assert "kxx is negative" in refused.stderr
    assert "--force" in refused.stderr
    forced = tpjb("export", tmp_path, "--to", "csv", "--out", tmp_path / "f", "--force")
    assert forced.exit_code == 3
    assert len(pd.read_csv(tmp_path / "f" / "bearing_coefficients.csv")) == 4


def test_parquet_keeps_the_numbers_and_their_source(tmp_path, points):
    import pyarrow.parquet as pq

    write_parquet(tmp_path, points, "campaign x")
    read = pq.read_table(tmp_path / "bearing_coefficients.parquet")
    assert read.num_rows == 4
    assert read.schema.metadata[b"source"] == b"campaign x"
    assert read.column("kxx_N_per_m")[1].as_py() == points[1].coefficients["kxx"][0]


@pytest.mark.parametrize("start", ["=", "+", "-", "@"])
def test_no_text_of_an_excel_file_is_a_formula(tmp_path, points, start):
    openpyxl = pytest.importorskip("openpyxl")
    write_excel(tmp_path, points, f"{start}cmd|' /C calc'!A0")
    book = openpyxl.load_workbook(tmp_path / "bearing_coefficients.xlsx")
    cells = [cell for sheet in book for row in sheet.iter_rows() for cell in row]
    assert {cell.data_type for cell in cells} <= {"n", "s", "b"}
    assert book["about"]["A1"].value.startswith(start)
    sheet = book["coefficients"]
    assert sheet.max_row == 5
    names = [cell.value for cell in sheet[1]]
    assert sheet.cell(3, names.index("kxx_N_per_m") + 1).value == points[1].coefficients["kxx"][0]


def test_an_excel_file_without_its_library_names_the_extra(tmp_path, points, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(ExportError, match=r"tpjb-ident\[excel\]"):
        write_excel(tmp_path, points, "x")


def speeds():
    frame = pd.concat([table([(5000.0, 25.0), (2500.0, 25.0)]).assign(shaft_speed_Hz=s) for s in (33.0, 22.0)])
    frame["kyx_N_per_m"] = frame["shaft_speed_Hz"] * 1e6
    return static_points(frame).points


def test_programs_over_speed_get_one_file_per_load_and_frequency(tmp_path):
    write_xltrc(tmp_path, speeds(), "two\nlines")
    files = sorted(p.name for p in tmp_path.iterdir())
    assert files == ["xltrc_2500N_-90deg_25Hz.txt", "xltrc_5000N_-90deg_25Hz.txt"]
    comment, words, pointer, head, *rows = (tmp_path / files[1]).read_text(encoding="utf-8").splitlines()
    assert comment.startswith("* two lines")
    assert "excitation at 25 Hz" in words
    assert pointer.endswith("bearing_coefficients_intervals.csv")
    assert head.split("\t")[:5] == ["Speed (rpm)", "Kxx (N/m)", "Kxy (N/m)", "Kyx (N/m)", "Kyy (N/m)"]
    cells = np.array([[float(c) for c in row.split("\t")] for row in rows])
    assert cells[:, 0].tolist() == [1320.0, 1980.0]
    assert cells[:, 3].tolist() == [22e6, 33e6]


def test_dyrobes_and_ansys_files_have_their_fields_in_place(tmp_path):
    write_dyrobes(tmp_path, speeds(), "c")
    write_ansys(tmp_path, speeds(), "c")
    first, *rows = (tmp_path / "dyrobes_5000N_-90deg_25Hz.txt").read_text(encoding="utf-8").splitlines()
    assert [int(v) for v in first.split("  ")[0].split(",")] == [2, 4, 8, 0, 0, 0, 0]
    assert float(rows[1].split(",")[3]) == 33e6
    lines = (tmp_path / "ansys_5000N_-90deg_25Hz.txt").read_text(encoding="utf-8").splitlines()
    assert [int(lines[3][i : i + 10]) for i in (0, 10, 20)] == [2, 0, 1]
    assert (int(lines[4][:10]), float(lines[4][10:20])) == (1, 1320.0)
    assert float(lines[5][30:45]) == 22e6
    assert all(len(line) <= 80 for line in lines)


def test_a_synchronous_prediction_is_named_so():
    frame = pd.concat([table([(5000.0, s)]).assign(shaft_speed_Hz=s) for s in (20.0, 30.0)])
    (one,) = speed_tables(static_points(frame).points)
    assert one.name == "5000N_-90deg_synchronous"
    assert one.speed.tolist() == [20.0, 30.0]


def test_records_become_dictionaries_that_sdypy_accepts(small_campaign):
    from rigdata import load_campaign

    run = load_campaign(small_campaign).runs[0]
    signals = sep005(run)
    by_name = {s["name"]: s for s in signals}
    assert by_name["X1A"]["unit_str"] == "m"
    assert by_name["X1A"]["fs"] == run.sample_rate
    assert by_name["X1A"]["direction_deg"] == pytest.approx(45.0)
    assert by_name["L1H"]["data"] == pytest.approx(run.record("L1H").values)
    checker = pytest.importorskip("sdypy_sep005.sep005", reason="the checker of SDyPy is not installed")
    checker.assert_sep005(signals)


ROSS = """
import sys, tomllib
from pathlib import Path
import numpy as np
from ross.bearing_seal_element import BearingElement
for path in sorted(Path(sys.argv[1]).glob("ross_*.toml")):
    written = next(iter(tomllib.loads(path.read_text(encoding="utf-8")).values()))
    element = BearingElement.load(path)
    for i, omega in enumerate(written.get("frequency", [157.0])):
        k, c = np.asarray(element.K(omega)), np.asarray(element.C(omega))
        for name, got in (("kxx", k[0, 0]), ("kyx", k[1, 0]), ("kyy", k[1, 1]), ("cxy", c[0, 1]), ("cyy", c[1, 1])):
            assert abs(got / written[name][i] - 1) < 1e-6, (path.name, name, omega)
    print("read", path.name)
"""


@pytest.mark.slow
def test_ross_itself_reads_what_was_written(tmp_path):
    """Needs ross-rotordynamics, which is large: TPJB_ROSS_PYTHON names a Python that has it, else this one is tried."""
    import os
    import subprocess
    import sys

    python = os.environ.get("TPJB_ROSS_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import ross"], capture_output=True, cwd=tmp_path).returncode:
        pytest.skip("ross-rotordynamics is not installed; TPJB_ROSS_PYTHON can name a Python that has it")
    points = static_points(table([*SIX, (2500.0, 25.0)])).points
    write_ross(tmp_path, points, "c")
    done = subprocess.run([python, "-c", ROSS, str(tmp_path)], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.count("read ross_") == 2


@pytest.mark.parametrize("form", ["excel", "mat", "parquet"])
def test_the_same_results_are_the_same_bytes(form, tmp_path):
    if form == "excel":
        pytest.importorskip("openpyxl")
    bytes_of = []
    for name in ("a", "b"):
        export(table(SERIES), form, tmp_path / name)
        (path,) = (tmp_path / name).iterdir()
        bytes_of.append(path.read_bytes())
        time.sleep(1.1 if form != "parquet" else 0.0)  # the times that their libraries write are in seconds
    assert bytes_of[0] == bytes_of[1]
