"""Coefficients for rotordynamic programs."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pandas as pd
import pytest

from tpjb_ident.export import COLUMNS, ExportError, ross_text, static_points, write_csv, write_mat, write_ross


def table(points):
    rows = []
    for load, frequency in points:
        row = {"static_load_N": load, "static_load_direction_deg": -90.0, "shaft_speed_Hz": 22.0,
               "excitation_Hz": frequency}  # fmt: skip
        row |= {column: (i + 1) * 1e5 * load + frequency for i, column in enumerate(COLUMNS.values())}
        rows.append(row)
    return pd.DataFrame(rows)


SERIES = [(5000.0, 25.0), (5000.0, 10.0), (5000.0, 40.0), (2500.0, 25.0)]


def test_points_are_grouped_and_sorted():
    points, left_out = static_points(table(SERIES))
    assert [(p.load, len(p.frequency)) for p in points] == [(2500.0, 1), (5000.0, 3)]
    assert np.allclose(points[1].frequency, 2 * math.pi * np.array([10.0, 25.0, 40.0]))
    assert points[1].coefficients["kxx"].tolist() == [5e8 + 10, 5e8 + 25, 5e8 + 40]
    assert left_out == ()


def test_points_without_an_answer_are_left_out_aloud():
    frame = table(SERIES)
    frame.loc[3, "cyy_Ns_per_m"] = math.nan
    points, left_out = static_points(frame)
    assert [p.load for p in points] == [5000.0]
    assert left_out == ("2500 N, 25 Hz",)


def test_ross_reads_one_table_with_arrays_of_one_length():
    points, _ = static_points(table(SERIES))
    data = tomllib.loads(ross_text(points[1], "campaign\nx"))
    assert len(data) == 1
    name, element = next(iter(data.items()))
    assert name == f"BearingElement_{element['tag']}"
    assert "excitation" in name
    assert {len(element[key]) for key in element if key[0] in "kcm" and key != "color"} == {3}
    assert len(element["frequency"]) == 3
    assert element["kyx"] == points[1].coefficients["kyx"].tolist()
    assert element["mxx"] == [0.0, 0.0, 0.0]


def test_one_frequency_becomes_constant_coefficients():
    points, _ = static_points(table(SERIES))
    element = next(iter(tomllib.loads(ross_text(points[0], "c")).values()))
    assert "frequency" not in element
    assert len(element["kxx"]) == 1


def test_ross_itself_would_interpolate_what_was_written(tmp_path):
    """The spline that ROSS uses (UnivariateSpline, default smoothing) must keep stiffness and damping."""
    from scipy.interpolate import UnivariateSpline

    points, _ = static_points(table([(5000.0, f) for f in (10.0, 20.0, 25.0, 30.0, 40.0, 50.0)]))
    write_ross(tmp_path, points, "c")
    (path,) = tmp_path.glob("ross_*.toml")
    element = next(iter(tomllib.loads(path.read_text(encoding="utf-8")).values()))
    for key in ("kxx", "kyy", "cxx", "cyy"):
        spline = UnivariateSpline(element["frequency"], element[key])
        assert np.allclose(spline(element["frequency"]), element[key], rtol=1e-7)


def test_csv_has_speed_in_rpm_and_frequency_in_rad_per_s(tmp_path):
    points, _ = static_points(table(SERIES))
    write_csv(tmp_path, points, "c")
    frame = pd.read_csv(tmp_path / "bearing_coefficients.csv")
    assert set(frame["shaft_speed_rpm"]) == {1320.0}
    assert frame["frequency_rad_per_s"].iloc[0] == pytest.approx(2 * math.pi * 25)


def test_matlab_gets_matrices(tmp_path):
    from scipy.io import loadmat

    points, _ = static_points(table(SERIES))
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
