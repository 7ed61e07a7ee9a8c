"""Eq. (13)-(15): the linear system that holds the four dynamic stiffnesses of the bearing.

One window k of one excitation direction gives (Eq. 14)::

    | Fx |     | X  Y  0  0 |   | hxx |
    | Fy | k = | 0  0  X  Y | k | hxy |
                                | hyx |
                                | hyy |

and all windows and directions stacked give F = R h (Eq. 15).

R holds each window's X, Y twice: once in its x equation, once in its y equation. So Eq. (15) falls into two systems of
two unknowns with the same (n, 2) block, and an estimator that works on the block solves Eq. (15) itself, with half
the unknowns, and sees both equations of a window at once. `phasor_table` builds R and hands its block to every
estimator.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.errors import ArgumentError


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
    ArgumentError
        Shapes other than (n, 2), or different n.
    """
    displacement, force = np.asarray(D, dtype=complex), np.asarray(F, dtype=complex)
    if displacement.ndim != 2 or displacement.shape[1] != 2 or displacement.shape != force.shape:
        raise ArgumentError(
            f"D and F must both be (n, 2), one row per window; got {displacement.shape} and {force.shape}"
        )
    n = len(displacement)
    R = np.zeros((2 * n, 4), dtype=complex)
    R[0::2, 0:2] = displacement
    R[1::2, 2:4] = displacement
    return R, force.reshape(-1)


def shared_block(R: ComplexArray, f: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """The block of R that both force equations share, and the forces beside it.

    Parameters
    ----------
    R : (2 n, 4) complex ndarray
        As `r_matrix` builds it [m].
    f : (2 n,) complex ndarray
        [N].

    Returns
    -------
    D, F : (n, 2) complex ndarray
        One row per window: X, Y [m] and Fx, Fy [N]; F = D H^T is Eq. (15).
    """
    return np.ascontiguousarray(R[0::2, 0:2]), f.reshape(-1, 2)


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


def ols_fit(D: ComplexArray, F: ComplexArray) -> ComplexArray:
    """Solve F = H D in the least-squares sense.

    Parameters
    ----------
    D, F : (n, 2) complex ndarray

    Returns
    -------
    (2, 2) complex ndarray
        H; both force equations share the displacements, so Eq. (15) falls into two problems of two unknowns.
    """
    return np.asarray(np.linalg.lstsq(D, F, rcond=None)[0], dtype=complex).T
