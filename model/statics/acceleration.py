"""Anderson acceleration of a fixed-point iteration: the last few steps say where the iteration is heading."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray


@dataclass
class Anderson:
    """Anderson mixing, type II."""

    depth: int = 4
    _images: list[FloatArray] = field(default_factory=list)
    _residuals: list[FloatArray] = field(default_factory=list)

    def reset(self) -> None:
        """Forget the past (after a change of regime)."""
        self._images.clear()
        self._residuals.clear()

    def next(self, state: FloatArray, image: FloatArray) -> FloatArray:
        """Return the next state: `state, image` (n,); gives (n,)."""
        residual = image - state
        self._images.append(image)
        self._residuals.append(residual)
        if len(self._images) > self.depth + 1:
            self._images.pop(0)
            self._residuals.pop(0)
        if len(self._images) == 1:
            return image
        changes = np.column_stack([residual - r for r in self._residuals[:-1]])
        gram = changes.T @ changes
        gram[np.diag_indices_from(gram)] *= 1.0 + 1e-10
        if not gram.trace() > 0.0:
            return image
        mix = np.linalg.lstsq(gram, changes.T @ residual, rcond=1e-12)[0]
        return image - sum(m * (image - g) for m, g in zip(mix, self._images[:-1], strict=True))
