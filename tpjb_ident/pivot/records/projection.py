"""Load and displacement on the direction of a pad (paper, Sec. 5, Fig. 10), and what lies across it.

The rig never pushes exactly at a pad, and the shaft does not give exactly where it is pushed. What counts
for the pivot is the component of both along the pad's direction. The component across tells whether the
record is what it claims to be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.pivot.records.blocks import Blocks
from tpjb_ident.slow_records.noise import NoiseModel


@dataclass(frozen=True)
class PadDirection:
    """A direction fitted to vectors."""

    angle: float
    se: float

    def __str__(self) -> str:
        return f"{math.degrees(self.angle):+.2f} deg (se {math.degrees(self.se):.2f} deg) from the pad"


@dataclass(frozen=True)
class Projection:
    """Blocks on the axes of a pad: along (outward positive) and across (counter-clockwise positive)."""

    load: FloatArray
    across_load: FloatArray
    deflection: FloatArray
    across: FloatArray


def pad_axes(angle: float) -> FloatArray:
    """Rows: unit vectors along and across a pad direction [rad], (2, 2)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def project(blocks: Blocks, angle: float) -> Projection:
    """Project loads and displacements on a pad direction."""
    axes = pad_axes(angle)
    load = blocks.load @ axes.T
    displacement = blocks.displacement @ axes.T
    return Projection(load[:, 0], load[:, 1], displacement[:, 0], displacement[:, 1])


def load_direction(projection: Projection, blocks: Blocks) -> PadDirection:
    """PadDirection in which the load grows, relative to the pad."""
    vectors = np.column_stack([projection.load, projection.across_load])
    size = np.hypot(*vectors.T)
    # neighbouring blocks share one hold: their scatter about the line is counted hold by hold
    holds = max(len(np.unique(blocks.hold[blocks.hold >= 0])), 3)
    return _growth(vectors, size, np.eye(len(size)), len(size) / holds)


def displacement_direction(projection: Projection, blocks: Blocks, noise: NoiseModel) -> PadDirection:
    """PadDirection in which the shaft moves as the load grows, relative to the pad.

    Both components carry the same noise, correlated and drifting as `noise` says.
    """
    vectors = np.column_stack([projection.deflection, projection.across])
    size = np.hypot(projection.load, projection.across_load)
    return _growth(vectors, size, noise.covariance(blocks.time, blocks.duration), 1.0)


def _growth(vectors: FloatArray, size: FloatArray, covariance: FloatArray, dependence: float) -> PadDirection:
    """PadDirection of the slope of vectors (m, 2) over a load size (m,), by generalised least squares."""
    design = np.column_stack([np.ones_like(size), (size - size.mean()) / max(float(np.ptp(size)), 1e-300)])
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    x, y = whitener @ design, whitener @ vectors
    inverse = np.linalg.pinv(x.T @ x)
    along, across = (inverse @ (x.T @ y))[1]
    length = math.hypot(along, across)
    if length == 0.0:
        return PadDirection(0.0, math.inf)
    # the slope is an average over a curved path; what counts is the scatter across the direction itself
    normal = np.array([-across, along]) / length
    off = y @ normal
    misfit = float(np.sum((off - x @ (inverse @ (x.T @ off))) ** 2)) / max(len(size) - 2, 1)
    spread = math.sqrt(inverse[1, 1] * misfit * dependence)
    return PadDirection(math.atan2(across, along), spread / length)
