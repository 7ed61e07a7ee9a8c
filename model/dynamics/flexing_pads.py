"""A film's impedance with pads that bend with the motion.

The perturbation of the baseline moves pads as rigid bodies. Here a pad's deformation w is an internal degree of
freedom, as tilt and deflection are. With S_ab and S_w the film's complex pressure slopes at the excitation frequency
by (a, b) and by its shape, C the pad's compliance (its own mass is left out: a pad's first bending mode lies at
kilohertz) and W what pressure pushes with,

    p' = S_ab (a, b)' + S_w w',    w' = C p',    F' = W p'.

The pad's softest shapes are solved at once, the rest follows in a few turns, as in an equilibrium. At rest this is the
slope of the static locus with pads that bend; for a stiff pad it is the rigid one.
"""

from __future__ import annotations

import numpy as np

from model.arrays import ComplexArray, FloatArray
from model.film.reynolds import conductances
from model.film.slopes import shape_slopes, squeeze_slopes
from model.statics.pad_film import PadFilm

#: Turns of pressure and deformation, and the share of the deformation at which they end.
MOST_TURNS, SETTLED = 40, 1e-7


def flexing_impedance(film: PadFilm, position: FloatArray, omega: FloatArray, factor: float) -> ComplexArray:
    """What bending with the motion adds to a film's impedance.

    Parameters
    ----------
    film : PadFilm
        Of a solved equilibrium, with a pad that deforms.
    position : (2,) ndarray
        Journal [m].
    omega : (n,) ndarray
        [rad/s]
    factor : float
        On the pad's computed compliance.

    Returns
    -------
    (n, 2, 2) complex ndarray
        By (a, b) [N/m].

    Notes
    -----
    J. W. Lund, L. B. Pedersen, ASME J. Tribology 109 (1987) 65, of pads that flex in tilting-pad bearings.
    """
    body, grid, work = film.deformation, film.grid, film.work
    assert body is not None
    wedge = (film.pad.pad_clearance, *film.approach(position))
    conductance = conductances(grid, work, *wedge)
    still, moving = shape_slopes(grid, work, conductance, body.shapes), squeeze_slopes(grid, work, body.shapes)
    out = np.empty((len(omega), 2, 2), dtype=np.complex128)
    for k, w in enumerate(omega.tolist()):
        rigid = work.slopes[:, :2] + 1j * w * work.slopes[:, 2:4]
        closed = np.eye(len(body.response)) - factor * (body.response @ (still + 1j * w * moving))
        pressure, bent = rigid, np.zeros((*work.pressure.shape, 2), dtype=np.complex128)
        for _ in range(MOST_TURNS):
            wanted = factor * (body.compliance @ _everywhere(film, pressure))
            missing = wanted - bent.reshape(wanted.shape)
            if not np.abs(missing).max() > SETTLED * np.abs(wanted).max():
                break
            asked = body.amplitudes @ missing
            bent += missing.reshape(bent.shape) + body.shapes @ (np.linalg.solve(closed, asked) - asked)
            pressure = rigid + _by_shape(film, conductance, bent, w)
        else:
            pressure = np.full_like(rigid, np.nan)
        out[k] = body.weights @ (pressure - rigid)
    return out


def _everywhere(film: PadFilm, pressure: ComplexArray) -> ComplexArray:
    """Pressure at all nodes, (n, 2), from that at the unknown ones."""
    whole = np.zeros((*film.work.pressure.shape, 2), dtype=np.complex128)
    inner = whole[1:-1, film.grid.first : -1]
    inner[:] = pressure.reshape(inner.shape)
    return whole.reshape(-1, 2)


def _by_shape(
    film: PadFilm, conductance: tuple[FloatArray, FloatArray], bent: ComplexArray, omega: float
) -> ComplexArray:
    """Pressure at the unknown nodes, (unknowns, 2), that deformations (nt + 1, nz + 1, 2) make."""
    parts = np.ascontiguousarray(np.concatenate([bent.real, bent.imag], axis=2))
    still = shape_slopes(film.grid, film.work, conductance, parts)
    moving = squeeze_slopes(film.grid, film.work, parts)
    by_shape = still + 1j * omega * moving
    return np.asarray(by_shape[:, :2] + 1j * by_shape[:, 2:])
