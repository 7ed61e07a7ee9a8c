"""Coefficients for rotordynamic programs."""

import importlib.metadata as metadata
import math
import os
import re
import subprocess
import sys
import time
import tomllib
import types
from dataclasses import replace
from unittest import mock

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat

import tpjb_ident as ti
from model.bearing_file import load_bearing
from rigdata import load_campaign
from rigdata.operating_point import ROTATIONS
from tests.command_line import ended
from tpjb_ident.columns import use_units
from tpjb_ident.compare.coefficient_table import read_rows
from tpjb_ident.errors import NotTrustedError
from tpjb_ident.exports.formats import (
    COLUMNS,
    FORMATS,
    ExportError,
    check_format,
    chosen_rows,
    turning_counter_clockwise,
)
from tpjb_ident.exports.structural import sep005
from tpjb_ident.exports.write import export
from tpjb_ident.exports.writers import (
    grids,
    ross_version,
    write_ansys,
    write_csv,
    write_dyrobes,
    write_excel,
    write_mat,
    write_parquet,
    write_ross,
    write_us,
    write_xltrc,
)


def table(points):
    rows = []
    for load, frequency in points:
        row = {"static_load_N": load, "static_load_direction_deg": -90.0, "shaft_speed_Hz": 22.0,
               "excitation_Hz": frequency}  # fmt: skip
        row |= {column: (i + 1) * 1e5 * load + frequency for i, column in enumerate(COLUMNS.values())}
        rows.append(row)
    return pd.DataFrame(rows)


ROTOR = ("ross", "xltrc", "dyrobes", "ansys")
SERIES = [(5000.0, 25.0), (5000.0, 10.0), (5000.0, 40.0), (2500.0, 25.0)]
SIX = [(5000.0, f) for f in (10.0, 20.0, 25.0, 30.0, 40.0, 50.0)]


def rows_of(frame):
    """Rows as a writer gets them."""
    return turning_counter_clockwise(chosen_rows(frame).table)


@pytest.fixture
def points():
    return rows_of(table(SERIES))


@pytest.fixture(params=sorted(FORMATS))
def to(request):
    """Every format whose library is there."""
    if request.param == "excel":
        pytest.importorskip("openpyxl")
    return request.param


def test_points_are_grouped_and_sorted_and_those_without_an_answer_left_out_aloud():
    frame = table(SERIES)
    chosen = chosen_rows(frame)
    assert chosen.table["static_load_N"].tolist() == [2500.0, 5000.0, 5000.0, 5000.0]
    assert chosen.table["excitation_Hz"].tolist() == [25.0, 10.0, 25.0, 40.0]
    assert chosen.table["kxx_N_per_m"].tolist()[1:] == [5e8 + 10, 5e8 + 25, 5e8 + 40]
    assert chosen.left_out == chosen.doubtful == ()
    frame.loc[3, "cyy_Ns_per_m"] = math.nan
    chosen = chosen_rows(frame)
    assert chosen.table["static_load_N"].tolist() == [5000.0] * 3
    assert chosen.left_out == ("2.5 kN, 25 Hz",)


def ross_elements(folder, points, version):
    """Elements of the files that are written for ROSS, by tag, and their heads."""
    folder.mkdir(exist_ok=True)
    write_ross(folder, points, "campaign\nx", version)
    elements, heads = {}, {}
    for path in sorted(folder.glob("ross_*.toml")):
        text = path.read_text(encoding="utf-8")
        ((name, element),) = tomllib.loads(text).items()
        assert name == f"BearingElement_{element['tag']}"
        assert path.name == f"ross_{element['tag']}.toml"
        elements[element["tag"]], heads[element["tag"]] = element, text.partition('["')[0]
    return elements, heads


def test_ross_2_takes_the_excitation_for_its_frequency_and_says_not_to_migrate_it(tmp_path, points):
    elements, heads = ross_elements(tmp_path, points, 2)
    element = elements["5000N_-90deg_22Hz_excitation"]
    assert {len(element[key]) for key in element if key[0] in "kc"} == {3}
    assert np.allclose(element["frequency"], 2 * math.pi * points["excitation_Hz"][1:])
    assert element["kyx"] == points["kyx_N_per_m"].tolist()[1:]
    head = heads["5000N_-90deg_22Hz_excitation"]
    assert "# For ROSS 2, as chosen." in head
    assert "Do not migrate" in head
    assert "--ross 3" in head
    assert head.startswith("# campaign x\n")
    constant = elements["2500N_-90deg_22Hz_excitation"]
    assert not {"frequency", "speed"} & set(constant)
    assert len(constant["kxx"]) == 1


def over_speeds(frequencies):
    """A table with these excitation frequencies [Hz] at each shaft speed [Hz]."""
    frames = []
    for speed, lines in frequencies.items():
        frame = table([(5000.0, line) for line in lines]).assign(shaft_speed_Hz=speed)
        frame["kxy_N_per_m"] = 1e6 * speed + 1e3 * frame["excitation_Hz"]
        frames.append(frame)
    return rows_of(pd.concat(frames))


@pytest.mark.parametrize(
    ("frequencies", "axes"),
    [
        ({22.0: [10.0, 20.0, 30.0]}, {"frequency": 3}),
        ({22.0: [10.0, 20.0, 30.0], 33.0: [10.0, 20.0, 30.0]}, {"speed": 2, "frequency": 3}),
        ({22.0: [10.0, 22.0], 33.0: [10.0, 22.0]}, {"speed": 2, "frequency": 2}),
        ({22.0: [25.0], 33.0: [25.0], 44.0: [25.0]}, {"speed": 3}),
        ({22.0: [22.0], 33.0: [33.0]}, {"speed": 2}),
        ({22.0: [25.0]}, {}),
    ],
    ids=["excitation", "both", "both, running speed among them", "speed", "synchronous", "one point"],
)
def test_ross_3_gets_the_axes_that_the_campaign_has_by_their_names(tmp_path, frequencies, axes):
    elements, heads = ross_elements(tmp_path, over_speeds(frequencies), 3)
    (element,), (head,) = elements.values(), heads.values()
    assert {name: len(element[name]) for name in ("speed", "frequency") if name in element} == axes
    shape = tuple(axes[name] for name in ("speed", "frequency") if name in axes) or (1,)
    assert {np.shape(element[name]) for name in COLUMNS} == {shape}
    expected = np.array([[1e6 * speed + 1e3 * line for line in lines] for speed, lines in frequencies.items()])
    assert np.allclose(np.ravel(element["kxy"]), expected.ravel())
    if "speed" in element:
        assert np.allclose(element["speed"], 2 * math.pi * np.array(list(frequencies)))
    assert "For ROSS 3, as chosen." in head
    assert "migrate" not in head


def test_speeds_that_were_run_at_other_frequencies_are_elements_of_their_own(tmp_path):
    elements, _ = ross_elements(tmp_path, over_speeds({22.0: [10.0, 20.0], 33.0: [10.0, 30.0]}), 3)
    assert sorted(elements) == ["5000N_-90deg_22Hz_excitation", "5000N_-90deg_33Hz_excitation"]
    assert all("speed" not in element for element in elements.values())


@pytest.mark.parametrize(
    ("installed", "answer"),
    [("2.3.0", (2, "the one that is installed")), ("3.1.0", (3,)), (metadata.PackageNotFoundError("ross"), (3,))],
)
def test_without_a_choice_ross_is_what_is_installed_else_3(monkeypatch, installed, answer):
    monkeypatch.setattr(metadata, "version", mock.Mock(side_effect=[installed]))
    assert ross_version()[: len(answer)] == answer
    assert ross_version(2) == (2, "as chosen")


@pytest.mark.parametrize(
    ("to", "version", "says"), [("ross", 4, "Use 2 or 3"), ("mat", 3, "belongs to the format ross")]
)
def test_a_version_of_ross_that_is_none_is_refused(tmp_path, to, version, says):
    with pytest.raises(ExportError, match=says):
        export(table(SERIES), to, tmp_path / "o", ross=version)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("to", ROTOR)
def test_rotor_programs_get_the_mirror_image_of_a_shaft_that_turns_clockwise(to, tmp_path):
    frame = doubtful_table().assign(rotation="clockwise", static_load_direction_deg=-60.0, quality="ok").iloc[:2]
    written = export(frame, to, tmp_path, force=True)
    intervals = pd.read_csv(tmp_path / "bearing_coefficients_intervals.csv").sort_values("frequency_rad_per_s")
    frame = frame.sort_values("excitation_Hz")
    assert set(intervals["rotation"]) == {"counter-clockwise"}
    assert set(intervals["static_load_direction_deg"]) == {-120.0}
    for name, column in COLUMNS.items():
        sign, ends = (-1, ("_hi", "_lo")) if name[1] != name[2] else (1, ("_lo", "_hi"))
        assert np.allclose(intervals[column], sign * frame[column])
        assert np.allclose(intervals[f"{column}_lo"], sign * frame[column + ends[0]])
        assert np.allclose(intervals[f"{column}_hi"], sign * frame[column + ends[1]])
    text = next(tmp_path.glob(f"{to}_*")).read_text(encoding="utf-8")
    assert "mirrored, x to -x" in text
    numbers = [float(number) for number in re.findall(r"-?\d+\.\d+(?:[eE][+-]?\d+)?", text)]
    assert np.isclose(numbers, -frame["kxy_N_per_m"].iloc[0]).any()
    assert set(written.chosen.table["static_load_direction_deg"]) == {-60.0}


@pytest.mark.parametrize("to", ROTOR)
def test_a_campaign_of_both_senses_leaves_with_both(to, tmp_path):
    senses = [table(SERIES[:3]).assign(rotation=sense) for sense in ROTATIONS]
    written = export(pd.concat(senses, ignore_index=True), to, tmp_path)
    files = [name for name in written.files if name.startswith(to)]
    mirrored = [name for name in files if "_mirrored" in name]
    assert 2 * len(mirrored) == len(files) > 0
    assert {name.replace("_mirrored", "") for name in mirrored} == set(files) - set(mirrored)
    for name in files:
        assert ("mirrored, x to -x" in (tmp_path / name).read_text(encoding="utf-8")) == (name in mirrored)
    intervals = pd.read_csv(tmp_path / "bearing_coefficients_intervals.csv")
    first, second = (intervals[intervals["kxy_N_per_m"] * sign > 0] for sign in (1, -1))
    assert np.allclose(first["kyx_N_per_m"], -second["kyx_N_per_m"])
    assert len(first) == len(second) == 3


def test_tables_stay_in_the_frame_of_the_rig_and_say_how_the_shaft_turns(tmp_path):
    frame = table(SERIES).assign(rotation=["clockwise", "clockwise", "clockwise", "counter-clockwise"])
    export(frame, "csv", tmp_path)
    written = pd.read_csv(tmp_path / "bearing_coefficients.csv")
    assert written["rotation"].tolist() == ["counter-clockwise", *["clockwise"] * 3]
    assert np.allclose(written["kxy_N_per_m"][1:], sorted(frame["kxy_N_per_m"][:3]))


def test_exported_tables_are_read_back_at_their_own_frequencies(tmp_path, points):
    write_csv(tmp_path, points, "c")
    write_us(tmp_path, points, "bearing_coefficients")
    frame = pd.read_csv(tmp_path / "bearing_coefficients.csv")
    assert set(frame["shaft_speed_rpm"]) == {1320.0}
    assert frame["frequency_rad_per_s"].iloc[0] == pytest.approx(2 * math.pi * 25)
    for name in ("bearing_coefficients.csv", "bearing_coefficients_us.csv"):
        rows = read_rows(tmp_path / name)
        for column in ("excitation_Hz", "static_load_N", "kyy_N_per_m"):
            assert list(rows[column]) == pytest.approx(list(points[column]))


def test_matlab_gets_matrices(tmp_path, points):
    write_mat(tmp_path, points, "c")
    bearing = loadmat(tmp_path / "bearing_coefficients.mat")["bearing"].ravel()
    assert bearing[1]["K"].shape == (2, 2, 3)
    assert bearing[1]["K"][0, 1, 2] == points["kxy_N_per_m"][3]
    assert bearing[1]["C"][1, 0, 0] == points["cyx_Ns_per_m"][1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: chosen_rows(f.drop(columns="kxy_N_per_m")), "no column kxy_N_per_m"),
        (lambda f: chosen_rows(pd.concat([f, f])), "stands twice"),
        (lambda f: chosen_rows(f.assign(kxx_N_per_m=math.nan)), "finite"),
        (lambda f: check_format("dyrobe"), "^format 'dyrobe' is not known. Did you mean 'dyrobes'"),
    ],
)
def test_what_cannot_be_exported_is_refused(change, says):
    with pytest.raises(ExportError, match=says):
        change(table(SERIES))


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
    assert written.chosen.table["excitation_Hz"].tolist() == [10.0, 25.0]
    assert len(written.chosen.doubtful) == 2
    assert "kxx is negative (-64 MN/m)" in written.chosen.doubtful[0]
    assert "ill-conditioned" in written.chosen.doubtful[1]


def test_intervals_and_flags_leave_with_every_format(to, tmp_path):
    export(doubtful_table(), to, tmp_path, force=True)
    if to in ROTOR:
        frame = pd.read_csv(tmp_path / "bearing_coefficients_intervals.csv")
        texts = [path.read_text(encoding="utf-8") for path in tmp_path.glob(f"{to}_*")]
        assert sum("NOT TO BE TRUSTED" in text for text in texts) == 2
    elif to == "mat":
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


def test_nothing_leaves_where_nothing_can_be_trusted_or_has_converged(tmp_path):
    with pytest.raises(NotTrustedError, match="no point can be trusted"):
        export(doubtful_table().assign(quality="negative-damping"), "csv", tmp_path / "o")
    assert not (tmp_path / "o").exists()
    frame = table(SERIES).assign(converged=[True, False, True, True], status="")
    assert "did not converge" in export(frame, "csv", tmp_path).chosen.doubtful[0]


@pytest.mark.parametrize("to", ["csv", "ross"])
def test_a_prediction_leaves_as_what_was_identified_does(to, tmp_path, rocker_file):
    prediction = ti.predict(rocker_file, 5000.0, speed=138.0, excitation=[157.0, 200.0], thermal="isothermal")
    written = ti.export(prediction, to, tmp_path / "o")
    assert written.chosen.table["kyy_N_per_m"].tolist() == prediction.kyy.tolist()
    assert "a prediction" in (tmp_path / "o" / written.files[-1]).read_text() or to == "csv"


def test_the_command_line_says_what_stayed_behind_and_exits_with_three(tmp_path):
    doubtful_table().to_csv(tmp_path / "coefficients.csv", index=False)
    refused = ended(3, "export", tmp_path, "--to", "csv", "--out", tmp_path / "o")
    assert "kxx is negative" in refused.stderr
    assert "--force" in refused.stderr
    ended(3, "export", tmp_path, "--to", "csv", "--out", tmp_path / "f", "--force")
    assert len(pd.read_csv(tmp_path / "f" / "bearing_coefficients.csv")) == 4


def test_parquet_keeps_the_numbers_and_their_source(tmp_path, points):
    write_parquet(tmp_path, points, "campaign x")
    read = pq.read_table(tmp_path / "bearing_coefficients.parquet")
    assert read.num_rows == 4
    assert read.schema.metadata[b"source"] == b"campaign x"
    assert read.column("kxx_N_per_m")[1].as_py() == points["kxx_N_per_m"][1]


@pytest.mark.parametrize("start", ["=", "+", "-", "@"])
def test_no_text_of_an_excel_file_is_a_formula(tmp_path, points, start, monkeypatch):
    openpyxl = pytest.importorskip("openpyxl")
    write_excel(tmp_path, points, f"{start}cmd|' /C calc'!A0")
    book = openpyxl.load_workbook(tmp_path / "bearing_coefficients.xlsx")
    cells = [cell for sheet in book for row in sheet.iter_rows() for cell in row]
    assert {cell.data_type for cell in cells} <= {"n", "s", "inlineStr", "b"}
    assert book["about"]["A1"].value.startswith(start)
    sheet = book["coefficients"]
    assert sheet.max_row == 5
    names = [cell.value for cell in sheet[1]]
    assert sheet.cell(3, names.index("kxx_N_per_m") + 1).value == points["kxx_N_per_m"][1]
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(ExportError, match=r"tpjb-ident\[excel\]"):
        write_excel(tmp_path, points, "x")


def speeds():
    frame = pd.concat([table([(5000.0, 25.0), (2500.0, 25.0)]).assign(shaft_speed_Hz=s) for s in (33.0, 22.0)])
    frame["kyx_N_per_m"] = frame["shaft_speed_Hz"] * 1e6
    return rows_of(frame)


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
    assert [int(v) for v in first.split("  ")[0].split(",")] == [2, 3, 8, 0, 0, 0, 0]  # 3: s, m, N, kg
    assert float(rows[1].split(",")[3]) == 33e6
    lines = (tmp_path / "ansys_5000N_-90deg_25Hz.txt").read_text(encoding="utf-8").splitlines()
    assert [int(lines[3][i : i + 10]) for i in (0, 10, 20)] == [2, 0, 1]
    assert (int(lines[4][:10]), float(lines[4][10:20])) == (1, 1320.0)
    assert float(lines[5][30:45]) == 22e6
    assert all(len(line) <= 80 for line in lines)


LBF_PER_INCH = 4.4482216152605 / 0.0254


def rows_of_a_rotor_program(path, to):
    """Speeds and coefficients of a file, and what it says of its units."""
    lines = path.read_text(encoding="utf-8").splitlines()
    if to == "ansys":
        counts, *rows = lines[3:]
        cells = [f"{speed[10:]} {k} {c}" for speed, k, c in zip(rows[::3], rows[1::3], rows[2::3], strict=True)]
        return np.loadtxt(cells, ndmin=2), int(counts[10:20])
    first = lines.index(next(line for line in lines if re.match(r"\d", line)))
    if to == "dyrobes":
        return np.loadtxt(lines[first + 1 :], delimiter=",", ndmin=2), int(lines[0].split(",")[1])
    return np.loadtxt(lines[first:], ndmin=2), re.findall(r"\((.+?)\)", lines[first - 1])


@pytest.mark.slow
@pytest.mark.usefixtures("us")
def test_every_format_writes_us_units_or_refuses_them_by_name(to, tmp_path):
    frame = doubtful_table()
    if to == "ross":
        with pytest.raises(ExportError, match="US units: the format ross is SI"):
            export(frame, to, tmp_path / "o")
        assert not (tmp_path / "o").exists()
        return
    written = export(frame, to, tmp_path, force=True)
    rotor = to in ROTOR
    stem = "bearing_coefficients_intervals" if rotor else "bearing_coefficients"
    assert f"{stem}_us.csv" in written.files
    table_us = pd.read_csv(tmp_path / f"{stem}_us.csv")
    point = written.chosen.table.query("static_load_N == 5000")
    at_point = np.isclose(table_us["static_load_lbf"], 5000.0 / 4.4482216152605)
    assert np.allclose(table_us["kxy_lbf_per_in_hi"][at_point], point["kxy_N_per_m_hi"] / LBF_PER_INCH)
    assert np.allclose(table_us["cyy_lbfs_per_in"][at_point], point["cyy_Ns_per_m"] / LBF_PER_INCH)
    assert table_us["shaft_speed_rpm"].unique().tolist() == [1320.0]
    assert not [name for name in table_us if re.search(r"_N\b|_N_|_Ns_|_m\b", name)]
    if rotor:
        path = tmp_path / f"{to}_5000N_-90deg_25Hz.txt"
        cells, units = rows_of_a_rotor_program(path, to)
        at_25_hz = point[list(COLUMNS.values())].iloc[1]
        assert np.allclose(cells[0], [1320.0, *(value / LBF_PER_INCH for value in at_25_hz)], rtol=1e-6)
        assert units == {"xltrc": ["rpm", *["lbf/in"] * 4, *["lbf-s/in"] * 4], "dyrobes": 2, "ansys": 1}[to]
        text = path.read_text(encoding="utf-8")
        assert "static load 1124.04 lbf" in text
        assert to == "ansys" or f"{stem}_us.csv" in text


@pytest.mark.parametrize("to", ["csv", "parquet", "excel", "mat"])
def test_tables_stay_si_beside_those_in_us_units(to, tmp_path):
    if to == "excel":
        pytest.importorskip("openpyxl")
    for system in ("si", "us"):
        use_units(system)
        try:
            export(table(SERIES), to, tmp_path / system)
        finally:
            use_units("si")
    (path,) = (tmp_path / "si").iterdir()
    assert path.read_bytes() == (tmp_path / "us" / path.name).read_bytes()


def test_the_command_line_exports_us_units_and_refuses_them_for_ross(tmp_path):
    table(SERIES).to_csv(tmp_path / "coefficients.csv", index=False)
    refused = ended(2, "export", tmp_path, "--to", "ross", "--units", "us", "--out", tmp_path / "r")
    assert "Leave US units out" in " ".join(refused.stderr.split())
    done = ended(0, "export", tmp_path, "--to", "parquet", "--units", "us", "--out", tmp_path / "o")
    assert "bearing_coefficients_us.csv" in " ".join(done.output.split())
    frame = pd.read_csv(tmp_path / "o" / "bearing_coefficients_us.csv")
    assert frame["kxx_lbf_per_in"].max() == pytest.approx(5.0e8 / LBF_PER_INCH, rel=1e-6)


def test_a_synchronous_prediction_is_named_so():
    (grid,) = grids(over_speeds({20.0: [20.0], 30.0: [30.0]}), "speed")
    assert grid.name(grid.line) == "5000N_-90deg_synchronous"
    assert grid.speed.tolist() == [20.0, 30.0]


def test_records_become_dictionaries_that_sdypy_accepts(small_campaign):
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
import sys, tomllib, warnings
from pathlib import Path
import numpy as np
import ross as rs
from ross.bearing_seal_element import BearingElement
warnings.simplefilter("ignore")
for path in sorted(Path(sys.argv[1]).glob("ross_*.toml")):
    written = next(iter(tomllib.loads(path.read_text(encoding="utf-8")).values()))
    element = BearingElement.load(path)
    for i, omega in enumerate(written.get("frequency", [157.0])):
        for kind, matrix, smoothing in (("k", element.K(omega), 3.0), ("c", element.C(omega), 3.0)):
            for j, entry in enumerate(("xx", "xy", "yx", "yy")):
                value = written[kind + entry][i]
                off = abs(np.asarray(matrix)[j // 2, j % 2] - value)
                assert off <= max(1e-6 * abs(value), smoothing), (path.name, kind + entry, omega, off, value)
    shaft = [rs.ShaftElement(L=0.25, idl=0, odl=0.1, material=rs.steel) for _ in range(6)]
    disk = rs.DiskElement.from_geometry(n=3, material=rs.steel, width=0.1, i_d=0.1, o_d=0.4)
    ends = []
    for node in (0, 6):
        ends.append(BearingElement.load(path))
        ends[-1].n, ends[-1].tag = node, f"end {node}"
    rotor = rs.Rotor(shaft, [disk], ends)
    speeds = np.linspace(60.0, 300.0, 5)
    campbell = rotor.run_campbell(speeds)
    response = rotor.run_unbalance_response(3, 1e-3, 0.0, speeds)
    assert np.isfinite(campbell.wd).all() and np.isfinite(response.forced_resp).all()
    print("read", path.name, rs.__version__)
"""


@pytest.mark.slow
def test_ross_itself_reads_what_was_written(tmp_path):
    """Needs ross-rotordynamics, which is large: TPJB_ROSS_PYTHON names a Python that has it, else this one is tried.

    ROSS 2 smooths: a spline may leave a root mean square of 1 N/m and 1 N s/m over the frequencies of an element.
    """
    python = os.environ.get("TPJB_ROSS_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import ross"], capture_output=True, cwd=tmp_path).returncode:
        pytest.skip("ross-rotordynamics is not installed; TPJB_ROSS_PYTHON can name a Python that has it")
    write_ross(tmp_path, rows_of(table([*SIX, (2500.0, 25.0)])), "c", 2)
    campaign = ti.load_campaign("rigdata/samples/demo.h5")
    write_ross(tmp_path, rows_of(ti.identify(campaign).to_frame()), "demo", 2)
    done = subprocess.run([python, "-c", ROSS, str(tmp_path)], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.count("read ross_") == len(list(tmp_path.glob("ross_*.toml")))


@pytest.mark.slow
def test_the_same_results_are_the_same_bytes(tmp_path):
    pytest.importorskip("openpyxl")
    forms = ("parquet", "excel", "mat")
    for form in forms:
        export(table(SERIES), form, tmp_path / form / "a")
    time.sleep(1.1)  # the times that libraries write are in seconds
    for form in forms:
        export(table(SERIES), form, tmp_path / form / "b")
        (first,), (second,) = ((tmp_path / form / name).iterdir() for name in "ab")
        assert first.read_bytes() == second.read_bytes(), form


def ross_call(tmp_path, bearing, version, monkeypatch):
    """Arguments that the written function hands to TiltingPad, and the text."""
    export(bearing, "ross", tmp_path, ross=version)
    text = (tmp_path / "ross_bearing.py").read_text(encoding="utf-8")
    monkeypatch.setitem(sys.modules, "ross", types.SimpleNamespace(TiltingPad=lambda **arguments: arguments))
    space = {}
    exec(compile(text, "ross_bearing.py", "exec"), space)
    return space["bearing"](3, [138.2], 10.0, -5000.0, n_link=7), text


@pytest.mark.parametrize("version", [2, 3])
def test_a_bearing_file_leaves_as_the_call_that_builds_it_in_ross(tmp_path, rocker_file, version, monkeypatch):
    bearing = load_bearing(rocker_file)
    call, text = ross_call(tmp_path, bearing, version, monkeypatch)
    assert (call["n"], call["n_link"]) == (3, 7)
    theirs = {2: ("frequency", "pre_load", "determine_eccentricity"), 3: ("speed", "preload", "match_load")}[version]
    assert call[theirs[0]] == [138.2]
    assert call["equilibrium_type"] == theirs[2]
    load = call["load"] if version == 2 else [call["fxs_load"], call["fys_load"]]
    assert load == [10.0, -5000.0]
    for pad, preload, angle, arc in zip(
        bearing.pads, call[theirs[1]], call["pivot_angle"], call["pad_arc"], strict=True
    ):
        assert call["radial_clearance"] / (1 - preload) == pytest.approx(pad.pad_clearance)
        assert (angle, arc) == (pad.pivot_angle, pad.arc)
    oil = call["lubricant"]
    rate = math.log(oil["liquid_viscosity1"] / oil["liquid_viscosity2"]) / (oil["temperature2"] - oil["temperature1"])
    at_50 = oil["liquid_viscosity1"] * math.exp(-rate * (323.15 - oil["temperature1"]))
    assert at_50 == pytest.approx(bearing.oil.viscosity(50.0))
    assert call["oil_supply_temperature"] == pytest.approx(bearing.oil.supply_temperature + 273.15)
    assert "# - pivots (rocker)" in text
    assert "by pad" not in text


def test_what_a_call_of_ross_cannot_hold_of_pads_that_differ_stands_in_its_head(tmp_path, rocker_file, monkeypatch):
    bearing = load_bearing(rocker_file)
    first, *others = bearing.pads
    own = replace(first, pivot_offset=0.6, assembled_clearance=70e-6, pad_clearance=120e-6)
    bearing = bearing.with_pads((own, *others))
    call, text = ross_call(tmp_path, bearing, 2, monkeypatch)
    assert "assembled clearance by pad (70, 80, 80, 80, 80 um)" in text
    assert "ROSS 2 takes arc, offset and preload of the first" in text
    assert call["offset"] == [0.6, 0.5, 0.5, 0.5, 0.5]
    assert call["radial_clearance"] / (1 - call["pre_load"][0]) == pytest.approx(120e-6)
    _, text = ross_call(tmp_path, bearing, 3, monkeypatch)
    assert "takes arc" not in text


def test_a_bearing_that_turns_clockwise_is_mirrored_for_ross(tmp_path, rocker_file, monkeypatch):
    bearing = replace(load_bearing(rocker_file), rotation="clockwise")
    bearing = bearing.with_pads(tuple(replace(p, pivot_offset=0.5 + 0.01 * k) for k, p in enumerate(bearing.pads)))
    call, text = ross_call(tmp_path, bearing, 3, monkeypatch)
    assert "mirror image, x to -x, last pad first" in text
    assert call["offset"] == [pad.pivot_offset for pad in reversed(bearing.pads)]
    assert call["pivot_angle"] == [math.pi - pad.pivot_angle for pad in reversed(bearing.pads)]
    assert np.all(np.diff(call["pivot_angle"]) > 0)


def test_a_bearing_leaves_for_ross_alone(tmp_path, rocker_file):
    refused = ended(2, "export", rocker_file, "--to", "xltrc", "--out", tmp_path / "x")
    assert "leaves for ROSS alone" in " ".join(refused.stderr.split())
    ended(0, "export", rocker_file, "--to", "ross", "--ross", "3", "--out", tmp_path / "o")
    assert "ROSS 3, as chosen" in (tmp_path / "o" / "ross_bearing.py").read_text(encoding="utf-8")
