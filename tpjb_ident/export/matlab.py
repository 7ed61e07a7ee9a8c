"""MATLAB: one struct array."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tpjb_ident.export.points import FloatArray, StaticPoint
from tpjb_ident.runtime.tables import printable, write_atomic
from tpjb_ident.schema import ENTRIES


def write_mat(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.mat (MATLAB 5): struct array ``bearing``, K and C as 2 x 2 x n."""
    from scipy.io import savemat

    fields = [(name, object) for name in ("load_N", "direction_deg", "speed_Hz", "frequency_rad_per_s", "K", "C")]
    array = np.zeros(len(points), dtype=fields)
    for i, p in enumerate(points):
        array[i] = (p.load, p.direction, p.speed, p.frequency, _matrices(p, "k"), _matrices(p, "c"))
    path = folder / "bearing_coefficients.mat"
    content = {"bearing": array, "source": printable(source)}
    write_atomic(path, lambda part: savemat(part, content, oned_as="column", appendmat=False))


def _matrices(point: StaticPoint, kind: str) -> FloatArray:
    stacked = np.array([point.coefficients[f"{kind}{entry}"] for entry in ENTRIES])
    return stacked.reshape(2, 2, -1)
