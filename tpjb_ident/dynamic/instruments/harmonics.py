"""How far from linear the film was shaken: what it makes of the excitation at twice its frequency.

A film that hardens bends a sine; the second harmonic of its force grows with the amplitude and what the fundamental
is off by with its square. For a force law x / (1 - x/c)^n the two are tied by the film's own curvature::

    change of h / h = 3/4 a3 (A/c)^2,   q2 = second harmonic / fundamental = a2 / 2 (A/c),   a3 = 0.9 a2^2

so that the change is about 2.7 q2^2; 4.5 is taken, because a film is no spring along one line. The second harmonic of
the actuators is no part of it: what H explains of the harmonic force by the harmonic displacement is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.records.line_means import LineMean

#: Change of h per squared second harmonic.
CHANGE = 4.5
#: From so many runs on the harmonic is held against the squares of the motion,
MIN_RUNS = 5
#: and what goes with them must be this many times what does not, per degree of freedom.
DISTINCT = 6.0
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
    kept = [(a, b) for a, b in harmonics if np.isfinite(b.force).all() and np.linalg.norm(a.force) > 0]
    if len(kept) >= MIN_RUNS:
        change = CHANGE * _quadratic_share(kept, doubled)
    else:
        shares = [_share(first, second, doubled) for first, second in kept if not second.shared]
        change = CHANGE * float(np.median(shares)) if shares else 0.0
    return change if change > NOTHING else 0.0


def _share(first: LineMean, second: LineMean, doubled: ComplexArray) -> float:
    """Squared second harmonic over squared fundamental of one run, less its noise."""
    bent = float(np.linalg.norm(second.force - doubled @ second.displacement))
    noise = float(np.hypot(second.force_error, np.abs(doubled).max() * second.displacement_error))
    return max(bent**2 - (2 * noise) ** 2, 0.0) / float(np.linalg.norm(first.force)) ** 2


def _quadratic_share(kept: Sequence[tuple[LineMean, LineMean]], doubled: ComplexArray) -> float:
    """The same of all runs together: only what goes with the squares of the motion, size and phase, is the film's.

    Mains on the line, and noise, have any phase; they stay in the residual.
    """
    size = np.array([np.linalg.norm(first.force) for first, _ in kept])[:, None]
    d = np.array([first.displacement for first, _ in kept])
    bent = np.array([second.force - doubled @ second.displacement for _, second in kept]) / size
    squares = np.stack([d[:, 0] ** 2, d[:, 0] * d[:, 1], d[:, 1] ** 2], axis=1) / size
    fitted = squares @ np.linalg.lstsq(squares, bent, rcond=None)[0]
    explained = float(np.sum(np.abs(fitted) ** 2)) / 3
    left = float(np.sum(np.abs(bent - fitted) ** 2)) / (len(kept) - 3)
    if explained < DISTINCT * left:
        return 0.0
    return 3 * (explained - left) / len(kept)


def change_spread(change: float, est: DynamicStiffness) -> FloatArray:
    """Covariance (8, 8) of H when its entries may be off by a common share.

    Parameters
    ----------
    change : float
        Share of H by which its entries may be off.
    est : DynamicStiffness
    """
    shift = AS_DEVIATION * change * np.abs(est.vector)
    return np.diag(shift**2)


def change_conditions(change: float) -> tuple[Condition, ...]:
    """What to say of a point.

    Parameters
    ----------
    change : float
        Share of H by which its entries may be off.
    """
    if change <= REFUSED:
        return ()
    return (
        Condition(
            "film-not-linear",
            f"the film answers at twice the excitation frequency with {100 * np.sqrt(change / CHANGE):.0f} % of the "
            f"force: the coefficients may be off by {100 * change:.0f} %. Excite less",
        ),
    )
