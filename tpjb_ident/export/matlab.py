"""MATLAB: one struct array."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.export.points import StaticPoint
from tpjb_ident.runtime.tables import printable, write_atomic
from tpjb_ident.schema import ENTRIES

FIELDS = (
    "load_N", "direction_deg", "speed_Hz", "frequency_rad_per_s", "K", "C", "K_lo", "K_hi", "C_lo", "C_hi",
    "quality", "trusted",
)  # fmt: skip


def write_mat(folder: Path, points: tuple[StaticPoint, ...], source: str) -> None:
    """Write bearing_coefficients.mat (MATLAB 5): struct array ``bearing``.

    K and C are 2 x 2 x n, so are ``K_lo``, ``K_hi``, ``C_lo``, ``C_hi``, the ends of their 95 % intervals (NaN where
    there are none); ``quality`` is a cell array of n texts, ``trusted`` n truth values.

    Parameters
    ----------
    folder : Path
    points : tuple of StaticPoint
    source : str
        Where the coefficients come from.
    """
    from scipy.io import savemat

    array = np.zeros(len(points), dtype=[(name, object) for name in FIELDS])
    for i, p in enumerate(points):
        array[i] = (
            p.load, p.direction, p.speed, p.frequency,
            _matrices(p.coefficients, "k"), _matrices(p.coefficients, "c"),
            _matrices(p.low, "k"), _matrices(p.high, "k"), _matrices(p.low, "c"), _matrices(p.high, "c"),
            np.array([printable(text) for text in p.quality], dtype=object), p.trusted,
        )  # fmt: skip
    path = folder / "bearing_coefficients.mat"
    content = {"bearing": array, "source": printable(source)}
    write_atomic(path, lambda part: savemat(part, content, oned_as="column", appendmat=False))


def _matrices(values: dict[str, FloatArray], kind: str) -> FloatArray:
    return np.array([values[f"{kind}{entry}"] for entry in ENTRIES]).reshape(2, 2, -1)
