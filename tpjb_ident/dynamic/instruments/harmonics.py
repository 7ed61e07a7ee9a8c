"""How far from linear the film was shaken: what it makes of the excitation at twice its frequency.

A film that hardens bends a sine; the second harmonic of its force grows with the amplitude and what the fundamental
is off by with its square. For a force law x / (1 - x/c)^n the two are tied by the film's own curvature::

    change of h / h = 3/4 a3 (A/c)^2,   q2 = second harmonic / fundamental = a2 / 2 (A/c),   a3 = 0.9 a2^2

so that the change is about 2.7 q2^2; 4.5 is taken, because a film is no spring along one line. The second harmonic of
the actuators is no part of it: what H explains of the harmonic force by the harmonic displacement is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.phasors.line_means import LineMean

#: Change of h per squared second harmonic.
_CHANGE = 4.5
#: From so many runs on the harmonic is held against the squares of the motion,
_MIN_RUNS = 5
#: and what goes with them is beyond doubt where it is this many times what does not, per degree of freedom.
_DISTINCT = 6.0
#: A linear film's harmonics count as a little bent in one of so many points.
_CHANCE = 0.2
#: Changes below this share are not worth telling [share of h].
_NOTHING = 2e-4
#: From here on no interval can be answered for.
_REFUSED = 0.05
#: Share of the clearance from which a motion may be too large for a linear film, if the harmonics do not tell,
MAX_AMPLITUDE = 0.05
#: and from which none is linear: where it looks so, the motion is not what the probes say.
NEVER_LINEAR = 0.3


@dataclass(frozen=True)
class FilmChange:
    """What the second harmonics say of a point."""

    share: float = 0.0
    hidden: float = np.inf


def film_change(harmonics: Sequence[tuple[LineMean, LineMean]], h: ComplexArray) -> FilmChange:
    """Share by which h (2, 2) [N/m] is off through the amplitude of the excitation, by the second harmonics."""
    if not np.isfinite(h).all():
        return FilmChange()
    doubled = h.real + 2j * h.imag
    usable = [(a, b) for a, b in harmonics if np.isfinite(b.force).all() and np.linalg.norm(a.force) > 0]
    alone = [pair for pair in usable if not pair[1].shared]
    if len(usable) >= _MIN_RUNS:
        share, unseen = _quadratic_share(usable, doubled)
        change, hidden = _CHANGE * share, _CHANGE * unseen
    else:
        shares = [_share(first, second, doubled) for first, second in alone]
        change = _CHANGE * float(np.median(shares)) if shares else 0.0
        noise = [_noise(second, doubled) / float(np.linalg.norm(first.force)) for first, second in alone]
        hidden = _CHANGE * (2 * float(np.median(noise))) ** 2 if noise else np.inf
    return FilmChange(change if change > _NOTHING else 0.0, hidden)


def _noise(second: LineMean, doubled: ComplexArray) -> float:
    """Standard error of a component of the harmonic force that H does not explain [N]."""
    return float(np.hypot(second.force_error, np.abs(doubled).max() * second.displacement_error))


def _share(first: LineMean, second: LineMean, doubled: ComplexArray) -> float:
    """Squared second harmonic over squared fundamental of one run, less its noise."""
    bent = float(np.linalg.norm(second.force - doubled @ second.displacement))
    return max(bent**2 - (2 * _noise(second, doubled)) ** 2, 0.0) / float(np.linalg.norm(first.force)) ** 2


def _quadratic_share(usable: Sequence[tuple[LineMean, LineMean]], doubled: ComplexArray) -> tuple[float, float]:
    """The same of all runs together, and how much of it could stay unseen.

    Only what goes with the squares of the motion, size and phase, is the film's. Mains on the line, and noise, have
    any phase; they stay in the residual.
    """
    size = np.array([np.linalg.norm(first.force) for first, _ in usable])[:, None]
    d = np.array([first.displacement for first, _ in usable])
    bent = np.array([second.force - doubled @ second.displacement for _, second in usable]) / size
    squares = np.stack([d[:, 0] ** 2, d[:, 0] * d[:, 1], d[:, 1] ** 2], axis=1) / size
    fitted = squares @ np.linalg.lstsq(squares, bent, rcond=None)[0]
    explained = float(np.sum(np.abs(fitted) ** 2)) / 3
    remaining = float(np.sum(np.abs(bent - fitted) ** 2)) / (len(usable) - 3)
    unseen = 3 * (_DISTINCT - 1) * remaining / len(usable)
    # what noise and mains leave by chance is taken off; what is more counts, also where it is not beyond doubt
    chance = remaining * float(fdtri(6, 2 * (len(usable) - 3), 1.0 - _CHANCE))
    return max(3 * (explained - chance) / len(usable), 0.0), unseen


def change_conditions(
    change: FilmChange, uncertain: float, est: DynamicStiffness, amplitude: float, clearance: float | None
) -> tuple[Condition, ...]:
    """What to say of a point.

    A large motion alone is no fault where the harmonics show that the film answers it as a linear one.
    """
    if uncertain > _REFUSED:
        text = (
            f"the film answers at twice the excitation frequency with {100 * np.sqrt(change.share / _CHANGE):.0f} % of"
        )
        return (
            Condition(
                "film-not-linear",
                f"{text} the force: the coefficients may be off by {100 * uncertain:.0f} %. Excite less",
            ),
        )
    if not clearance or not np.isfinite(est.h).all() or not amplitude > MAX_AMPLITUDE * clearance:
        return ()
    share = 100 * amplitude / clearance
    if amplitude > NEVER_LINEAR * clearance and not change.share:
        text = f"amplitude {share:.0f} % of the clearance without a harmonic of the film: check probes and clearance"
        return (Condition("large-amplitude", text),)
    room = float(np.min(np.abs(est.half_width()[[0, 3]] / np.diag(est.h).real)))
    if change.hidden < room or uncertain < change.share:  # what stays unseen is less than the interval
        return ()
    text = f"amplitude {share:.1f} % of the clearance > 5 %, and the second harmonic does not tell what it does"
    return (Condition("large-amplitude", text),)
