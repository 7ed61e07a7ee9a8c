"""Scale: what a coefficient is measured against, and operating points as coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.observations.observe import Element


def direct_scale(elements: Sequence[Element], value: FloatArray) -> FloatArray:
    """Mean direct coefficient of every element's point and part (k or omega c); 1 outside ``h``, (n,).

    Parameters
    ----------
    elements : sequence of Element
        What each of the n numbers is.
    value : array, shape (n,)
        Measured or predicted.
    """
    sums: dict[tuple[object, ...], list[float]] = {}
    for e, v in zip(elements, value, strict=True):
        if e.family == "h" and e.observable[1] == e.observable[2]:
            sums.setdefault((e.observable[0], e.where), []).append(abs(float(v)))
    rows = [sums.get((e.observable[0], e.where), [1.0]) if e.family == "h" else [1.0] for e in elements]
    return np.array([float(np.mean(row)) for row in rows])


def coordinate(elements: Sequence[Element], name: str) -> FloatArray:
    """A coordinate of every element, spread over -1 .. 1; 0 where it has none or all are alike, (n,).

    Parameters
    ----------
    elements : sequence of Element
        What each of the n numbers is.
    name : str
        Coordinate of the operating point.
    """
    values = np.array([e.place(name) for e in elements])
    known = values[np.isfinite(values)]
    if len(known) == 0 or np.ptp(known) <= 1e-12 * max(abs(known).max(), 1e-300):
        return np.zeros(len(values))
    middle, half = 0.5 * (known.max() + known.min()), 0.5 * np.ptp(known)
    return np.where(np.isfinite(values), (values - middle) / half, 0.0)
