"""Tables of coefficients: K and C of a table beside the prediction, read as `diagnose` reads them, and tables of other
programs, met point by point, never interpolated (`compare --coefficients`, `compare --prediction`)."""

import json
import math

import numpy as np
import pandas as pd
import pytest

from model.bearing_file import load_bearing, parse_bearing
from rigdata import load_campaign
from tests.command_line import ended, tpjb
from tpjb_ident.compare.comparison import CompareSettings, compare_campaign
from tpjb_ident.compare.predictions import ModelSettings, predict_points
from tpjb_ident.compare.tables import compare_table, read_predictions, with_predictions
from tpjb_ident.diagnosis.observations.observe import observe_table
from tpjb_ident.errors import BadInputError
from tpjb_ident.presentation import us_table
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS

MEASURED = """static_load_N,static_load_direction_deg,shaft_speed_Hz,excitation_Hz,kxx_N_per_m,kyy_N_per_m,cyy_Ns_per_m
2500,-90,22,10,7e7,1.1e8,6e5
2500,-90,22,25,6e7,1.0e8,7e5
5000,-90,22,25,8e7,2.0e8,9e5
"""


@pytest.fixture
def measured(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text(MEASURED, encoding="utf-8")
    return path


def compared(measured, *files):
    return with_predictions(compare_table(measured, None, reading_error=0.05), read_predictions(files))


def written(tmp_path, text, name="theirs.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_meet_points_by_load_direction_speed_and_excitation_and_gaps_stay_gaps(tmp_path, measured):
    rows = "2510,22.05,25.1,1.2e8,1e-6,-2e-5\n5000,22,25,2.2e8,,\n5000,22,40,2.5e8,,\n"
    theirs = written(tmp_path, f"static_load_N,shaft_speed_Hz,excitation_Hz,kyy_N_per_m,x_m,y_m\n{rows}")
    result = compared(measured, theirs)
    frame = result.to_dataframe().set_index(["static_load_N", "excitation_Hz"])
    assert set(frame["pivots"]) == {"theirs"}
    assert frame["kyy_N_per_m_predicted"].to_dict() == pytest.approx(
        {(2500.0, 10.0): math.nan, (2500.0, 25.0): 1.2e8, (5000.0, 25.0): 2.2e8}, nan_ok=True
    )
    assert frame["kyy_N_per_m_ratio"][5000.0, 25.0] == pytest.approx(1.1)
    assert frame["y_m_predicted"][2500.0, 25.0] == -2e-5
    assert frame["kxx_N_per_m_predicted"].isna().all()
    remark, tolerances = result.remarks
    assert "predicts 2 of 3 points;" in remark
    assert "load within 1 %, direction within 1 deg, speed and excitation within 0.5 %" in tolerances
    assert "without a row: 2.5 kN at -90°, shaft at 22 Hz (1320 rpm), 10 Hz" in remark
    assert "rows that meet no point: line 4 (5 kN at -90°, shaft at 22 Hz (1320 rpm), 40 Hz)" in remark


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "meets"),
    [
        ({"load": 2524.0}, True), ({"load": 2526.0}, False),
        ({"direction": -89.1}, True), ({"direction": -88.9}, False), ({"direction": 270.0}, True),
        ({"speed": 22.1}, True), ({"speed": 22.12}, False),
        ({"excitation": 25.12}, True), ({"excitation": 25.13}, False),
        ({"rotation": "counter-clockwise"}, True), ({"rotation": "clockwise"}, False),
    ],
)  # fmt: skip
def test_tolerances_are_those_that_are_stated(tmp_path, measured, change, meets):
    row = {"load": 2500.0, "direction": -90.0, "speed": 22.0, "excitation": 25.0, "rotation": ""} | change
    head = "static_load_N,static_load_direction_deg,shaft_speed_Hz,excitation_Hz,rotation,kyy_N_per_m"
    theirs = written(tmp_path, f"{head}\n{','.join(map(str, row.values()))},1.2e8\n")
    if meets:
        frame = compared(measured, theirs).to_dataframe()
        assert frame["kyy_N_per_m_predicted"].notna().tolist() == [False, True, False]
    else:
        with pytest.raises(BadInputError, match="no row meets an operating point"):
            compared(measured, theirs)


def test_the_nearest_of_several_rows_is_taken(tmp_path, measured):
    theirs = written(tmp_path, "static_load_N,shaft_speed_Hz,excitation_Hz,kyy_N_per_m\n"
                               "2490,22,25,1e8\n2501,22,25,2e8\n2515,22,25,3e8\n")  # fmt: skip
    result = compared(measured, theirs)
    assert result.to_dataframe()["kyy_N_per_m_predicted"].tolist()[1] == 2e8
    assert "line 2" in result.remarks[0]
    assert "line 4" in result.remarks[0]


def test_our_own_table_in_us_units_is_read_back(tmp_path, measured):
    si = read_table(measured)
    us_table(si).to_csv(tmp_path / "coefficients_us.csv", index=False)
    back = read_table(tmp_path / "coefficients_us.csv")
    assert list(back) == list(si)
    assert np.allclose(back, si, rtol=1e-7)


def test_us_units_are_known_by_the_ends_of_columns(tmp_path):
    pound, inch = 4.4482216152605, 0.0254
    path = written(tmp_path, "static_load_lbf\tshaft_speed_rpm\texcitation_rpm\tkxx_lbf_per_in\tkxx_lbf_per_in_lo"
                             "\tkxx_lbf_per_in_hi\tcyy_lbf_s_per_in\tx_mil\tnote\n"
                             "1124\t1320\t1500\t4e5\t3e5\t5e5\t5e3\t-0.2\tinitial_lbf\n")  # fmt: skip
    (row,) = read_table(path).to_dict("records")
    assert row == {
        "static_load_N": pytest.approx(1124 * pound), "shaft_speed_Hz": pytest.approx(22.0),
        "excitation_Hz": pytest.approx(25.0), "kxx_N_per_m": pytest.approx(4e5 * pound / inch),
        "kxx_N_per_m_lo": pytest.approx(3e5 * pound / inch), "kxx_N_per_m_hi": pytest.approx(5e5 * pound / inch),
        "cyy_Ns_per_m": pytest.approx(5e3 * pound / inch), "x_m": pytest.approx(-0.2 * 25.4e-6), "note": "initial_lbf",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("shaft_speed_Hz,kyy_N_per_m\n22,1e8\n", "column static_load_N is missing"),
        ("static_load_N,shaft_speed_Hz,kyy_lbs_per_in\n2500,22,1e8\n", "is no coefficient"),
        ("static_load_N,static_load_lbf,shaft_speed_Hz,kyy_N_per_m\n1,2,22,1e8\n", "is there twice"),
        ("static_load_N,shaft_speed_Hz,rotation,kyy_N_per_m\n2500,22,left,1e8\n", "'left' is not known"),
        ("static_load_N,shaft_speed_Hz,note\n2500,22,x\n", "holds no coefficient"),
        ("static_load_N,shaft_speed_rpm,excitation_Hz,kyy_N_per_m\n2500,22,25,1e8\n", "Check units and signs"),
    ],
)
def test_a_table_that_cannot_stand_beside_is_refused_with_file_and_remedy(tmp_path, measured, text, says):
    with pytest.raises(BadInputError, match=says) as error:
        compared(measured, written(tmp_path, text))
    assert "theirs.csv" in str(error.value)


def test_two_tables_of_one_name_are_refused_and_a_pivot_model_keeps_its_own(tmp_path):
    row = "static_load_N,shaft_speed_Hz,kyy_N_per_m\n2500,22,1e8\n"
    (tmp_path / "b").mkdir()
    first, second = written(tmp_path, row), written(tmp_path / "b", row)
    with pytest.raises(BadInputError, match="Rename one of the files"):
        read_predictions([first, second])
    assert list(read_predictions([written(tmp_path, row, "rigid.csv")])) == ["rigid.csv"]


@pytest.mark.slow
def test_five_programs_stand_on_one_page_without_a_bearing(tmp_path, measured):
    rows = {"ross": 1.0, "xltrc": 1.02, "dyrobes": 0.97, "spreadsheet": 1.1, "prediction": 0.99}
    frame = read_table(measured)
    for name, factor in rows.items():
        theirs = frame.copy()
        for column in set(theirs) & set(COEFFICIENT_COLUMNS):
            theirs[column] *= factor
        theirs.to_csv(tmp_path / f"{name}.csv", index=False)
    options = [part for name in rows for part in ("--prediction", tmp_path / f"{name}.csv")]
    out = tmp_path / "out"
    result = ended(0, "compare", "--coefficients", measured, "--reading-error", "5%", *options, "--out", out)
    assert "tpjb diagnose" not in result.output
    comparison = pd.read_csv(out / "comparison.csv")
    for name, factor in rows.items():
        ratios = comparison[comparison["pivots"] == name]["kyy_N_per_m_ratio"]
        assert np.allclose(ratios, factor)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert all(name in page for name in rows)
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))["commands"]["compare"]
    assert {f"prediction.{i}" for i in range(5)} <= set(record["inputs_at"])
    assert tpjb("rerun", out / "run.json").exit_code == 0


def test_a_prediction_that_did_not_converge_ends_with_three(tmp_path, measured):
    head = MEASURED.replace("cyy_Ns_per_m\n", "cyy_Ns_per_m,converged\n")
    result = compared(measured, written(tmp_path, head.replace("e5\n", "e5,False\n")))
    assert "did not converge at 3 predicted points" in result.doubt
    assert result.summary().startswith(f"NOT to be trusted: {result.doubt}")


@pytest.mark.slow
def test_a_table_stands_beside_a_campaign_with_a_locus(small_campaign, tmp_path):
    campaign = load_campaign(small_campaign)
    bearing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
    points = "".join(f"{load},22,25,1e8\n" for load in (2500, 3750))
    theirs = written(tmp_path, f"static_load_N,shaft_speed_Hz,excitation_Hz,kyy_N_per_m\n{points}")
    ours = compare_campaign(campaign, bearing, CompareSettings(("kirk",), "isothermal"))
    result = with_predictions(ours, read_predictions([theirs]))
    assert set(result.loci["pivots"]) == {"kirk"}
    assert "theirs.csv predicts 1 of 2 points" in result.summary()
    assert result.to_dataframe()["kyy_N_per_m_predicted"].notna().sum() == 2 + 1


def test_every_table_has_a_line_and_marker_of_its_own(tmp_path, measured):
    pytest.importorskip("matplotlib")
    from tpjb_ident.report.plots.coefficients import coefficient

    text = "static_load_N,shaft_speed_Hz,excitation_Hz,kyy_N_per_m\n2500,22,25,1e8\n5000,22,25,2e8\n"
    figure = coefficient(compared(measured, *(written(tmp_path, text, f"{n}.csv") for n in "abcde")), "kyy")
    lines = [line for line in figure.axes[0].get_lines() if line.get_label() in "abcde"]
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 5


READ_OFF = "static_load_N,shaft_speed_Hz,excitation_Hz,kxx_N_per_m,kyy_N_per_m,cyy_Ns_per_m,cyy_Ns_per_m_se"


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "read_off.csv"
    path.write_text("\n".join([READ_OFF, "5000,22,25,1.2e8,2e8,1e6,2e4", "8750,22,25,,4e8,1.4e6,"]), encoding="utf-8")
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
