"""Eq. (13)-(15): the linear system that holds the four dynamic stiffnesses, and the windows in it, scaled.

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

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Conditions
from tpjb_ident.errors import ArgumentError


@dataclass(frozen=True)
class PhasorTable:
    """Windows of one operating point and one excitation line.

    Displacements and forces are divided by their own root mean square, so that every solver sees
    numbers of order one (absolute tolerances then mean the same in any unit).

    Attributes
    ----------
    D, F : (n, 2) complex ndarray
        Scaled displacement and force phasors.
    direction : (n,) ndarray of int
        Windows with one number are repeats of one excitation.
    d_scale, f_scale : float
        What they were divided by [m], [N]; h in N/m is h scaled times f_scale / d_scale.
    reference : (n, 2) complex ndarray or None
        Instruments, scaled likewise.
    valid : (n_given,) ndarray of bool
        Which of the given windows are in the table (finite ones).
    """

    D: ComplexArray
    F: ComplexArray
    direction: IntArray
    d_scale: float
    f_scale: float
    reference: ComplexArray | None
    valid: BoolArray

    def __len__(self) -> int:
        return len(self.D)

    @property
    def n_directions(self) -> int:
        """Number of distinct direction labels."""
        return len(np.unique(self.direction))

    @property
    def h_scale(self) -> float:
        """Factor from scaled h to N/m."""
        return self.f_scale / self.d_scale


@dataclass(frozen=True)
class TableFit:
    """One method's answer on a table of n windows, in the table's scale."""

    h: ComplexArray  #: (2, 2)
    weights: FloatArray  #: (n,), or (n, 2) by force axis
    covariance: FloatArray = field(default_factory=lambda: np.full((8, 8), np.nan))
    dof: FloatArray = field(default_factory=lambda: np.full(8, np.nan))
    conditions: Conditions = ()
    chi_square: float = np.nan
    attenuation: FloatArray = field(default_factory=lambda: np.full(2, np.nan))


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

    Examples
    --------
    >>> R, f = ti.r_matrix([[1e-6, 2e-6]], [[300.0, 900.0]])
    >>> print((R * 1e6).real, f.real)
    [[1. 2. 0. 0.]
     [0. 0. 1. 2.]] [300. 900.]
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


def real_rows(R: ComplexArray, f: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Write a complex system as a real one twice the size, for solvers that know real numbers only.

    `R` (m, p), `f` (m,), gives (2 m, 2 p) and (2 m,).
    """
    real = np.block([[R.real, -R.imag], [R.imag, R.real]])
    return real, np.concatenate([f.real, f.imag])


def ols_fit(D: ComplexArray, F: ComplexArray) -> ComplexArray:
    """Solve F = H D in the least-squares sense, (2, 2); `D`, `F` (n, 2)."""
    return np.asarray(np.linalg.lstsq(D, F, rcond=None)[0], dtype=complex).T


def phasor_table(
    D: ArrayLike, F: ArrayLike, direction: ArrayLike | None = None, reference: ArrayLike | None = None
) -> PhasorTable:
    """Build Eq. (15) from the windows, and check, scale and label them.

    `D`, `F` (n, 2) [m], [N], `direction` (n,), `reference` (n, 2).
    """
    R, f = r_matrix(D, F)
    # the block of R that both force equations share, the forces, and instruments
    given = [R[0::2, 0:2], f.reshape(-1, 2)] + ([] if reference is None else [np.asarray(reference, dtype=complex)])
    n = len(given[0])
    labels = np.arange(n) if direction is None else np.asarray(direction).ravel()
    if len(labels) != n:
        raise ArgumentError(f"direction must have one label per window: {n} windows, {len(labels)} labels")
    if given[-1].shape != (n, 2):
        raise ArgumentError(f"reference must be {(n, 2)} like D, got {given[-1].shape}")
    valid = np.isfinite(np.concatenate(given, axis=1)).all(axis=1)
    scales = [_scale(phasors[valid]) for phasors in given]
    tables = [phasors[valid] / scale for phasors, scale in zip(given, scales)]
    _, codes = np.unique(labels[valid], return_inverse=True)
    instruments = None if reference is None else tables[2]
    return PhasorTable(tables[0], tables[1], codes.astype(np.intp).ravel(), scales[0], scales[1], instruments, valid)


def _scale(phasors: ComplexArray) -> float:
    """Median modulus of the rows: a scale that a few gross outliers cannot move far."""
    if not len(phasors):
        return 1.0
    scale = np.median(np.linalg.norm(phasors, axis=1))
    return scale if scale > 0 else 1.0


def displacement_condition(D: ComplexArray, weights: FloatArray | None = None) -> float:
    """Condition number of the displacement directions: largest over smallest singular value of D.

    `D` (n, 2), `weights` (n,).
    """
    rows = D if weights is None else D * np.sqrt(weights)[:, None]
    if len(rows) < 2:
        return np.inf
    singular = np.linalg.svd(rows, compute_uv=False)
    return float(singular[0] / singular[1]) if singular[1] > 1e-14 * singular[0] else np.inf


def complex_to_real_covariance(hermitian: ComplexArray) -> FloatArray:
    """Covariance of [Re h, Im h] from E[e e^H] of circular errors, (2 m, 2 m); `hermitian` (m, m)."""
    real = 0.5 * np.block([[hermitian.real, -hermitian.imag], [hermitian.imag, hermitian.real]])
    return 0.5 * (real + real.T)  # rounding apart, it is symmetric
