"""End to end: what is partly explained, what the rest behaves like, and how an amplitude drifts, as the schema says."""

import json

import numpy as np
import pytest

from model.effects import Effect, known_effects, load_effects
from tests.diagnosis.rocker_case import noisy, rocker_setup, whole_layout
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.diagnose import diagnose
from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.planned import planned_observations

TRIED = {"thermal_growth", "pivot_flexibility", "probe_rotation", *TERMS}
SETTINGS = DiagnoseSettings(workers=1, skip=frozenset(known_effects()) - TRIED)
OTHER_LOADS = (2500.0, 3750.0, 7500.0, 8750.0)
ROTATED = Effect("probe_rotation", angle=0.12)
CROSS = Effect("parallel_stiffness", xx=0.0, xy=8e6, yx=-8e6, yy=0.0)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def setup():
    return rocker_setup()


@pytest.fixture(scope="module")
def planned(setup):
    return planned_observations(setup, whole_layout(OTHER_LOADS))


def told_of(planned, value, setup):
    return json.loads(diagnose(noisy(planned, value, 11), setup, SETTINGS).verdict.to_json())


@pytest.fixture(scope="module")
def mixed(setup, planned):
    """Probes that stand askew, and a cross-coupled stiffness that no effect of the library makes."""
    forward = Forward(setup, planned.layout, planned.elements)
    return diagnose(noisy(planned, forward((ROTATED, CROSS)), 11), setup, SETTINGS).verdict


def test_an_effect_beside_something_unknown_is_partly_explained(mixed):
    told = json.loads(mixed.to_json())
    assert told["schema"] == "tpjb-diagnosis/2"
    assert told["verdict"] == "partly-explained"
    assert [e["name"] for e in told["effects"]] == ["probe_rotation"]
    angle = told["effects"][0]["parameters"]["angle"]
    assert set(angle) == {"value", "lo", "hi", "unit"}
    assert set(told["remainder"]) >= {"sigma", "share", "where"}


def test_what_the_rest_behaves_like_is_told_with_size_and_words(mixed):
    (one,) = json.loads(mixed.to_json())["behaves_like"]
    assert set(one) >= {"kind", "size", "unit", "direction_deg", "spread", "words"}
    assert (one["kind"], one["unit"]) == ("parallel stiffness", "N/m")
    assert one["size"] == pytest.approx(8e6, rel=0.2)
    assert "cross-coupled" in one["words"]


def test_the_effects_file_holds_the_effects_and_the_other_one_the_terms_too(mixed, tmp_path):
    for text, names in (
        (mixed.effects_toml(), ["probe_rotation"]),
        (mixed.terms_toml(), ["probe_rotation", "parallel_stiffness"]),
    ):
        path = tmp_path / "found.effects.toml"
        path.write_text(text)
        assert [e.name for e in load_effects(path)] == names


def test_growth_that_follows_the_load_is_told_as_a_drift(setup, planned):
    forward = Forward(setup, planned.layout, planned.elements)
    value = forward((Effect("thermal_growth", clearance_change=10e-6 * 5000.0 / 8750.0),))
    for load in OTHER_LOADS:
        mine = np.array([e.family in {"h", "temperature"} and e.place("load") == load for e in planned.elements])
        grown = forward((Effect("thermal_growth", clearance_change=10e-6 * load / 8750.0),))
        value = np.where(mine, grown, value)
    told = told_of(planned, value, setup)
    assert told["verdict"] in {"partly-explained", "unexplained"}
    (drift,) = told["drift"]
    assert set(drift) == {"effect", "parameter", "over", "from", "to", "words"}
    named = (drift["effect"], drift["parameter"], drift["over"])
    assert named == ("thermal_growth", "clearance_change", "static_load")
    assert drift["to"] > 2.0 * drift["from"] > 0.0


def test_a_pad_that_stands_off_and_is_no_effect_is_told_by_its_clearance(setup, planned):
    forward = Forward(setup, planned.layout, planned.elements)
    value = forward((Effect("pad_offset", pad=3, radial_offset=-20e-6),))
    told = told_of(planned, value, setup)
    assert told["verdict"] in {"partly-explained", "unexplained"}
    pads = [one for one in told["behaves_like"] if one["kind"] == "clearance by pad"]
    assert any("pad #3" in one["words"] for one in pads)
    assert next(one["size"] for one in pads if "pad #3" in one["words"]) == pytest.approx(-20e-6, rel=0.6)
