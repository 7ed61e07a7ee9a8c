"""A bearing known in closed form: dynamic stiffness over load, load direction and frequency, and its non-linearity.

Neither `model` nor the virtual rig has a part in it: the numbers are chosen, not computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Load at which the numbers below hold [N].
NOMINAL = 5000.0


@dataclass(frozen=True)
class Bearing:
    """h(omega, W, direction) = K (W/W0)^a - omega^2 M + i omega C (W/W0)^b, turned with the load's direction.

    `second` and `third` are the film's next terms: force = k x (1 + second x/c + third (x/c)^2), along the motion.
    """

    K: tuple[tuple[float, float], ...] = ((1.6e8, 0.15e8), (-0.12e8, 2.4e8))
    C: tuple[tuple[float, float], ...] = ((4.2e5, -0.2e5), (-0.25e5, 5.5e5))
    M: tuple[tuple[float, float], ...] = ((12.0, 1.0), (-1.0, 16.0))
    stiffness_exponent: float = 0.55
    damping_exponent: float = 0.30
    clearance: float = 80e-6
    second: float = 0.0
    third: float = 0.0

    def h(self, omega: float, load: float, aside: float = 0.0) -> np.ndarray:
        """Dynamic stiffness (2, 2) [N/m] at `omega` [rad/s], `load` [N], turned by `aside` [rad]."""
        share = load / NOMINAL
        K = np.array(self.K) * share**self.stiffness_exponent
        C = np.array(self.C) * share**self.damping_exponent
        turn = np.array([[np.cos(aside), -np.sin(aside)], [np.sin(aside), np.cos(aside)]])
        return turn @ (K - omega**2 * np.array(self.M) + 1j * omega * C) @ turn.T
