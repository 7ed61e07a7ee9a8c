"""Dynamic coefficients, Eq. (9)-(12): the pads' full matrices and their reduction at the excitation frequency.

Per pad, in (x, y, theta, eta), the film gives Z = K + i omega C by J^T Z_film J with the film's own 2 x 2
matrices in (a, b) and J = d(a, b)/d(x, y, theta, eta). Pad mass, inertia, k_theta, c_eta and the pivot's tangent
stiffness stand on the pad's diagonal, Eq. (12); eliminating (theta, eta) gives the 2 x 2 of Eq. (10). Signs are
those of `physics.md`: the force on the housing, dF = +h d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.setup import Setup
from model.statics.equilibrium import Equilibrium
from model.statics.pad_film import PadFilm

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class PadMatrices:
    """Full matrices of one pad in (x, y, theta, eta), Eq. (11) and (12).

    Attributes
    ----------
    number : int
        Pad, from 1.
    stiffness, damping : (4, 4) ndarray
        Film [N/m, N/rad, N m/rad; times s].
    pad_mass, pad_damping, pad_stiffness : (2, 2) ndarray
        Eq. (12), in (theta, eta). A rigid pivot has infinite k_eta.
    """

    number: int
    stiffness: FloatArray
    damping: FloatArray
    pad_mass: FloatArray
    pad_damping: FloatArray
    pad_stiffness: FloatArray


def pad_matrices(setup: Setup, film: PadFilm) -> PadMatrices | None:
    """Assemble the full matrices of one pad; None if it idles."""
    if film.forces is None:
        return None
    pad, law = film.pad, setup.pivots[film.number - 1]
    frame = np.array(
        [
            [film.normal[0], film.normal[1], 0.0, -1.0],
            [film.tangent[0], film.tangent[1], film.pivot_radius, 0.0],
        ]
    )
    offset = mass_centre_offset(setup, film)
    coupling = -pad.mass * offset  # the centre moves outward by eta - b tilt
    return PadMatrices(
        number=film.number,
        stiffness=frame.T @ film.forces.stiffness @ frame,
        damping=frame.T @ film.forces.damping @ frame,
        pad_mass=np.array([[pad.moment_of_inertia, coupling], [coupling, pad.mass]]),
        pad_damping=np.diag([0.0, setup.pivot_damping]),
        pad_stiffness=np.diag([setup.rotational_stiffness, law.vibration_stiffness(float(film.forces.force[0]))]),
    )


def mass_centre_offset(setup: Setup, film: PadFilm) -> float:
    """b_G, the mass centre's distance from the pivot line [m], positive with rotation; zero for a central pivot."""
    pad = film.pad
    middle = (0.5 - pad.pivot_offset) * pad.arc
    inner = setup.bearing.journal_radius + pad.pad_clearance
    outer = inner + pad.thickness
    half = 0.5 * pad.arc
    centroid = 2.0 / 3.0 * (outer**3 - inner**3) / (outer**2 - inner**2) * math.sin(half) / half
    return centroid * math.sin(middle)


def reduce_pads(pads: list[PadMatrices], omega: FloatArray) -> ComplexArray:
    """Eq. (10): the bearing's 2 x 2 impedance at every excitation frequency.

    Parameters
    ----------
    pads : list of PadMatrices
    omega : (n,) ndarray
        [rad/s]

    Returns
    -------
    (n, 2, 2) complex ndarray
        h = k + i omega c [N/m].
    """
    total = np.zeros((len(omega), 2, 2), dtype=complex)
    s = omega[:, None, None]
    for pad in pads:
        z = pad.stiffness + 1j * s * pad.damping
        rigid = math.isinf(pad.pad_stiffness[1, 1])  # a rigid pivot: eta takes no part
        keep = slice(2, 3) if rigid else slice(2, 4)
        inner = slice(0, 1) if keep.stop == 3 else slice(0, 2)
        own = (
            -(s**2) * pad.pad_mass[inner, inner]
            + 1j * s * pad.pad_damping[inner, inner]
            + pad.pad_stiffness[inner, inner]
        )
        film = z[:, keep, keep] + own
        total += z[:, :2, :2] - z[:, :2, keep] @ np.linalg.solve(film, z[:, keep, :2])
    return total


def bearing_impedance(setup: Setup, equilibrium: Equilibrium, omega: FloatArray) -> ComplexArray:
    """h(omega) of the bearing inside the measured displacement, effects of the structure included.

    Returns
    -------
    (n, 2, 2) complex ndarray
        With added mass and series compliance, before any instrument.
    """
    pads = [m for film in equilibrium.films if (m := pad_matrices(setup, film)) is not None]
    h = reduce_pads(pads, omega)
    if setup.added_mass:
        h = h - (omega**2)[:, None, None] * setup.added_mass * np.eye(2)
    if setup.series_compliance:
        h = np.linalg.solve(np.eye(2) + setup.series_compliance * h, h).astype(np.complex128, copy=False)
    return h
