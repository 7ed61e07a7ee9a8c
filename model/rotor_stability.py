"""A rigid rotor on a bearing, the smallest system that can be stable or not: modes, decay, threshold mass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.optimize import brentq

from model.frequency_model import FullSet

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class RotorModes:
    """Free motion of a rigid rotor whose bearing takes `mass` each, exp(lambda t).

    Attributes
    ----------
    mass : float
        Rotor mass per bearing [kg].
    eigenvalues : (n,) complex ndarray
        Those that turn (Im > 0), slowest decay first [rad/s].
    stable : bool
        Every eigenvalue, turning or not, decays.
    """

    mass: float
    eigenvalues: ComplexArray
    stable: bool

    @property
    def frequency(self) -> FloatArray:
        """Damped whirl frequencies [rad/s]."""
        return self.eigenvalues.imag

    @property
    def log_decrement(self) -> FloatArray:
        """Logarithm of the ratio of successive amplitudes; negative grows."""
        return np.asarray(-2.0 * math.pi * self.eigenvalues.real / self.eigenvalues.imag)


def rotor_modes(bearing: FullSet, mass: float) -> RotorModes:
    """Modes of a rigid rotor that moves without tilting, half of it on each of two equal bearings.

    Parameters
    ----------
    bearing : FullSet
        All of it is used: the pads follow at the frequency and the decay of each mode, nothing is synchronous.
    mass : float
        Rotor mass per bearing [kg].
    """
    if not (math.isfinite(mass) and mass > 0.0):
        raise ValueError(f"the rotor's mass per bearing must be positive [kg], got {mass!r}")
    values = _eigenvalues(bearing, mass)
    turning = values[values.imag > 1e-6 * np.abs(values)]
    order = np.argsort(-turning.real)
    return RotorModes(mass, turning[order], bool((values.real < 0.0).all()))


def _eigenvalues(bearing: FullSet, mass: float) -> ComplexArray:
    """Of M q'' + C q' + K q = 0, companion form; coordinates without mass give eigenvalues at infinity: left out."""
    n = len(bearing.names)
    inertia = bearing.mass.copy()
    inertia[:2, :2] += mass * np.eye(2)
    # tilts in metres at the shaft's scale, time in units of the rotor's own motion: or the pencil is badly scaled
    size = np.array([1.0 if "tilt" not in name else 0.1 for name in bearing.names])
    rate = math.sqrt(float(np.abs(np.diag(bearing.stiffness)[:2]).max()) / mass)
    scale = np.outer(1.0 / size, 1.0 / size) / (mass * rate**2)
    m, c, k = inertia * scale * rate**2, bearing.damping * scale * rate, bearing.stiffness * scale
    left = np.block([[np.zeros((n, n)), np.eye(n)], [-k, -c]])
    right = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), m]])
    alpha, beta = eigvals(left, right, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-12 * np.abs(alpha)
    return np.asarray(alpha[finite] / beta[finite] * rate)


def threshold_mass(bearing: FullSet, largest: float = 1e6) -> float:
    """Rotor mass per bearing above which it whirls by itself [kg]; infinite if it does not up to `largest`.

    Fixed pads (a journal bearing's cross-coupling) have one; pads that tilt freely hold any mass but for their own
    inertia.
    """

    def decay(logarithm: float) -> float:
        return float(_eigenvalues(bearing, math.exp(logarithm)).real.max())

    masses = np.linspace(math.log(1e-2), math.log(largest), 60)
    worst = np.array([decay(m) for m in masses])
    crossed = np.flatnonzero(worst > 0.0)
    if not len(crossed):
        return math.inf
    first = int(crossed[0])
    if first == 0:
        return 0.0
    return math.exp(brentq(decay, masses[first - 1], masses[first]))
