"""Measured pivots and effects on pivots never count twice."""

import tomllib
from pathlib import Path

import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from rigdata.campaign import load_campaign
from tests.command_line import ended
from tests.good_campaigns import rocker_rig, written
from tpjb_ident.compare.comparison import CompareSettings, compare_campaign
from tpjb_ident.compare.predictions import counted_twice, counts_from_measured, refuse_counted_twice
from tpjb_ident.errors import BadInputError
from tpjb_ident.schema import STIFFNESS

SOFTER = Effect("pivot_flexibility", stiffness_factor=0.4)
GROWN = Effect("thermal_growth", clearance_change=5e-6)
FOUND = """schema = "tpjb-effects/1"
[[effects]]
name = "soft_pivot"
pad = 5
stiffness_factor = 0.4
"""
MEASURED = """schema = "tpjb-pivots/1"
""" + "".join(f"""[[pivots]]
pad = {k}
force_N = [0.0, 2000.0, 5000.0]
deflection_m = [0.0, 4e-6, 9e-6]
""" for k in range(1, 6))  # fmt: skip


def test_only_effects_on_how_pivots_give_way_are_what_a_dry_test_holds():
    assert counted_twice([SOFTER, GROWN, SOFTER]) == ("pivot_flexibility",)


def test_compare_leaves_them_out_beside_measured_pivots_alone():
    settings = CompareSettings(effects=(SOFTER, GROWN))
    assert settings.effects_with("kirk") == (SOFTER, GROWN)
    assert settings.effects_with("measured") == (GROWN,)


def test_sizes_that_a_diagnosis_found_beside_measured_pivots_stay(tmp_path):
    settings = CompareSettings(effects=(SOFTER,), from_measured=True)
    assert settings.effects_with("measured") == (SOFTER,)
    path = tmp_path / "updated.effects.toml"
    path.write_text('counted_from = "measured pivots"\n' + FOUND)
    assert counts_from_measured(path)
    refuse_counted_twice(Path("pivots.toml"), (SOFTER,), path)


@pytest.mark.parametrize("pivots", ["measured", Path("pivots.toml")])
def test_measured_pivots_with_them_are_refused(pivots, tmp_path):
    path = tmp_path / "updated.effects.toml"
    path.write_text(FOUND)
    with pytest.raises(BadInputError, match="pivot_flexibility would count twice"):
        refuse_counted_twice(pivots, (SOFTER, GROWN), path)
    refuse_counted_twice(pivots, (GROWN,), path)
    refuse_counted_twice("kirk", (SOFTER,), path)


def test_predict_refuses_measured_pivots_with_an_effect_that_they_hold(tmp_path, rocker_file):
    effects, pivots = tmp_path / "updated.effects.toml", tmp_path / "pivots.toml"
    effects.write_text(FOUND)
    pivots.write_text(MEASURED)
    result = ended(2, "predict", rocker_file, "--pivots", pivots, "--effects", effects, "--out", tmp_path / "out")
    assert "soft_pivot would count twice" in " ".join(result.output.split())
    assert not (tmp_path / "out").exists()


def test_an_effects_file_with_the_note_is_read_by_everyone(tmp_path):
    path = tmp_path / "updated.effects.toml"
    path.write_text('counted_from = "measured pivots"\n' + FOUND)
    assert tomllib.loads(path.read_text())["counted_from"] == "measured pivots"
    from model.effects import load_effects

    assert load_effects(path)[0].name == "soft_pivot"


@pytest.mark.slow
def test_a_comparison_says_what_it_left_out_and_predicts_as_if_it_were_not_there(tmp_path, rocker_file):
    campaign, bearing = load_campaign(written(tmp_path / "c.h5", rocker_rig(3))), load_bearing(rocker_file)
    plain = compare_campaign(campaign, bearing, CompareSettings(("measured",), "isothermal"))
    given = compare_campaign(campaign, bearing, CompareSettings(("measured",), "isothermal", (SOFTER,)))
    stiffness = [list(result.predictions["measured"][list(STIFFNESS.columns)].iloc[0]) for result in (given, plain)]
    assert stiffness[0] == pytest.approx(stiffness[1])
    assert any("without pivot_flexibility" in remark for remark in given.remarks)
