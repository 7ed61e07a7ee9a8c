"""Windows of one direction whose drive phase wanders: turned to a common phase before averaging.

Repeats are repeats of one phasor only while the actuators' generator is locked to the recorder. Where
it is not, each window's phasors turn by a common angle, which F = H D does not see, but an average does.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray, IntArray

#: |sum| over sum of moduli of a direction's windows below which its phase counts as wandering.
LOCKED = 0.9


def aligned(z: ComplexArray, direction: IntArray, weights: FloatArray) -> tuple[ComplexArray, int]:
    """Turn windows to their direction's common phase where the phase wanders.

    Parameters
    ----------
    z : (n, m) complex ndarray
        All measured phasors of every window.
    direction : (n,) ndarray of int
    weights : (n,) ndarray
        Windows that count; the others are turned along.

    Returns
    -------
    (n, m) complex ndarray, int
        Turned windows, and how many directions needed it.
    """
    result, wandering = z, 0
    for d in range(int(direction.max()) + 1):
        mine = np.flatnonzero(direction == d)
        good = mine[weights[mine] > 0]
        if len(good) < 3:
            continue
        pattern = np.linalg.svd(z[good], full_matrices=False)[2][0].conj()
        along = z[mine] @ pattern
        counted = z[good] @ pattern
        if abs(counted.sum()) >= LOCKED * np.abs(counted).sum():
            continue
        if wandering == 0:
            result = z.copy()
        wandering += 1
        turn = np.exp(-1j * np.angle(along))
        result[mine] = z[mine] * turn[:, None]
    return result, wandering
