"""Eq. (13)-(15): the linear system that holds the four dynamic stiffnesses of the bearing.

One window k of one excitation direction gives (Eq. 14)::

    | Fx |     | X  Y  0  0 |   | hxx |
    | Fy | k = | 0  0  X  Y | k | hxy |
                                | hyx |
                                | hyy |

and all windows and directions stacked give F = R h (Eq. 15).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tpjb_ident.arrays import ComplexArray, FloatArray


def r_matrix(D: ArrayLike, F: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Stack displacement and force phasors as in Eq. (14) and (15).

    Parameters
    ----------
    D : (n, 2) complex array
        Displacement phasors X, Y of n windows [m].
    F : (n, 2) complex array
        Oil-force phasors [N].

    Returns
    -------
    R : (2 n, 4) complex ndarray
        Rows 2 k and 2 k + 1 are the x and the y equation of window k [m].
    f : (2 n,) complex ndarray
        Fx, Fy of every window in turn [N].

    Raises
    ------
    ValueError
        Shapes other than (n, 2), or different n.
    """
    displacement, force = np.asarray(D, dtype=complex), np.asarray(F, dtype=complex)
    if displacement.ndim != 2 or displacement.shape[1] != 2 or displacement.shape != force.shape:
        raise ValueError(f"D and F must both be (n, 2), one row per window; got {displacement.shape} and {force.shape}")
    n = len(displacement)
    R = np.zeros((2 * n, 4), dtype=complex)
    R[0::2, 0:2] = displacement
    R[1::2, 2:4] = displacement
    return R, force.reshape(-1)


def real_rows(R: ComplexArray, f: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Write a complex system as a real one twice the size, for solvers that know real numbers only.

    Parameters
    ----------
    R : (m, p) complex ndarray
    f : (m,) complex ndarray

    Returns
    -------
    (2 m, 2 p) ndarray, (2 m,) ndarray
        Rows: real parts, then imaginary parts; unknowns: Re h, then Im h.
    """
    real = np.block([[R.real, -R.imag], [R.imag, R.real]])
    return real, np.concatenate([f.real, f.imag])
