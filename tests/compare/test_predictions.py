"""Many operating points through the model, and the tables made of them."""

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from model.predict import predict
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.predictions import ModelSettings, predict_points, printed_formula
from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth
from tpjb_ident.compare.summary import _clearance_sentence, _extrapolation_sentence
from tpjb_ident.conditions import Condition
from tpjb_ident.schema import COEFFICIENT_COLUMNS

HZ = 2 * math.pi
DOWN = -math.pi / 2


@pytest.fixture(scope="module")
def bearing(rocker_file):
    return load_bearing(rocker_file)


def point(load, excitation, direction=DOWN):
    return OperatingPoint(load, direction, 22 * HZ, excitation * HZ)


def coefficients(row):
    """K and C of a row of ``prediction.csv``."""
    return np.array([row[name] for name in COEFFICIENT_COLUMNS]).reshape(2, 2, 2)


def test_order_is_kept_and_each_point_equals_a_prediction_of_its_own(bearing):
    points = [point(5000.0, 25.0), point(2500.0, 25.0), point(5000.0, 10.0)]
    settings = ModelSettings("kirk", "isothermal")
    seen = []
    found = predict_points(bearing, points, settings, lambda text, done, total: seen.append((done, total)))
    assert [(row["static_load_N"], row["excitation_Hz"]) for row in found] == [(5e3, 25.0), (2.5e3, 25.0), (5e3, 10.0)]
    assert seen == [(1, 2), (2, 2)]
    for row, p in zip(found, points, strict=True):
        alone = predict(bearing, p.static_load, DOWN, 22 * HZ, p.excitation, thermal="isothermal")
        for values, matrix in zip(coefficients(row), (alone.k, alone.c), strict=True):
            assert np.allclose(values, matrix, rtol=1e-4, atol=1e-4 * abs(matrix[1, 1]))


def test_no_excitation_means_synchronous(bearing):
    settings = ModelSettings("rigid", "isothermal")
    none, given = predict_points(bearing, [point(3000.0, 0.0), point(3000.0, 22.0)], settings)
    assert none == given
    assert none["excitation_Hz"] == 22.0


def test_prediction_table_adds_up(bearing):
    (row,) = predict_points(bearing, [point(4000.0, 25.0)], ModelSettings("kirk", "isothermal"))
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
    soft = ModelSettings("kirk", "isothermal", (Effect("housing_flexibility", stiffness=4e8),))
    truth = rig_truth(bearing, soft)
    (row,) = predict_points(bearing, [point(5000.0, 25.0)], soft)
    k, c = coefficients(row)
    assert np.allclose(truth.stiffness(point(5000.0, 25.0)), k + 25j * HZ * c, rtol=1e-6)
    assert np.allclose(truth.position(point(5000.0, 0.0)), [row["x_m"], row["y_m"]], rtol=1e-6, atol=1e-12)
    plain = rig_truth(bearing, ModelSettings("kirk", "isothermal"))
    load = np.array([1000.0, 4000.0])
    assert np.allclose(truth.deflection(1, load) - plain.deflection(1, load), load / 4e8)


def test_effects_on_records_go_to_the_instruments_only(bearing):
    from rigdata.virtual_rig import Instruments

    effects = (Effect("probe_gain", factor=1.05), Effect("housing_mass", mass_error=2.0))
    truth = rig_truth(bearing, ModelSettings("kirk", "isothermal", effects))
    plain = rig_truth(bearing, ModelSettings("kirk", "isothermal"))
    # to rounding: where arrays lie in memory decides the order of a library's sums
    assert np.allclose(truth.stiffness(point(5000.0, 25.0)), plain.stiffness(point(5000.0, 25.0)), rtol=1e-9)
    erring = erring_instruments(Instruments.like_paper(), effects)
    assert erring.named("X1A").error.gain == 1.05
    assert erring.true_mass == erring.housing_mass + 2.0


def test_effects_on_one_channel_reach_that_channel_alone():
    from rigdata.virtual_rig import Instruments

    sizes = {"one_probe_gain": {"factor": 1.2, "probe": 2}, "one_cell_gain": {"cell": 1, "factor": 0.9}}
    effects = [Effect(name, **size) for name, size in sizes.items()]
    plain, erring = Instruments.like_paper(), Instruments.like_paper()
    erring = erring_instruments(erring, [*effects, Effect("thermometer_offset", pad=3, offset=4.0)])
    off = {s.name: s.error for s, before in zip(erring.sensors, plain.sensors, strict=True) if s != before}
    assert {name: (error.gain, error.offset) for name, error in off.items()} == {
        "X1B": (1.2, 0.0),
        "L1H": (0.9, 0.0),
        "T3": (1.0, 4.0),
    }


def test_thermal_growth_is_not_seen_by_the_cold_clearance(bearing):
    hot = rig_truth(bearing, ModelSettings("kirk", "isothermal", (Effect("thermal_growth", clearance_change=-5e-6),)))
    off = rig_truth(bearing, ModelSettings("kirk", "isothermal", (Effect("pad_offset", pad=2, radial_offset=3e-6),)))
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
    measured = pd.DataFrame(
        {"pad1_load_N": [4e3, 4e3], "pad2_load_N": [4e3, 12e3], "pivot_extrapolated": [False, True]}
    )
    predictions = {"rigid": measured.assign(pad1_load_N=9e3), "measured": measured}
    (sentence,) = _extrapolation_sentence(SimpleNamespace(predictions=predictions, curves=curves))
    assert sentence.startswith("At 1 of 2 points the measured pivots are extrapolated")
    assert "12 kN, the dry tests went to 4.8 kN" in sentence
    inside = SimpleNamespace(predictions={"measured": measured.iloc[:1]}, curves=curves)
    assert _extrapolation_sentence(inside) == []
