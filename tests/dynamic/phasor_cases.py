"""A dynamic stiffness and circular noise, for exact limits of estimates made by hand."""

from __future__ import annotations

import numpy as np

H = np.array([[2.0 + 0.7j, 0.3 - 0.2j], [-0.4 + 0.1j, 1.5 + 0.9j]])


def complex_normal(rng, *shape):
    """Circular, unit power per component."""
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)
