"""Force of the oil film from what the load cells and accelerometers say.

Housing balance: F_oil = F_cell + m_h a_h, with F_cell the force with which the housing pushes the
cells and a_h the absolute acceleration of the housing.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray
from tpjb_ident.errors import BadInputError


def oil_force(cell_force: ComplexArray, housing_acceleration: ComplexArray | None, housing_mass: float) -> ComplexArray:
    """Oil-film force phasors.

    Parameters
    ----------
    cell_force : (..., 2) complex ndarray
        Load-cell force in X, Y [N].
    housing_acceleration : (..., 2) complex ndarray or None
        [m/s^2]; None when the rig has no accelerometers, then the cell force stands uncorrected.
    housing_mass : float
        Mass between oil film and load cells [kg].

    Returns
    -------
    (..., 2) complex ndarray
        [N].

    Raises
    ------
    BadInputError
        The mass is not a finite number >= 0.
    """
    if not (np.isfinite(housing_mass) and housing_mass >= 0):
        raise BadInputError(f"housing mass must be finite and not negative, got {housing_mass} kg")
    if housing_acceleration is None:
        return np.asarray(cell_force, dtype=complex)
    return np.asarray(cell_force + housing_mass * housing_acceleration, dtype=complex)
