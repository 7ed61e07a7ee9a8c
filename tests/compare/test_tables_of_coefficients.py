"""`tpjb compare --coefficients`: prediction beside K and C of a table, read as `diagnose` reads them."""

import math

import numpy as np
import pandas as pd
import pytest

from model.bearing_file import load_bearing
from tests.command_line import ended
from tpjb_ident.compare.comparison import CompareSettings
from tpjb_ident.compare.predictions import ModelSettings, predict_points
from tpjb_ident.compare.tables import compare_table
from tpjb_ident.diagnosis.observations.observe import observe_table

HEAD = "static_load_N,shaft_speed_Hz,excitation_Hz,kxx_N_per_m,kyy_N_per_m,cyy_Ns_per_m,cyy_Ns_per_m_se"


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "read_off.csv"
    path.write_text("\n".join([HEAD, "5000,22,25,1.2e8,2e8,1e6,2e4", "8750,22,25,,4e8,1.4e6,"]), encoding="utf-8")
    return path


def test_the_table_is_read_as_the_diagnosis_reads_it_and_gaps_stay_gaps(table, rocker_file):
    result = compare_table(table, load_bearing(rocker_file), CompareSettings(("kirk",), "isothermal"), 0.05)
    frame, seen = result.to_dataframe(), observe_table(table, 0.05)
    told = dict(zip(((e.observable, e.place("load")) for e in seen.elements), seen.value, strict=True))
    assert frame["kyy_N_per_m"].tolist() == [told["kyy", 5000.0], told["kyy", 8750.0]]
    assert frame["cyy_Ns_per_m"][0] == pytest.approx(told["cyy", 5000.0] / (2 * math.pi * 25))
    assert frame["kyy_N_per_m_hi"][0] == pytest.approx(2e8 * (1 + 1.96 * 0.05), rel=1e-4)
    assert frame["kxx_N_per_m"][0] == 1.2e8  # though its damping is missing
    assert np.isnan(frame["kxx_N_per_m"][1])
    assert frame["kxy_N_per_m"].isna().all()


def test_predictions_are_those_of_predict_and_measured_pivots_are_no_choice(table, rocker_file):
    bearing = load_bearing(rocker_file)
    result = compare_table(table, bearing, CompareSettings(thermal="isothermal"), 0.05)
    assert list(result.predictions) == ["rigid", "kirk"]
    assert any("no dry test of pad" in remark for remark in result.remarks)
    points = [p.point for p in result.identification.points]
    own = predict_points(bearing, points, ModelSettings("kirk", "isothermal"))
    frame = result.to_dataframe()
    assert frame[frame["pivots"] == "kirk"]["kyy_N_per_m_predicted"].tolist() == [row["kyy_N_per_m"] for row in own]


def test_a_table_without_excitations_says_what_was_supposed(tmp_path):
    path = tmp_path / "read_off.csv"
    path.write_text("static_load_N,shaft_speed_Hz,kxx_N_per_m\n5000,22,1.2e8\n6000,22,1.3e8\n", encoding="utf-8")
    identification = compare_table(path, None, reading_error=0.05).identification
    frame = identification.to_frame()
    assert frame["excitation_Hz"].tolist() == [22.0, 22.0]
    assert set(frame["quality"]) == {"excitation-not-stated"}
    assert any("excitation-not-stated" in remark for remark in identification.remarks())


@pytest.mark.slow
def test_the_command_writes_table_and_page(table, rocker_file, tmp_path):
    out = tmp_path / "out"
    table.write_text(table.read_text(encoding="utf-8").replace("1.2e8,2e8", "2.4e8,4e8"), encoding="utf-8")
    result = ended(0, "compare", "--coefficients", table, "--bearing", rocker_file, "--reading-error", "5%",
                  "--thermal", "isothermal", "--out", out)  # fmt: skip
    assert len(pd.read_csv(out / "comparison.csv")) == 4
    assert "predicted and measured" in (out / "report.html").read_text(encoding="utf-8")
    assert "tpjb diagnose --coefficients" in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("more", "said"),
    [((), "one of them"), (("--coefficients", "none.csv"), "no such file"), (("--coefficients", "T"), "Add --bearing")],
)
def test_what_is_missing_is_said(table, more, said):
    result = ended(2, "compare", *(table if m == "T" else m for m in more))
    assert said in " ".join(result.output.split())


def test_our_own_table_keeps_its_whole_interval_and_its_flags(tmp_path):
    path = tmp_path / "coefficients.csv"
    path.write_text("static_load_N,shaft_speed_Hz,excitation_Hz,kyy_N_per_m,kyy_N_per_m_se,kyy_N_per_m_lo,"
                    "kyy_N_per_m_hi,quality\n5000,22,22,2e8,1e6,1.9e8,2.1e8,large-amplitude\n"
                    "8750,22,22,3e8,2e6,,,ok\n", "utf-8")  # fmt: skip
    first, second = compare_table(path, None).identification.points
    assert first.stiffness.half_width()[3] == pytest.approx(1e7, rel=1e-4)
    assert second.stiffness.half_width()[3] == pytest.approx(1.96 * 2e6, rel=1e-4)
    assert [str(c) for c in first.quality] == ["large-amplitude"]
    assert second.quality == ()
