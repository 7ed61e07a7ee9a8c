"""Gap: the root mean square of (measured - predicted) / sigma, over everything and by observable."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnose.observations.observe import Element, Observations


def residuals(observations: Observations, prediction: FloatArray) -> FloatArray:
    """(measured - predicted) / sigma, positions and clearances seen from one common centre.

    The centre from which positions are counted is a convention (the clearance polygon's, by some rule) and says
    nothing about the bearing: the shift that fits best is taken off.

    Parameters
    ----------
    observations : Observations
        What was measured, with its covariance.
    prediction : array, shape (n,)
        In the units of the observations.
    """
    z = (observations.value - prediction) / observations.total_sigma
    shifts = centre_shifts(observations.elements) / observations.total_sigma[:, None]
    if not np.any(shifts):
        return z
    return np.asarray(z - shifts @ np.linalg.lstsq(shifts, z, rcond=None)[0])


def centre_shifts(elements: Sequence[Element]) -> FloatArray:
    """Positions and clearances seen from a centre moved by one metre along x and along y, (n, 2).

    Parameters
    ----------
    elements : sequence of Element
        What each of the n numbers is.
    """
    out = np.zeros((len(elements), 2))
    for i, e in enumerate(elements):
        if e.observable in {"locus_x", "locus_y"}:
            out[i, "xy".index(e.observable[-1])] = -1.0
        elif e.observable == "clearance_pushed":
            angle = e.place("angle")
            out[i] = -math.cos(angle), -math.sin(angle)
    return out


def gap(observations: Observations, prediction: FloatArray, chosen: BoolArray | None = None) -> float:
    """Root mean square of `residuals`; NaN where nothing is chosen.

    Parameters
    ----------
    observations : Observations
        What was measured, with its covariance.
    prediction : array, shape (n,)
        In the units of the observations.
    chosen : array of bool, shape (n,), optional
        Elements that count; all by default.
    """
    z = residuals(observations, prediction)
    z = z if chosen is None else z[chosen]
    return float(np.sqrt(np.mean(z**2))) if len(z) else float("nan")


def noise_floor(observations: Observations, chosen: BoolArray | None = None) -> float:
    """Gap that measurement noise alone would leave under a perfect model.

    Parameters
    ----------
    observations : Observations
        What was measured, with its covariance.
    chosen : array of bool, shape (n,), optional
        Elements that count; all by default.
    """
    share = np.diag(observations.covariance) / observations.total_sigma**2
    share = share if chosen is None else share[chosen]
    return float(np.sqrt(np.mean(share)))


def gap_by_observable(
    observations: Observations, before: FloatArray, after: FloatArray, chosen: BoolArray
) -> dict[str, dict[str, float]]:
    """Held-out gap before and after, per observable; observables without held-out points use all of theirs.

    Parameters
    ----------
    observations : Observations
        What was measured, with its covariance.
    before : array, shape (n,)
        Prediction of the baseline.
    after : array, shape (n,)
        Prediction with what was found.
    chosen : array of bool, shape (n,)
        Elements held out.
    """
    out: dict[str, dict[str, float]] = {}
    names = np.array([e.observable for e in observations.elements])
    for name in dict.fromkeys(names):
        mine = names == name
        part = mine & chosen
        key = "heldout" if part.any() else "fitted"
        part = part if part.any() else mine
        out[str(name)] = {
            f"{key}_before": gap(observations, before, part),
            f"{key}_after": gap(observations, after, part),
        }
    return out
