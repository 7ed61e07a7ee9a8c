"""What `print` says of a bearing, a pad, a prediction and an operating point: one line a person reads."""

import math

import numpy as np
import pytest

import tpjb_ident as ti
from model.bearing_file import load_bearing
from model.predict import predict
from rigdata import OperatingPoint
from tests.good_campaigns import BEARINGS
from tests.report.plot_cases import curve, locus, polygon

POINT = OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 2 * math.pi * 25)
ROCKER = load_bearing(BEARINGS / "rocker.toml")
SHOWN = (
    "Rocker-backed five-pad bearing: 5 pads, 99.86 x 69.6 mm, Cb 80 um, preload 0.385 (pad #1), rocker pivots, "
    "oil ISO VG 46 at 40 degC"
)


@pytest.mark.parametrize(
    ("printed", "text"),
    [
        (str(ROCKER), SHOWN),
        (repr(ROCKER), f"<Bearing: {SHOWN}>"),
        (str(ROCKER.pads[0]), "pad at -90 deg, 63.5 deg of arc, Cb 80 um, preload 0.385"),
        (repr(ti.IdentifySettings()), "IdentifySettings()"),
        (repr(ti.IdentifySettings(method="ols")), "IdentifySettings(method='ols')"),
        (repr(ti.CompareSettings(thermal="tehd")), "CompareSettings(thermal='tehd')"),
        (str(POINT), "5000 N at -90 deg, shaft 22 Hz, excited at 25 Hz"),
        (str(OperatingPoint(500.0)), "500 N at -90 deg, shaft at rest"),
    ],
)
def test_bearings_pads_points_and_what_was_changed_of_settings(printed, text):
    assert printed == text


def test_a_bearing_without_pads():
    assert "0 pads" in str(ROCKER.with_pads(()))


def test_positions_and_curves_are_one_line_and_a_table_in_a_notebook():
    for result in (polygon(), locus(), curve(1)):
        assert repr(result).startswith(f"<{type(result).__name__}: ")
        assert "\n" not in repr(result)
        assert "µm" in result._repr_html_() or "MN/m" in result._repr_html_()
        assert len(result.to_dataframe())


def test_campaigns_runs_points_and_records_in_the_units_of_a_rig(small_campaign):
    campaign = ti.load_campaign(small_campaign)
    assert repr(campaign).startswith("<Campaign ")
    assert len(repr(campaign)) < 140
    run = campaign.of_kind("dynamic")[0]
    assert repr(run).startswith(f"<Run {run.id}: dynamic, ")
    assert repr(run.point) == f"<OperatingPoint: {run.point}>"
    assert repr(run.record("X1A")).startswith("<Record X1A: displacement at 45 deg, ")
    assert "1.57" not in repr(run)


def test_prediction():
    p = predict(ROCKER, 5000.0, speed=2 * math.pi * 22, thermal="isothermal")
    assert str(p).startswith("5000 N at -90 deg, 22 Hz: shaft at (")
    assert f"thinnest film {1e6 * p.min_film:.3g} um" in str(p)
    assert str(p).endswith("all well")
    table = p.to_dataframe()
    assert len(table) == np.size(p.excitation)
    assert table["kyy_N_per_m"][0] == np.ravel(p.kyy)[0]
    assert table["shaft_speed_Hz"][0] == pytest.approx(22.0)
