"""A film's impedance with pads that bend with the motion, and with pads that tilt along the shaft.

The perturbation of the baseline moves pads as rigid bodies. Here a pad's deformation w is an internal degree of
freedom, as tilt and deflection are. With S_ab and S_w the film's complex pressure slopes at the excitation frequency
by (a, b) and by its shape, C the pad's compliance (its own mass is left out: a pad's first bending mode lies at
kilohertz) and W what pressure pushes with,

    p' = S_ab (a, b)' + S_w w',    w' = C p',    F' = W p'.

The pad's softest shapes are solved at once, the rest follows in a few turns, as in an equilibrium. At rest this is the
slope of the static locus with pads that bend; for a stiff pad it is the rigid one. A pad's axial tilt
(`model.pad.bending.AxialTilt`) is one more column of S_ab, and leaves by its own equation of motion about the pivot.
"""

from __future__ import annotations

import numpy as np

from model.arrays import ComplexArray, FloatArray
from model.film.reynolds import conductances
from model.film.slopes import shape_slopes, squeeze_slopes
from model.pad.bending import AxialTilt, force_weights
from model.statics.pad_film import PadFilm

#: Turns of pressure and deformation, and the share of the deformation at which they end.
MOST_TURNS, SETTLED = 40, 1e-7


def flexing_impedance(
    film: PadFilm, position: FloatArray, omega: FloatArray, factor: float, axial: tuple[AxialTilt, float] | None = None
) -> ComplexArray:
    """What bending and axial tilting with the motion add to a film's impedance."""
    work, weights = film.work, force_weights(film.grid)
    conductance = conductances(film.grid, work, film.pad.pad_clearance, *film.approach(position))
    still, moving = work.slopes[:, :2], work.slopes[:, 2:4]
    if axial is not None:
        shape = axial[0].shape[:, :, None]
        still = np.hstack([still, shape_slopes(film.grid, work, conductance, shape)])
        moving = np.hstack([moving, squeeze_slopes(film.grid, work, shape)])
    bend = _Bend(film, conductance, factor) if factor else None
    out = np.empty((len(omega), 2, 2), dtype=np.complex128)
    for k, w in enumerate(omega.tolist()):
        rigid = still + 1j * w * moving
        pressure = rigid if bend is None else bend.pressure(rigid, w)
        out[k] = weights @ (pressure - rigid)[:, :2]
        if axial is not None:
            moment = axial[0].weights @ pressure
            own = axial[0].stiffness - axial[1] * w * w - moment[2]
            out[k] += np.outer(weights @ pressure[:, 2], moment[:2]) / own
    return out


class _Bend:
    """The film's pressure with a pad that bends, from that with a rigid one."""

    def __init__(self, film: PadFilm, conductance: tuple[FloatArray, FloatArray], factor: float) -> None:
        assert film.deformation is not None
        self.film, self.conductance, self.factor, self.body = film, conductance, factor, film.deformation
        self.still = shape_slopes(film.grid, film.work, conductance, self.body.shapes)
        self.moving = squeeze_slopes(film.grid, film.work, self.body.shapes)

    def pressure(self, rigid: ComplexArray, omega: float) -> ComplexArray:
        """Pressure (unknowns, m) from that of a rigid pad; NaN where it finds no rest."""
        body, factor = self.body, self.factor
        closed = np.eye(len(body.response)) - factor * (body.response @ (self.still + 1j * omega * self.moving))
        pressure, bent = rigid, np.zeros((*self.film.work.pressure.shape, rigid.shape[1]), dtype=np.complex128)
        for _ in range(MOST_TURNS):
            wanted = factor * (body.compliance @ _everywhere(self.film, pressure))
            missing = wanted - bent.reshape(wanted.shape)
            if not np.abs(missing).max() > SETTLED * np.abs(wanted).max():
                return pressure
            asked = body.amplitudes @ missing
            bent += missing.reshape(bent.shape) + body.shapes @ (np.linalg.solve(closed, asked) - asked)
            pressure = rigid + _by_shape(self.film, self.conductance, bent, omega)
        return np.full_like(rigid, np.nan)


def _everywhere(film: PadFilm, pressure: ComplexArray) -> ComplexArray:
    """Pressure at all nodes, (n, m), from that at the unknown ones."""
    whole = np.zeros((*film.work.pressure.shape, pressure.shape[1]), dtype=np.complex128)
    inner = whole[1:-1, film.grid.first : -1]
    inner[:] = pressure.reshape(inner.shape)
    return whole.reshape(-1, pressure.shape[1])


def _by_shape(
    film: PadFilm, conductance: tuple[FloatArray, FloatArray], bent: ComplexArray, omega: float
) -> ComplexArray:
    """Pressure at the unknown nodes, (unknowns, m), that deformations (nt + 1, nz + 1, m) make."""
    parts = np.ascontiguousarray(np.concatenate([bent.real, bent.imag], axis=2))
    still = shape_slopes(film.grid, film.work, conductance, parts)
    moving = squeeze_slopes(film.grid, film.work, parts)
    by_shape = still + 1j * omega * moving
    count = bent.shape[2]
    return np.asarray(by_shape[:, :count] + 1j * by_shape[:, count:])
