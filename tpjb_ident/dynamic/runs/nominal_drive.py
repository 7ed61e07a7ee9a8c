"""What the actuators were told to do, as far as a campaign says: instruments for the `iv` estimator.

The format has no channel for the actuators' command. But every run states the direction of its excitation, and the
part of its own mean force along that direction has the size and phase of the command: averaged over the run's
windows it knows next to nothing of a single window's noise, and nothing of the displacements' noise.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray
from tpjb_ident.dynamic.runs.point_data import PointData

#: Windows that a run needs, for its mean to be nearly free of each window's own noise.
MIN_WINDOWS = 5
#: Smallest sine of the angle between two excitation directions that counts as two.
MIN_SINE = 0.1


def nominal_drive(data: PointData) -> ComplexArray | None:
    """Instruments (n, 2) [N] of one point's windows; None where the campaign cannot give them.

    Parameters
    ----------
    data : PointData

    Returns
    -------
    (n, 2) complex ndarray or None
        None where a run states no direction, has too few windows, or all directions are alike.
    """
    angles = [run.direction for run in data.runs]
    known = np.array([a for a in angles if a is not None])
    if len(known) < len(angles) or len(known) < 2 or np.abs(np.sin(known - known[0])).max() < MIN_SINE:
        return None
    result = np.full(data.F.shape, np.nan + 0j)
    for i, angle in enumerate(known):
        mine = data.run_index == i
        along = data.F[mine] @ np.array([np.cos(angle), np.sin(angle)])
        along = along[np.isfinite(along)]
        if len(along) < MIN_WINDOWS:
            return None
        drive = np.median(along.real) + 1j * np.median(along.imag)
        result[mine] = drive * np.array([np.cos(angle), np.sin(angle)])
    return result
