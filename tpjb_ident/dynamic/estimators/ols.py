"""Ordinary least squares on the complex rows of Eq. (15): the plain answer that others are held against."""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray


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
