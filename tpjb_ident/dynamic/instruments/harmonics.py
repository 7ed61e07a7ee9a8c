"""How far from linear the film was shaken: what it makes of the excitation at twice its frequency.

A film that hardens bends a sine; the second harmonic of its force grows with the amplitude and what the fundamental
is off by with its square. For a force law x / (1 - x/c)^n the two are tied by the film's own curvature::

    change of h / h = 3/4 a3 (A/c)^2,   q2 = second harmonic / fundamental = a2 / 2 (A/c),   a3 = 0.9 a2^2

so that the change is about 2.7 q2^2. The second harmonic of the actuators is no part of it: what H explains of the
harmonic force by the harmonic displacement is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.records.line_means import LineMean

#: Change of h per squared second harmonic.
CHANGE = 2.7
#: Changes below this share are not worth telling [share of h].
NOTHING = 2e-4
#: From here on no interval can be answered for.
REFUSED = 0.05
#: A change is known to be no larger than the figure above; as a standard deviation it is this part of it.
AS_DEVIATION = 1 / 1.6


def film_change(harmonics: Sequence[tuple[LineMean, LineMean]], est: DynamicStiffness) -> float:
    """Share by which h is off through the amplitude of the excitation, by the records' second harmonics.

    Parameters
    ----------
    harmonics : sequence of (LineMean, LineMean)
        Of every run: the excitation and its second harmonic.
    est : DynamicStiffness
        Its K and C stand for twice the frequency too; the harmonic displacement is small.

    Returns
    -------
    float
        Zero where nothing tells.
    """
    if not np.isfinite(est.h).all():
        return 0.0
    doubled = est.h.real + 2j * est.h.imag
    shares = []
    for first, second in harmonics:
        size = float(np.linalg.norm(first.force))
        if not size > 0:
            continue
        bent = float(np.linalg.norm(second.force - doubled @ second.displacement))
        noise = float(np.hypot(second.force_error, np.abs(doubled).max() * second.displacement_error))
        shares.append(max(bent**2 - (2 * noise) ** 2, 0.0) / size**2)
    change = CHANGE * float(np.median(shares)) if shares else 0.0
    return change if change > NOTHING else 0.0


def change_spread(change: float, est: DynamicStiffness) -> FloatArray:
    """Covariance (8, 8) of H when its entries may be off by a common share."""
    shift = AS_DEVIATION * change * np.abs(est.vector)
    return np.diag(shift**2)


def change_conditions(change: float) -> tuple[Condition, ...]:
    """What to say of a point."""
    if change <= REFUSED:
        return ()
    return (
        Condition(
            "film-not-linear",
            f"the film answers at twice the excitation frequency with {100 * np.sqrt(change / CHANGE):.0f} % of the "
            f"force: the coefficients may be off by {100 * change:.0f} %. Excite less",
        ),
    )
