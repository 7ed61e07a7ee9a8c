"""Friction of pivots under vibration: where the vibration does not break a pivot loose, it is a rotational stiffness.

A pivot that sticks has the stiffness k_s of its contact; one that slides passes the moment M_f = mu W R, whichever way
it moves (Jenkins' element). Under harmonic vibration with tilt amplitude A its first harmonic is N(A) A with, for
A > M_f / k_s and cos(phi) = 1 - 2 M_f / (k_s A),

    Re N = k_s (phi - sin(2 phi) / 2) / pi,    Im N = 4 M_f (1 - M_f / (k_s A)) / (pi A):

from k_s where it just holds, to nothing where it moves far. The tilt amplitude follows from that of the journal, X and
Y each excited alone.

T. K. Caughey, ASME J. Appl. Mech. 27 (1960) 640 (harmonic response of the bilinear hysteretic element).
"""

from __future__ import annotations

import math

import numpy as np

from model.arrays import ComplexArray, FloatArray

HALVINGS = 60


def describing(amplitude: FloatArray, stick: float, slip: float) -> ComplexArray:
    """N(A) [N m/rad] of a pivot with contact stiffness `stick` [N m/rad] and friction moment `slip` [N m]."""
    share = slip / (stick * np.maximum(amplitude, slip / stick))
    phi = np.arccos(np.clip(1.0 - 2.0 * share, -1.0, 1.0))
    turning = phi - 0.5 * np.sin(2.0 * phi)
    return np.asarray(stick / math.pi * (turning + 4.0j * share * (1.0 - share)), dtype=np.complex128)


def friction_impedance(own: ComplexArray, drive: FloatArray, stick: float, slip: float) -> ComplexArray:
    """Rotational impedance of a pivot's friction."""
    if not slip > 0.0:
        return np.zeros_like(own)
    low = np.full(own.shape, slip / stick)
    held = np.abs(own + stick) * low >= drive  # tilted as far as the contact gives, it would take more than there is
    high = np.maximum(2.0 * low, 2.0 * drive / np.maximum(np.abs(own), 1e-30) + 2.0 * low)
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        short = np.abs(own + describing(middle, stick, slip)) * middle < drive
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.where(held, stick + 0.0j, describing(high, stick, slip))
