"""The scatter of the force from run to run in the equations of the blocks: its four components, each of its own size.

A bearing that is stiffer in one run than in another shows a force in phase with the motion and along the spring force,
one with more damping a force a quarter of a turn ahead along the damping force. A load that is turned shows across
them, in proportion to the motion, however soft the bearing is along it. As one scatter, what is right on average would
be too little for stiffness and too much for damping.

The covariance N of a block is circular: it holds the mean of the four. What they differ from it by is real, and is made
up for in the block's real rows: with the patterns p of the components, their covariance is I + sum (s^2 - mean) p p^T,
and its inverse root brings them back to unit variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray

#: In phase with the motion along the spring force and across it, ahead of it along the damping force and across it.
COMPONENTS = 4
#: Which components move stiffness and mass of a point, and which its damping.
PHASES = slice(0, 2), slice(2, 4)
#: Which act across the spring force, or the damping force.
ACROSS = slice(1, 4, 2)
#: A scatter across the force is at most so many times its size: where stiffness and mass cancel there is none along.
_LARGEST = 10.0
#: A component has at least this share of the mean scatter: keeps rows of computed records solvable.
_LEAST = 0.02


@dataclass(frozen=True)
class AlongForce:
    """What the force equations of blocks say of every component."""

    chi_square: FloatArray  #: (n, 4)
    information: FloatArray  #: (n, 4): what a scatter of variance one adds to it
    J_h: FloatArray  #: (n, 4, numbers): their rows


@dataclass(frozen=True)
class ForceScatter:
    """Directions of the components in the real rows of blocks, n of them with k rows."""

    basis: FloatArray  #: (n, k, 4): orthonormal
    patterns: FloatArray  #: (n, 4, 4): of the components, of relative size one, in the basis
    root: FloatArray  #: (n, 4, 4): inverse root of the rows' covariance in the basis
    size: FloatArray  #: (n, 4): of a scatter of one, over the film's force

    @staticmethod
    def of(patterns: ComplexArray, motion: ComplexArray, h: ComplexArray, variance: FloatArray) -> ForceScatter:
        """Components of complex patterns (n, k / 2, 2) of the size of the film's force along X and Y.

        `motion` (n, 2) [m], `h` (n, 2, 2) [N/m], `variance` (n, 4).
        """
        force = np.einsum("nij,nj->ni", h, motion)
        usual = np.linalg.norm(h, axis=(1, 2)) * np.linalg.norm(motion, axis=1) / np.sqrt(2)
        size = np.ones((len(force), COMPONENTS))
        ratio = usual / np.maximum(np.linalg.norm(force, axis=1), 1e-300)
        size[:, ACROSS] = np.minimum(ratio, _LARGEST)[:, None]
        phase = np.exp(0.5j * np.angle(np.sum(motion**2, axis=1)))[:, None]
        spring, damper = (_directions(part) for part in ((force / phase).real, (force / phase).imag))
        columns = patterns @ np.concatenate([spring, 1j * damper], axis=2) * phase[:, None]
        basis, triangle = np.linalg.qr(np.concatenate([columns.real, columns.imag], axis=1))
        mean = variance.mean(axis=1, keepdims=True)
        excess = np.maximum(variance * size**2, _LEAST * mean) - mean
        covariance = np.eye(COMPONENTS) + (triangle * excess[:, None, :]) @ triangle.transpose(0, 2, 1)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        return ForceScatter(basis, np.asarray(triangle, dtype=float), root, size)

    def white(self, rows: FloatArray) -> FloatArray:
        """Rows (n, k, ..) brought to unit variance."""
        move = (self.root - np.eye(COMPONENTS)) @ (self.basis.transpose(0, 2, 1) @ rows)
        return rows + self.basis @ move

    def along(self, r: FloatArray, J_h: FloatArray) -> AlongForce:
        """What white rows r (n, k) and their columns J_h (n, k, numbers) have along the components."""
        white = self.root @ self.patterns
        length = np.maximum(np.linalg.norm(white, axis=1), 1e-300)
        rows = (white / length[:, None]).transpose(0, 2, 1) @ self.basis.transpose(0, 2, 1)
        return AlongForce((rows @ r[:, :, None])[:, :, 0] ** 2, (self.size * length) ** 2, rows @ J_h)


def _directions(vectors: FloatArray) -> FloatArray:
    """Unit vectors along and across vectors (n, 2) as columns, (n, 2, 2)."""
    size = np.linalg.norm(vectors, axis=1)
    unit = np.where(size[:, None] > 0, vectors / np.maximum(size, 1e-300)[:, None], [1.0, 0.0])
    return np.stack([unit, np.stack([-unit[:, 1], unit[:, 0]], axis=1)], axis=2)
