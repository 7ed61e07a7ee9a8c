"""Generic terms of two by two numbers, and effects from a user's own file."""

import math
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect, EffectError, load_effects
from model.effects.user_library import load_library
from model.predict import predict

ROCKER = load_bearing(Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml")
POINT = {"load": 5000.0, "load_direction": -math.pi / 2, "speed": 138.0, "excitation": 157.0}


@pytest.mark.slow
def test_parallel_terms_add_to_what_the_records_show():
    plain = predict(ROCKER, **POINT).h
    stiff = Effect("parallel_stiffness", xx=1e6, xy=2e6, yx=-2e6, yy=0.0)
    damping = Effect("parallel_damping", xx=0.0, xy=0.0, yx=0.0, yy=1e3)
    more = predict(ROCKER, **POINT, effects=[stiff, damping]).h - plain
    assert np.allclose(more, [[1e6, 2e6], [-2e6, 157.0j * 1e3]], atol=1.0)


@pytest.mark.slow
def test_a_series_compliance_alike_in_all_directions_is_the_flexible_housing():
    one = predict(ROCKER, **POINT, effects=[Effect("series_compliance", xx=1e-9, xy=0.0, yy=1e-9)])
    other = predict(ROCKER, **POINT, effects=[Effect("housing_flexibility", stiffness=1e9)])
    assert np.allclose(one.h, other.h)
    assert np.allclose(one.position, other.position)


def test_terms_are_read_from_an_effects_file(tmp_path):
    path = tmp_path / "terms.toml"
    path.write_text('[[effects]]\nname = "series_compliance"\nxx = 1e-9\nxy = "2e-10 m/N"\nyy = 0.0\n')
    (found,) = load_effects(path)
    assert found.parameters["xy"] == pytest.approx(2e-10)


OWN = """
from model.effects import EffectKind, Parameter
KIND = EffectKind("{name}", "bearing", (Parameter("share", "1", "ratio", 0.0, 0.0, 1.0, 0.1),),
                  lambda setup, share: setup, "made up")
"""


def test_effects_of_ones_own_are_registered_from_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr("model.effects.registry._registered", {})  # other tests know the bundled ones only
    path = tmp_path / "own.py"
    path.write_text(OWN.format(name="of_ones_own"))
    assert [k.name for k in load_library(path)] == ["of_ones_own"]
    assert Effect("of_ones_own", share=0.5).parameters["share"] == 0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [("x = 1", "defines no effect"), ("1 / 0", "ZeroDivisionError"), (OWN.format(name="starvation"), "bundled")],
)
def test_files_that_bring_no_effect_are_refused(tmp_path, text, said):
    path = tmp_path / "own.py"
    path.write_text(text)
    with pytest.raises(EffectError, match=said):
        load_library(path)
