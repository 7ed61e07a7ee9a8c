"""Instrumental variables: reference channels (the actuators' command) against noise on the displacements.

All four measured phasors are regressed, robustly and jointly, on the two references; the noise of
D then sits on the left-hand side, where it does no harm: H = B_F B_D^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.mm import mm_fit
from tpjb_ident.dynamic.estimators.r_matrix import PhasorTable, ols_fit
from tpjb_ident.errors import ArgumentError


@dataclass(frozen=True)
class InstrumentalFit:
    """Result in the table's scale."""

    h: ComplexArray  #: (2, 2) complex
    explained: PhasorTable
    weights: FloatArray  #: (n,)
    conditions: tuple[Condition, ...]


def instrumental_fit(table: PhasorTable) -> InstrumentalFit:
    """Robust instrumental-variables estimate."""
    if table.reference is None:
        raise ArgumentError('method "iv" needs reference phasors (n, 2), for instance the actuators\' command')
    # The fit follows any change of components; what plain least squares leaves of F has little in common with D, and
    # where it is nothing at all the scatter is badly scaled instead of singular.
    plain = ols_fit(table.D, table.F)
    z = np.concatenate([table.D, table.F - table.D @ plain.T], axis=1)
    fit = mm_fit(table.reference, z, table.direction)
    B_D, B_left = fit.coefficients[:2], fit.coefficients[2:]
    h = plain + np.linalg.solve(B_D.T, B_left.T).T
    # F - h D does not change when D is replaced by its explained part and F by F - h (D - explained).
    explained_D = table.reference @ B_D.T
    explained_F = table.F - (table.D - explained_D) @ h.T
    explained = PhasorTable(
        explained_D, explained_F, table.direction, table.d_scale, table.f_scale, table.reference, table.valid
    )
    return InstrumentalFit(h, explained, fit.weights, fit.conditions)
