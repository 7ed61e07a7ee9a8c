"""Pads that bend with the motion: the stiff pad, the mesh, and what it does."""

import math
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import flexing_impedance
from model.effects import Effect
from model.options import Options
from model.prediction import Prediction
from model.setup import Mesh
from tests.model import points
from tests.model.balance import Balance
from tests.model.points import close

FLEXING = Options(perturbed_bending=True)

pytestmark = pytest.mark.slow


def run(bearing: Bearing, factor: float = 1.0, options: Options = FLEXING, **more: Any) -> Prediction:
    """An isothermal bearing with pads that bend."""
    bending = Effect("pad_bending", compliance_factor=factor)
    return points.run(bearing, bending, thermal="isothermal", options=options, **more)


def test_a_stiff_pad_moves_as_a_rigid_body(rocker):
    for factor, least, most in ((1e-6, 0.0, 1e-5), (1.0, 1e-3, 1.0)):
        p, rigid = run(rocker, factor=factor), run(rocker, factor=factor, options=Options())
        change = np.abs(p.h - rigid.h).max() / np.abs(rigid.h).max()
        assert least < change < most


def test_it_hardly_hangs_on_the_mesh_and_takes_from_stiffness_or_damping(rocker):
    p, fine, rigid = run(rocker), run(rocker, mesh=Mesh(160, 12)), run(rocker, options=Options())
    np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
    np.testing.assert_allclose(np.diag(p.c), np.diag(fine.c), rtol=0.01)
    # in series with the film the pad takes from its damping
    assert (np.diag(p.c) < np.diag(rigid.c)).all()


def test_it_is_what_a_film_over_a_flexing_pad_does_by_its_own_balances(rocker):
    omega = 2 * math.pi * 50
    p = run(rocker, excitation=omega, mesh=Mesh(20, 4))
    film, speed = p.equilibrium.films[0], p.equilibrium.running.speed
    added = flexing_impedance(film, np.array([omega]), 1.0)[0]
    assert not film.work.ruptured[1:-1, :-1].any()
    flexing, rigid = (
        Balance((film.grid, film.work), film.wedge, speed, compliance=compliance).impedance(omega)
        for compliance in (film.deformation.compliance, None)
    )
    close(film.forces.stiffness + 1j * omega * film.forces.damping, rigid, 1e-4)
    close(flexing - rigid, added, 5e-3)
    assert np.abs(added).max() > 0.3 * np.abs(rigid).max()
