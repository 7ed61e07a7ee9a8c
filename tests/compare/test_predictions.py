"""Many operating points through the model, and the tables made of them; measured pivots and effects on pivots never
count twice."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect, load_effects
from model.predict import predict
from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments
from tests.command_line import ended
from tests.good_campaigns import rocker_rig, written
from tests.phasors.phasor_cases import place
from tpjb_ident.compare.comparison import CompareSettings, compare_campaign
from tpjb_ident.compare.predictions import (
    ModelSettings,
    counted_twice,
    counts_from_measured,
    predict_points,
    printed_formula,
    refuse_counted_twice,
)
from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth
from tpjb_ident.compare.static_tests import implausible_pivots
from tpjb_ident.compare.summary import _clearance_sentence, _extrapolation_sentence
from tpjb_ident.conditions import Condition
from tpjb_ident.errors import BadInputError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, STIFFNESS

HZ = 2 * math.pi


KIRK = ModelSettings("kirk", "isothermal")


@pytest.fixture(scope="module")
def bearing(rocker_file):
    return load_bearing(rocker_file)


def with_effects(*effects):
    return ModelSettings("kirk", "isothermal", effects)


def point(load, excitation):
    return place(load, excitation=excitation)


def coefficients(row):
    """K and C of a row of ``prediction.csv``."""
    return np.array([row[name] for name in COEFFICIENT_COLUMNS]).reshape(2, 2, 2)


def test_order_is_kept_and_each_point_equals_a_prediction_of_its_own(bearing):
    points = [point(5000.0, 25.0), point(2500.0, 25.0), point(5000.0, 10.0)]
    seen = []
    found = predict_points(bearing, points, KIRK, lambda text, done, total: seen.append((done, total)))
    assert [(row["static_load_N"], row["excitation_Hz"]) for row in found] == [(5e3, 25.0), (2.5e3, 25.0), (5e3, 10.0)]
    assert seen == [(1, 2), (2, 2)]
    for row, p in zip(found, points, strict=True):
        alone = predict(bearing, p.static_load, speed=22 * HZ, excitation=p.excitation, thermal="isothermal")
        for values, matrix in zip(coefficients(row), (alone.k, alone.c), strict=True):
            assert np.allclose(values, matrix, rtol=1e-4, atol=1e-4 * abs(matrix[1, 1]))


def test_no_excitation_means_synchronous(bearing):
    settings = ModelSettings("rigid", "isothermal")
    none, given = predict_points(bearing, [point(3000.0, 0.0), point(3000.0, 22.0)], settings)
    assert none == given
    assert none["excitation_Hz"] == 22.0


def test_prediction_table_adds_up(bearing):
    (row,) = predict_points(bearing, [point(4000.0, 25.0)], KIRK)
    pads = [row[f"pad{k}_load_N"] for k in range(1, 6)]
    vertical = -sum(load * math.sin(pad.pivot_angle) for load, pad in zip(pads, bearing.pads, strict=True))
    # film forces carry the load; the rest is what the tilted pads' shear arms leave out
    assert vertical == pytest.approx(4000.0, rel=0.02)
    assert row["min_film_m"] == min(row[f"pad{k}_min_film_m"] for k in range(1, 6))
    assert 0 < row["mesh_error"] < 0.05


def test_printed_formula_gives_secant_and_tangent(bearing):
    formula = printed_formula(bearing)
    secant, tangent = formula(1, 4000.0)
    pivot = bearing.pivot
    line = math.pi * pivot.youngs_modulus * pivot.contact_length / (1 - pivot.poissons_ratio**2)
    logarithm = math.log(line * (pivot.housing_diameter - pivot.pivot_diameter) / (4 * 4000.0))
    assert secant == pytest.approx(line / 2 / (2 / 3 + logarithm), rel=1e-12)
    assert tangent == pytest.approx(line / 2 / (logarithm - 1 / 3), rel=1e-12)


def test_rig_and_model_agree_on_what_stands_in_series(bearing):
    soft = with_effects(Effect("housing_flexibility", stiffness=4e8))
    truth = rig_truth(bearing, soft)
    (row,) = predict_points(bearing, [point(5000.0, 25.0)], soft)
    k, c = coefficients(row)
    assert np.allclose(truth.stiffness(point(5000.0, 25.0)), k + 25j * HZ * c, rtol=1e-6)
    assert np.allclose(truth.position(point(5000.0, 0.0)), [row["x_m"], row["y_m"]], rtol=1e-6, atol=1e-12)
    plain = rig_truth(bearing, KIRK)
    load = np.array([1000.0, 4000.0])
    assert np.allclose(truth.deflection(1, load) - plain.deflection(1, load), load / 4e8)


def test_effects_on_records_go_to_the_instruments_only(bearing):
    effects = (Effect("probe_gain", factor=1.05), Effect("housing_mass", mass_error=2.0))
    truth = rig_truth(bearing, with_effects(*effects))
    plain = rig_truth(bearing, KIRK)
    # to rounding: where arrays lie in memory decides the order of a library's sums
    assert np.allclose(truth.stiffness(point(5000.0, 25.0)), plain.stiffness(point(5000.0, 25.0)), rtol=1e-9)
    erring = erring_instruments(Instruments.like_paper(), effects)
    assert erring.named("X1A").error.gain == 1.05
    assert erring.true_mass == erring.housing_mass + 2.0


def test_effects_on_one_channel_reach_that_channel_alone():
    sizes = {"one_probe_gain": {"factor": 1.2, "probe": 2}, "one_cell_gain": {"cell": 1, "factor": 0.9}}
    effects = [Effect(name, **size) for name, size in sizes.items()]
    plain, erring = Instruments.like_paper(), Instruments.like_paper()
    erring = erring_instruments(erring, [*effects, Effect("thermometer_offset", pad=3, offset=4.0)])
    off = {s.name: s.error for s, before in zip(erring.sensors, plain.sensors, strict=True) if s != before}
    told = {name: (error.gain, error.offset) for name, error in off.items()}
    assert told == {"X1B": (1.2, 0.0), "L1H": (0.9, 0.0), "T3": (1.0, 4.0)}


def test_thermal_growth_is_not_seen_by_the_cold_clearance(bearing):
    hot = rig_truth(bearing, with_effects(Effect("thermal_growth", clearance_change=-5e-6)))
    off = rig_truth(bearing, with_effects(Effect("pad_offset", pad=2, radial_offset=3e-6)))
    assert hot.clearance == pytest.approx([80e-6] * 5)
    assert off.clearance == pytest.approx([80e-6, 83e-6, 80e-6, 80e-6, 80e-6])


def test_the_summary_claims_no_more_of_a_clearance_than_the_sweep_tells(bearing):
    def sentences(*status, clearance=(80e-6,) * 5):
        clearance = SimpleNamespace(clearance=np.array(clearance), status=status)
        return _clearance_sentence(SimpleNamespace(clearance=clearance, bearing=bearing))

    assert sentences() == ["The measured clearance is that of the drawing, within 0 µm at every pad."]
    (three,) = sentences(Condition("pads-not-separable", "three pads fit every centre"))
    assert "on the mean; three pads fit every centre" in three
    assert "every pad" not in three
    gains = Condition("probe-gains-differ", "the sides stand as if X1A read 3 % more")
    words = sentences(gains, clearance=(81e-6, 81e-6, 83e-6, 81e-6, 81e-6))
    assert any("X1A read 3 % more" in sentence for sentence in words)
    assert any("at pad #3" in sentence for sentence in words)


def test_the_summary_says_where_pivots_are_pressed_harder_than_in_their_dry_tests():
    curves = [SimpleNamespace(valid_to=5000.0), SimpleNamespace(valid_to=4800.0)]
    loads = {"pad1_load_N": [4e3, 4e3], "pad2_load_N": [4e3, 12e3], "pivot_extrapolated": [False, True]}
    measured = pd.DataFrame(loads)
    predictions = {"rigid": measured.assign(pad1_load_N=9e3), "measured": measured}
    (sentence,) = _extrapolation_sentence(SimpleNamespace(predictions=predictions, curves=curves))
    assert sentence.startswith("At 1 of 2 points the measured pivots are extrapolated")
    assert "12 kN, the dry tests went to 4.8 kN" in sentence
    inside = SimpleNamespace(predictions={"measured": measured.iloc[:1]}, curves=curves)
    assert _extrapolation_sentence(inside) == []


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
    settings = CompareSettings(effects=(SOFTER, GROWN))
    assert settings.effects_with("kirk") == (SOFTER, GROWN)
    assert settings.effects_with("measured") == (GROWN,)


def test_sizes_that_a_diagnosis_found_beside_measured_pivots_stay(tmp_path):
    settings = CompareSettings(effects=(SOFTER,), from_measured=True)
    assert settings.effects_with("measured") == (SOFTER,)
    path = tmp_path / "updated.effects.toml"
    path.write_text('counted_from = "measured pivots"\n' + FOUND)
    assert counts_from_measured(path)
    assert load_effects(path)[0].name == "soft_pivot"
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


@pytest.mark.slow
def test_a_comparison_says_what_it_left_out_and_predicts_as_if_it_were_not_there(tmp_path, rocker_file):
    campaign, bearing = load_campaign(written(tmp_path / "c.h5", rocker_rig(3))), load_bearing(rocker_file)
    plain = compare_campaign(campaign, bearing, CompareSettings(("measured",), "isothermal"))
    given = compare_campaign(campaign, bearing, CompareSettings(("measured",), "isothermal", (SOFTER,)))
    stiffness = [list(result.predictions["measured"][list(STIFFNESS.columns)].iloc[0]) for result in (given, plain)]
    assert stiffness[0] == pytest.approx(stiffness[1])
    assert any("without pivot_flexibility" in remark for remark in given.remarks)


@pytest.mark.parametrize(("scale", "extent"), [(1.0, ""), (1e-3, "0.0005 to 0.001 times"), (22.0, "11 to 22 times")])
def test_curves_that_no_pivot_of_the_bearing_has_are_told_by_the_formula(scale, extent):
    curves = [
        SimpleNamespace(pad=pad, valid_to=5000.0, stiffness=lambda load, pad=pad: scale * 1e9 / pad) for pad in (1, 2)
    ]
    texts = implausible_pivots(curves, lambda pad, load: (2e9, 1e9))
    assert len(texts) == bool(extent)
    assert all(text.startswith(f"pad #1, pad #2: {extent}") for text in texts)
    assert implausible_pivots(curves, None) == []
