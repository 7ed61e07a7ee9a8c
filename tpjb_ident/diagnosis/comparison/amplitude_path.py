"""Amplitude path: what one amplitude does to the prediction, over all sizes that a rig may have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from rigdata.arrays import FloatArray


@dataclass(frozen=True)
class AmplitudePath:
    """Change of a prediction along one amplitude: cubic pieces between amplitudes at which the model was asked.

    Pieces that rise where their ends rise (Fritsch & Carlson, SIAM J. Numer. Anal. 17 (1980) 238): a pad that comes out
    of contact lets K and C jump, at another amplitude for every load, and one polynomial through all of it is wrong
    everywhere.
    """

    at: FloatArray  #: (m,): amplitudes, counted from the neutral one, which is among them; rising
    columns: FloatArray  #: (n, 2 m): changes of the prediction there, then its derivatives

    def weights(self, amplitudes: FloatArray) -> FloatArray:
        """Weights of the columns in the change at some amplitudes, (k, 2 m); straight lines beyond the ends."""
        inside = self._inside(amplitudes)
        return self._pieces(inside, _VALUE) + (amplitudes - inside)[:, None] * self.slope_weights(inside)

    def slope_weights(self, amplitudes: FloatArray) -> FloatArray:
        """Weights of the columns in the derivative at some amplitudes, (k, 2 m); `amplitudes` (k,)."""
        return self._pieces(self._inside(amplitudes), _SLOPE)

    def slope(self, amplitude: float) -> FloatArray:
        """Derivative at an amplitude, (n,)."""
        return np.asarray(self.columns @ self.slope_weights(np.array([amplitude]))[0])

    def _inside(self, amplitudes: FloatArray) -> FloatArray:
        return np.clip(amplitudes, self.at[0], self.at[-1])

    def _pieces(self, inside: FloatArray, basis: FloatArray) -> FloatArray:
        count = len(self.at)
        lower = np.clip(np.searchsorted(self.at, inside, side="right") - 1, 0, count - 2)
        length = self.at[lower + 1] - self.at[lower]
        u = (inside - self.at[lower]) / length
        # of value at left, value at right, derivative at left, derivative at right
        parts = (u[:, None] ** np.arange(4)) @ basis
        if basis is _VALUE:
            parts[:, 2:] *= length[:, None]
        else:
            parts[:, :2] /= length[:, None]
        out = np.zeros((len(inside), 2 * count))
        rows = np.arange(len(inside))
        for column, at in enumerate((lower, lower + 1, count + lower, count + lower + 1)):
            out[rows, at] = parts[:, column]
        return out


#: Cubic Hermite pieces by powers of the place within the piece, rows 1, u, u^2, u^3.
_VALUE = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]])
_SLOPE = np.array([[0.0, 0, 1, 0], [-6, 6, -4, -2], [6, -6, 3, 3], [0, 0, 0, 0]])


def path_through(amplitudes: Sequence[float], changes: Sequence[FloatArray]) -> AmplitudePath:
    """Lay a path through what the model said; `changes` (n,) each."""
    order = np.argsort([0.0, *amplitudes])
    at = np.array([0.0, *amplitudes])[order]
    values = np.array([np.zeros_like(changes[0]), *changes])[order]
    return AmplitudePath(at, np.hstack([values.T, PchipInterpolator(at, values, axis=0).derivative()(at).T]))
