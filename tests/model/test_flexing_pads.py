"""Pads that bend with the motion: the stiff pad, the slope of the static locus, the mesh, and what it does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import flexing_impedance
from model.effects import Effect
from model.errors import OptionError
from model.options import Options
from model.pad.bending import force_weights
from model.predict import predict
from model.prediction import Prediction
from model.setup import Mesh

DOWN, SPEED = -math.pi / 2, 2 * math.pi * 22
FLEXING = Options(perturbed_bending=True)

pytestmark = pytest.mark.slow


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


class _Marched:
    """A film over a pad that flexes, marched in time: not linearised, and written apart from the product.

    Control volumes about the product's nodes over half the width (the compliance belongs to these), one viscosity and
    density, no rupture; every step of Newmark's trapezoidal rule solves pressure and deformation together.
    """

    def __init__(self, p: Prediction, pad: int) -> None:
        film = p.equilibrium.films[pad]
        grid, work, bearing = film.grid, film.work, p.setup.bearing
        self.speed, self.clearance = p.equilibrium.running.speed, film.pad.pad_clearance
        self.viscosity, self.density = float(work.viscosity[1, 1]), float(work.density[1, 1])
        self.start = np.array(film.wedge[1:])
        self.angle, z = grid.angle, grid.z
        self.step = bearing.journal_radius * (self.angle[1] - self.angle[0])
        edges = np.concatenate([[z[0]], 0.5 * (z[1:] + z[:-1]), [z[-1]]])
        self.height, self.gap = np.diff(edges), np.diff(z)
        self.compliance = film.deformation.compliance
        self.shape = work.pressure.shape
        inner = np.zeros(self.shape, bool)
        inner[1:-1, :-1] = True
        self.inner = inner.ravel()
        self.size = int(self.inner.sum())
        self.weights = force_weights(grid)

    def thickness(self, p: np.ndarray, wedge: np.ndarray, flexible: bool) -> np.ndarray:
        whole = np.zeros(self.inner.size, p.dtype)
        whole[self.inner] = p
        bent = (self.compliance @ whole).reshape(self.shape) if flexible else self.still_bent
        return self.clearance - wedge[0] * np.cos(self.angle)[:, None] - wedge[1] * np.sin(self.angle)[:, None] + bent

    def outflow(self, p: np.ndarray, h: np.ndarray) -> np.ndarray:
        """What leaves every control volume but by its change of thickness [kg/s]."""
        whole = np.zeros(self.inner.size, p.dtype)
        whole[self.inner] = p
        whole = whole.reshape(self.shape)
        along, across = 0.5 * (h[1:] + h[:-1]), 0.5 * (h[:, 1:] + h[:, :-1])
        mobility = self.density / (12.0 * self.viscosity)
        fx = self.height * (
            0.5 * self.density * self.speed * along - mobility * along**3 * np.diff(whole, axis=0) / self.step
        )
        fz = -mobility * self.step * across**3 * np.diff(whole, axis=1) / self.gap
        net = np.zeros(self.shape, p.dtype)
        net[1:-1] = np.diff(fx, axis=0)
        net[:, :-1] += fz
        net[:, 1:] -= fz
        return net.ravel()[self.inner]

    def volume(self, h: np.ndarray) -> np.ndarray:
        return (self.density * self.step * self.height * h).ravel()[self.inner]

    def solve(self, residual, p: np.ndarray, slope: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Newton's steps with one slope, by complex differences."""
        if slope is None:
            tiny = 1e-20
            slope = np.stack([residual(p + 1j * tiny * e).imag / tiny for e in np.eye(self.size)], axis=1)
        for _ in range(30):
            step = np.linalg.solve(slope, residual(p))
            p = p - step
            if np.abs(step).max() < 1e-11 * np.abs(p).max():
                break
        return p, slope

    def impedance(self, omega: float, flexible: bool, steps: int = 64) -> np.ndarray:
        """Force's first harmonic over (a, b), (2, 2), by marching three periods of a small vibration."""
        p = np.zeros(self.size)
        for _ in range(12):
            p, _ = self.solve(lambda q: self.outflow(q, self.thickness(q, self.start, flexible)), p, None)
        out = np.empty((2, 2), complex)
        dt, size = 2.0 * math.pi / omega / steps, 2e-4 * self.clearance
        for axis in range(2):
            force, now, slope = [], p, None
            wedge, old = self.start.copy(), self.thickness(p, self.start, flexible)
            for n in range(1, 3 * steps + 1):
                wedge[axis] = self.start[axis] + size * math.sin(omega * n * dt)
                left = self.outflow(now, old)

                def residual(q: np.ndarray, wedge=wedge, old=old, left=left) -> np.ndarray:
                    h = self.thickness(q, wedge, flexible)
                    return (self.volume(h) - self.volume(old)) / dt + 0.5 * (self.outflow(q, h) + left)

                now, slope = self.solve(residual, now, slope)
                old = self.thickness(now, wedge, flexible)
                force.append(self.weights @ (now - p))
            phase = np.exp(-1j * omega * dt * np.arange(2 * steps + 1, 3 * steps + 1))
            out[:, axis] = 2j / steps / size * (phase @ np.array(force)[2 * steps :])
        return out


def test_it_is_what_a_film_over_a_flexing_pad_does_when_marched_in_time(rocker):
    omega = 2 * math.pi * 50
    p = run(rocker, omega=omega, mesh=Mesh(20, 4))
    film = p.equilibrium.films[0]
    added = flexing_impedance(film, np.array([omega]), 1.0)[0]
    marched = _Marched(p, 0)
    marched.still_bent = film.bent
    assert not film.work.ruptured[1:-1, :-1].any()
    flexing, rigid = (marched.impedance(omega, flexible) for flexible in (True, False))
    linear = film.forces.stiffness + 1j * omega * film.forces.damping
    np.testing.assert_allclose(rigid, linear, atol=3e-3 * np.abs(linear).max())
    np.testing.assert_allclose(flexing - rigid, added, atol=5e-3 * np.abs(added).max())
    assert np.abs(added).max() > 0.3 * np.abs(rigid).max()
