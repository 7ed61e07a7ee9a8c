"""Motion in what windows or bins leave of a point's means: it is no noise, F = H D holds for it.

A drive that wanders or a line close by moves the shaft from window to window. Counted as noise of the probes, such
motion would explain away what an error of H leaves. It is known by its pattern: displacements and oil forces answer it
as they do in the means of the runs.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray

#: Power of a motion, over what the channels' own noise puts along it, up to which it counts as noise: an error of H
#: below a tenth is not explained away by so little, and noise that channels share is not taken for motion.
_AS_NOISE = 100.0
#: Rounds in which the channels' own noise is found.
_ROUNDS = 3
#: Noise that every channel has at least, over what all channels leave: few bins fit exactly.
_LEAST = 1e-9
#: Keeps records without noise finite.
_TINY = 1e-300


def motion_in(residual: ComplexArray, weights: FloatArray, means: ComplexArray, film: FloatArray) -> ComplexArray:
    """The part of residuals (n, m) that is motion beyond what the channels' own noise explains, (n, m).

    `weights` (n,) of the residuals, `means` (g, m) of the runs, `film` (m, m): displacements and oil forces of the
    channels, accelerometers none.
    """
    if not len(residual):
        return residual
    shown = means @ film.T
    scale = np.abs(shown).max(axis=0, initial=0.0)
    scale[scale == 0] = 1.0
    # motion along two directions spans the runs
    pattern = np.linalg.svd(shown / scale, full_matrices=False)[2][:2].T
    z, root = residual @ film.T / scale, np.sqrt(weights)[:, None]
    rest, total = z, max(float(weights.sum()), 1.0)
    m, k = pattern.shape
    least = _LEAST * float(np.mean(np.abs(root * z) ** 2)) + _TINY
    for _ in range(_ROUNDS):
        variance = np.sum(np.abs(root * rest) ** 2, axis=0) / total * m / max(m - k, 1) + least
        gram = np.linalg.inv(pattern.conj().T @ (pattern / variance[:, None]) + _LEAST**2 / least * np.eye(k))
        along = z / variance @ pattern.conj()
        rest = z - along @ gram.T @ pattern.T
    size = np.linalg.cholesky(gram)  # noise has a covariance of one along the patterns in this unit
    unit = root * (along @ size.conj())
    power, axes = np.linalg.eigh(unit.T @ unit.conj() / total)
    excess = np.where(power > _AS_NOISE, 1 - 1 / np.sqrt(np.maximum(power, _TINY)), 0.0)
    part = size @ (axes * excess) @ axes.conj().T @ size.conj().T
    return np.asarray(along @ part.T @ pattern.T * scale, dtype=complex)
