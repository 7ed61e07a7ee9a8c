"""At rest the stiffness is the slope of the static locus, whatever physics the model has: exact, for every option."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect
from model.options import Options
from tests.model.points import DOWN, LOAD, run, slopes

ISOTHERMAL = {"thermal": "isothermal"}
FAST, HALF_FED = {"speed": 2 * math.pi * 150.0, "load": 2000.0}, {"speed": 2 * math.pi * 60.0, "mesh": (40, 4)}
LEANING = [Effect("misalignment", angle=6e-4, direction=0.4)]
HELD = [*LEANING, Effect("pivot_rotation", rotational_stiffness=2e4)]
BENDING = [Effect("pad_bending", compliance_factor=1.0)]
TILTED = {"effects": [Effect("misalignment", angle=6e-4, direction=DOWN), *BENDING]}
HEATED = {"thermal": "adiabatic", "pivots": "rigid", "options": Options(perturbed_heat=True)}
PLAIN = {"options": Options()}
#: Bearing, point, how close, and what the point is without: then the slope is off by more than this share.
CASES = {
    "rigid pivots": ("rocker", {"pivots": "rigid"}, 2e-3, None),
    "Kirk's pivots": ("rocker", {}, 2e-3, None),
    "pivots that roll": ("rocker", {"effects": [Effect("pivot_rolling", factor=2.0)]}, 5e-3, None),
    "turbulence": ("thin", FAST | {"options": Options(turbulence="ng-pan")}, 5e-3, None),
    "mass conserved": ("spherical", {"load": 8750.0, "options": Options(cavitation="jfo")}, 2e-3, None),
    "short of oil": ("fed", HALF_FED | {"options": Options(cavitation="jfo")}, 0.03, None),
    "axial tilt": ("spherical", {"effects": LEANING, "options": Options(axial_tilt=True)}, 1e-3, (PLAIN, 5e-3)),
    "axial tilt, held": ("spherical", {"effects": HELD, "options": Options(axial_tilt=True)}, 1e-3, (PLAIN, 5e-3)),
    "axial tilt, bending": (
        "spherical",
        TILTED | {"options": Options(axial_tilt=True, perturbed_bending=True)},
        2e-3,
        None,
    ),
    "bending": ("rocker", {"effects": BENDING, "options": Options(perturbed_bending=True)}, 2e-4, (PLAIN, 0.01)),
    "heat": ("rocker", HEATED, 2e-4, (PLAIN, 0.02)),
    "heat, heavy load": ("rocker", HEATED | {"load": 8750.0}, 3e-3, (PLAIN, 0.02)),
}


@pytest.fixture
def bearings(rocker, spherical) -> dict[str, Bearing]:
    thin = replace(rocker, oil=replace(rocker.oil, viscosity_40=0.02 * rocker.oil.viscosity_40))
    fed = replace(rocker, oil=replace(rocker.oil, supply_flow=18.0 / 60e3))
    return {"rocker": rocker, "spherical": spherical, "thin": thin, "fed": fed}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_at_rest_the_stiffness_is_the_slope_of_the_static_locus(bearings, name):
    which, point, limit, other = CASES[name]
    bearing, point = bearings[which], ISOTHERMAL | point
    load = point.pop("load", LOAD)

    def position(push: np.ndarray) -> np.ndarray:
        place = {"load": float(np.hypot(*push)), "direction": math.atan2(push[1], push[0])}
        return run(bearing, **point, **place).bearing_position

    compliance = slopes(position, np.array([0.0, -load]), 0.004 * load)
    k = run(bearing, load=load, excitation=1e-3, **point).k
    np.testing.assert_allclose(k @ compliance, np.eye(2), atol=limit)
    if other is not None:
        without = run(bearing, load=load, excitation=1e-3, **point | other[0]).k
        assert np.abs(without @ compliance - np.eye(2)).max() > other[1]
