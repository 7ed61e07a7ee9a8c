"""The estimators' common input: displacement and force phasors of many windows, in natural scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tpjb_ident.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.estimators.r_matrix import r_matrix, shared_block
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
    directions_differ : bool
        Whether directions are known (from elsewhere in the campaign) to differ by more than their repeats.
    """

    D: ComplexArray
    F: ComplexArray
    direction: IntArray
    d_scale: float
    f_scale: float
    reference: ComplexArray | None
    valid: BoolArray
    directions_differ: bool = False

    def __len__(self) -> int:
        return len(self.D)

    @property
    def n_directions(self) -> int:
        """Number of distinct direction labels."""
        return int(self.direction.max()) + 1 if len(self) else 0

    @property
    def h_scale(self) -> float:
        """Factor from scaled h to N/m."""
        return self.f_scale / self.d_scale


def phasor_table(
    D: ArrayLike, F: ArrayLike, direction: ArrayLike | None = None, reference: ArrayLike | None = None
) -> PhasorTable:
    """Build Eq. (15) from the windows, and check, scale and label them.

    Parameters
    ----------
    D, F : (n, 2) complex array
        [m], [N]; rows with a NaN are left out.
    direction : (n,) array of labels, optional
        Anything hashable; without it every window is a direction of its own.
    reference : (n, 2) complex array, optional

    Raises
    ------
    ArgumentError
        Shapes that do not fit together.
    """
    displacement, force = shared_block(*r_matrix(D, F))
    n = len(displacement)
    labels = np.arange(n) if direction is None else np.asarray(direction).ravel()
    if len(labels) != n:
        raise ArgumentError(f"direction must have one label per window: {n} windows, {len(labels)} labels")
    valid = np.asarray(np.isfinite(displacement).all(axis=1) & np.isfinite(force).all(axis=1))
    instruments = None
    if reference is not None:
        instruments = np.asarray(reference, dtype=complex)
        if instruments.shape != displacement.shape:
            raise ArgumentError(f"reference must be {displacement.shape} like D, got {instruments.shape}")
        valid &= np.isfinite(instruments).all(axis=1)
        instruments = instruments[valid]
        instruments = instruments / _scale(instruments)
    d_scale, f_scale = _scale(displacement[valid]), _scale(force[valid])
    _, codes = np.unique(labels[valid], return_inverse=True)
    return PhasorTable(
        displacement[valid] / d_scale,
        force[valid] / f_scale,
        codes.astype(np.intp).ravel(),
        d_scale,
        f_scale,
        instruments,
        valid,
    )


def _scale(phasors: ComplexArray) -> float:
    """Median modulus of the rows: a scale that a few gross outliers cannot move far."""
    if not len(phasors):
        return 1.0
    scale = float(np.median(np.linalg.norm(phasors, axis=1)))
    return scale if scale > 0 else 1.0


def displacement_condition(D: ComplexArray, weights: FloatArray | None = None) -> float:
    """Condition number of the displacement directions: largest over smallest singular value of D.

    Parameters
    ----------
    D : (n, 2) complex ndarray
    weights : (n,) ndarray, optional
    """
    rows = D if weights is None else D * np.sqrt(weights)[:, None]
    if len(rows) < 2:
        return np.inf
    singular = np.linalg.svd(rows, compute_uv=False)
    return float(singular[0] / singular[1]) if singular[1] > 1e-14 * singular[0] else np.inf
