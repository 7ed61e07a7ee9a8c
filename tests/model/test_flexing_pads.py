"""Pads that bend with the motion: the stiff pad, the mesh, and what it does."""

import math
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import flexing_impedance
from model.effects import Effect
from model.options import Options
from model.pad.bending import force_weights
from model.prediction import Prediction
from model.setup import Mesh
from tests.model import points
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


class _Linearised:
    """A film over a pad that flexes, written apart from the product and linearised by complex steps of its balances.

    Control volumes about the product's nodes over half the width (the compliance belongs to these), one viscosity and
    density, no rupture; outflow and what the volumes hold depend on pressure, wedge and, through them, the thickness.
    """

    def __init__(self, p: Prediction, pad: int) -> None:
        film = p.equilibrium.films[pad]
        grid, work = film.grid, film.work
        self.speed, self.clearance, self.still_bent = p.equilibrium.running.speed, film.pad.pad_clearance, film.bent
        self.viscosity, self.density = float(work.viscosity[1, 1]), float(work.density[1, 1])
        self.wedge, self.angle, z = np.array(film.wedge[1:]), grid.angle, grid.z
        self.step = p.setup.bearing.journal_radius * (self.angle[1] - self.angle[0])
        edges = np.concatenate([[z[0]], 0.5 * (z[1:] + z[:-1]), [z[-1]]])
        self.height, self.gap = np.diff(edges), np.diff(z)
        self.compliance = film.deformation.compliance
        self.inner = np.zeros(work.pressure.shape, bool)
        self.inner[1:-1, :-1] = True
        self.pressure, self.weights = np.zeros(int(self.inner.sum())), force_weights(grid)

    def balance(self, p: np.ndarray, wedge: np.ndarray, flexible: bool) -> np.ndarray:
        """What leaves every control volume but by its change of thickness [kg/s], and what it holds [kg]; (2, n)."""
        whole = np.zeros(self.inner.shape, np.result_type(p, wedge))
        whole[self.inner] = p
        bent = (self.compliance @ whole.ravel()).reshape(whole.shape) if flexible else self.still_bent
        h = self.clearance - (wedge[0] * np.cos(self.angle) + wedge[1] * np.sin(self.angle))[:, None] + bent
        along, across = 0.5 * (h[1:] + h[:-1]), 0.5 * (h[:, 1:] + h[:, :-1])
        mobility = self.density / (12.0 * self.viscosity)
        dragged = 0.5 * self.density * self.speed * along
        fx = self.height * (dragged - mobility * along**3 * np.diff(whole, axis=0) / self.step)
        fz = -mobility * self.step * across**3 * np.diff(whole, axis=1) / self.gap
        net = np.zeros_like(whole)
        net[1:-1] = np.diff(fx, axis=0)
        net[:, :-1] += fz
        net[:, 1:] -= fz
        return np.stack([net[self.inner], (self.density * self.step * self.height * h)[self.inner]])

    def slopes(self, flexible: bool) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the balance by pressure and by wedge, (n, 2, ...)."""
        tiny, p = 1e-20j, self.pressure
        by_pressure = [self.balance(p + tiny * e, self.wedge, flexible).imag.T for e in np.eye(p.size)]
        by_wedge = [self.balance(p, self.wedge + tiny * e, flexible).imag.T for e in np.eye(2)]
        return np.stack(by_pressure, axis=2) / 1e-20, np.stack(by_wedge, axis=2) / 1e-20

    def impedance(self, omega: float, flexible: bool) -> np.ndarray:
        """Force over a small vibration of (a, b), (2, 2), about the film's own equilibrium, found by Newton's steps."""
        for _ in range(12):
            by_pressure, by_wedge = self.slopes(flexible)
            self.pressure -= np.linalg.solve(by_pressure[:, 0], self.balance(self.pressure, self.wedge, flexible)[0])
        moving = [parts[:, 0] + 1j * omega * parts[:, 1] for parts in (by_pressure, by_wedge)]
        return self.weights @ -np.linalg.solve(*moving)


def test_it_is_what_a_film_over_a_flexing_pad_does_by_its_own_balances(rocker):
    omega = 2 * math.pi * 50
    p = run(rocker, excitation=omega, mesh=Mesh(20, 4))
    film = p.equilibrium.films[0]
    added = flexing_impedance(film, np.array([omega]), 1.0)[0]
    assert not film.work.ruptured[1:-1, :-1].any()
    flexing, rigid = (_Linearised(p, 0).impedance(omega, flexible) for flexible in (True, False))
    close(film.forces.stiffness + 1j * omega * film.forces.damping, rigid, 3e-3)
    close(flexing - rigid, added, 5e-3)
    assert np.abs(added).max() > 0.3 * np.abs(rigid).max()
