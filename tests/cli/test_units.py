"""`--units us` changes what people see, and nothing that is computed or stored."""

import re

import numpy as np
import pandas as pd
import pytest

from tests.command_line import ended, tpjb
from tests.good_campaigns import rocker_rig
from tpjb_ident.columns import SYSTEMS, amount, degrees, place_of
from tpjb_ident.compare.effect_words import shown_unit
from tpjb_ident.presentation import us_table
from tpjb_ident.report.drawing.picture import axis_label
from tpjb_ident.schema import DAMPING, STIFFNESS, TABLES


def test_both_systems_know_the_same_quantities():
    assert SYSTEMS["si"].keys() == SYSTEMS["us"].keys()


@pytest.mark.usefixtures("us")
def test_words_axes_and_coefficients_follow():
    assert amount(4448.2216152605, "load") == "1000 lbf"
    assert amount(25.4e-6, "length") == "1 mil"
    assert degrees(40.0) == "104 °F"
    assert place_of(2224.11, 25.0) == "500 lbf, 25 Hz"
    assert axis_label("load") == "static load, lbf"
    assert (STIFFNESS.display_unit, DAMPING.display_unit) == ("lbf/in", "lbf s/in")
    assert STIFFNESS.display_scale == pytest.approx(175.126835)
    assert shown_unit("N/m")[0] == "lbf/in"


def test_a_table_is_converted_by_the_units_in_its_names():
    frame = pd.DataFrame(
        {"temperature_1_K": [313.15], "max_pressure_Pa": [6894.757293], "x_m_se": [25.4e-6], "quality": ["ok"]}
    )
    assert us_table(frame).round(6).to_dict("list") == {
        "temperature_1_degF": [104.0], "max_pressure_psi": [1.0], "x_mil_se": [1.0], "quality": ["ok"],
    }  # fmt: skip


@pytest.mark.parametrize("table", sorted(TABLES))
def test_no_two_columns_of_a_table_become_one(table):
    names = [c.name.replace("{e}", "xx").replace("padN", "pad1").replace("_N_K", "_1_K") + e
             for c in TABLES[table] for e in ("", *c.endings)]  # fmt: skip
    converted = us_table(pd.DataFrame(np.ones((1, len(names))), columns=names))
    assert len(set(converted.columns)) == len(names)
    assert not [name for name in converted.columns if re.search(r"_(N|m|Pa|K|per_mil)(_|$)", name)]


def test_an_unknown_system_is_refused():
    result = ended(2, "check", "nowhere", "--units", "imperial")
    assert "--units: 'imperial' is not known. Use one of si, us." in result.output


@pytest.mark.slow
def test_a_prediction_is_printed_in_pounds_and_written_in_both(tmp_path):
    words = ("predict", "model/bearings/rocker.toml", "--thermal", "isothermal", "--pivots", "rigid")
    result = ended(0, *words, "--units", "us", "--out", tmp_path / "o")
    assert "load lbf" in result.output
    assert "kxx lbf/in" in result.output
    si, us = (pd.read_csv(tmp_path / "o" / f"prediction{end}.csv") for end in ("", "_us"))
    assert us["kyy_lbf_per_in"].iloc[0] == pytest.approx(si["kyy_N_per_m"].iloc[0] / 175.126835)
    assert us["shaft_speed_rpm"].iloc[0] == 60 * si["shaft_speed_Hz"].iloc[0]
    again = tpjb(*words, "--out", tmp_path / "p")
    assert "load kN" in again.output


@pytest.mark.slow
def test_channels_are_shown_in_us_units_and_written_in_si(tmp_path):
    words = ("show", "rigdata/samples/demo.h5", "--run", "d-05000-25-01", "--out")
    shown = {}
    for system in ("si", "us"):
        result = ended(0, *words, tmp_path / system, "--units", system)
        rows = [line.split() for line in result.output.splitlines()]
        shown[system] = {row[0]: (row[1], float(row[4])) for row in rows if len(row) > 7 and row[2] == "2000"}
    units = {name: (shown["si"][name][0], shown["us"][name][0]) for name in ("X1A", "L1V", "T1", "K1", "A1H")}
    assert units == {
        "X1A": ("µm", "mil"), "L1V": ("N", "lbf"), "T1": ("°C", "degF"), "K1": ("Hz", "rpm"), "A1H": ("m/s²", "m/s²"),
    }  # fmt: skip
    for name, factor, zero in (("X1A", 1 / 25.4, 0), ("L1V", 1 / 4.44822, 0), ("T1", 1.8, 32), ("K1", 60, 0)):
        assert shown["us"][name][1] == pytest.approx(factor * shown["si"][name][1] + zero, rel=2e-3)
    si, us = ((tmp_path / system / "channels.csv").read_text() for system in ("si", "us"))
    assert si == us


@pytest.mark.slow
@pytest.mark.parametrize("name", ["locus", "pivot", "check"])
def test_what_is_said_in_us_units_holds_no_other(name, tmp_path):
    said = ended(0, name, "rigdata/samples/demo.h5", "--units", "us", "--out", tmp_path / "o").output
    assert not re.search(r"\d (µm|um|N|kN)\b|MN/m|speed +Hz", said.replace("\n", " "))
    assert re.search(r"\blbf\b", said)


@pytest.mark.slow
def test_a_report_in_us_units_holds_no_other(campaign_of, tmp_path):
    ended(0, "compare", campaign_of(rocker_rig(3)), "--pivots", "measured", "--units", "us", "--out", tmp_path / "o")
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    words = " ".join(re.sub(r"<style.*?</style>|<script.*?</script>|<[^>]*>", " ", page, flags=re.S).split())
    assert not re.search(r"MN/m|\bkN\b|kN s/m|µm|[0-9] mm\b|MPa|°C", words)
    assert not re.search(r"e\+0|\b[0-9]{6,}(?= +[0-9]{6,})", words), "no exponents, no wide ticks in a row"
    first = pd.read_csv(tmp_path / "o" / "coefficients_us.csv").iloc[0]
    shown = re.search(r"Measured \(mm-eiv\).*? Hz ([0-9]+) ± ([0-9]+) ", words)
    half = 0.5 * (first["kxx_lbf_per_in_hi"] - first["kxx_lbf_per_in_lo"])
    assert float(shown[1]) == pytest.approx(first["kxx_lbf_per_in"], abs=0.05 * half)
    assert float(shown[2]) == pytest.approx(half, rel=0.05)
