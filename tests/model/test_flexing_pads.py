"""Pads that bend with the motion: the stiff pad, the slope of the static locus, the mesh, and what it does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect
from model.errors import OptionError
from model.options import Options
from model.predict import predict
from model.prediction import Prediction
from model.setup import Mesh

DOWN, SPEED = -math.pi / 2, 2 * math.pi * 22
FLEXING = Options(perturbed_bending=True)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rocker(rocker_file) -> Bearing:
    return load_bearing(rocker_file)


def run(
    bearing: Bearing,
    load: float = 5000.0,
    omega: float = SPEED,
    factor: float = 1.0,
    options: Options = FLEXING,
    mesh: Mesh | None = None,
) -> Prediction:
    """An isothermal bearing with pads that bend."""
    bending = Effect("pad_bending", compliance_factor=factor)
    p = predict(bearing, load, DOWN, SPEED, omega, thermal="isothermal", effects=[bending], options=options, mesh=mesh)
    assert p.converged, p.status
    return p


def test_a_stiff_pad_moves_as_a_rigid_body(rocker):
    for factor, least, most in ((1e-6, 0.0, 1e-5), (1.0, 1e-3, 1.0)):
        p, rigid = run(rocker, factor=factor), run(rocker, factor=factor, options=Options())
        change = np.abs(p.h - rigid.h).max() / np.abs(rigid.h).max()
        assert least < change < most


def test_at_rest_it_is_the_slope_of_the_static_locus(rocker):
    step = 10.0
    ends = [run(rocker, 5000.0 + s * step).bearing_position[1] for s in (1, -1)]
    slope = 2.0 * step / (ends[1] - ends[0])
    flexing = run(rocker, omega=1e-3).k[1, 1]
    rigid = run(rocker, omega=1e-3, options=Options()).k[1, 1]
    assert flexing == pytest.approx(slope, rel=1e-4)
    assert abs(rigid / slope - 1.0) > 0.01


def test_it_hardly_hangs_on_the_mesh_and_takes_from_stiffness_or_damping(rocker):
    p, fine, rigid = run(rocker), run(rocker, mesh=Mesh(160, 12)), run(rocker, options=Options())
    np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
    np.testing.assert_allclose(np.diag(p.c), np.diag(fine.c), rtol=0.01)
    # in series with the film the pad takes from its damping
    assert (np.diag(p.c) < np.diag(rigid.c)).all()


def test_it_is_for_plain_films():
    for options in ({"turbulence": "ng-pan"}, {"cavitation": "jfo"}, {"perturbed_heat": True}):
        with pytest.raises(OptionError, match="perturbed_bending"):
            Options(perturbed_bending=True, **options)
