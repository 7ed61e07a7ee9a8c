"""How far from linear the film was shaken: what it makes of the motion at 3f and at 2X - f.

A film that hardens with the square of the motion answers a motion of amplitude a at f, beside a shaft's own of b at 1X,
with 3/4 kappa (a^2 + 2 b^2) more at f, and with lines at 3f and 2X - f of 1/4 kappa a^2 and 3/4 kappa b^2::

    change of h / h = 3 q3 + 2 qx,      q = |F - h(its frequency) D| / |F(f)|

What H explains of a line's force by its displacement is taken off: actuators have harmonics of their own. Held against
films integrated in time it is right within a fifth, so 1.3 times it is taken. Where 3f cannot be seen (a slow channel,
another line on it) the second harmonic stands in, 4.5 q2^2: for a force law x / (1 - x / c)^n the change is 2.7 q2^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.phasors.line_means import FilmLines

#: Change of h per share of the force at 3f and at 2X - f, and per squared share at 2f.
_WEIGHTS = {"3f": 3.0, "2X-f": 2.0}
_SECOND = 4.5
#: Of the change that the lines show, so much is allowed for.
_ALLOWED = 1.3
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
    """What the film's lines say of a point."""

    share: float = 0.0  #: of h, by which the amplitude of the motion may change it
    hidden: float = np.inf  #: what could stay unseen of it


def film_change(runs: Sequence[FilmLines], h: ComplexArray) -> FilmChange:
    """Share by which h (2, 2) [N/m] may be off through the amplitude of the motion, by its runs' lines."""
    usable = [run for run in runs if run.force > 0]
    if not np.isfinite(h).all() or not usable:
        return FilmChange()
    change = hidden = 0.0
    third = _size(usable, "3f", h)
    if third is None:
        second = _size(usable, "2f", h)
        if second is None:
            return FilmChange()
        change, hidden = _SECOND * second[0] ** 2, _SECOND * second[1] ** 2
    for name, weight in _WEIGHTS.items() if third is not None else ():
        size = _size(usable, name, h)
        if size is not None:
            change, hidden = change + weight * size[0], hidden + weight * size[1]
    share = _ALLOWED * change
    return FilmChange(share if share > _NOTHING else 0.0, _ALLOWED * hidden)


def _size(runs: Sequence[FilmLines], name: str, h: ComplexArray) -> tuple[float, float] | None:
    """Force at a line beyond what h makes of its motion, over that at the excitation; and what noise could hide."""
    squares, noises = [], []
    for run in runs:
        line = run.lines.get(name)
        if line is None or not np.isfinite(line.force).all():
            continue
        stiffness = h.real + 1j * line.ratio * h.imag
        noise = line.force_noise + float(np.linalg.norm(stiffness, 2)) ** 2 * line.displacement_noise
        excess = float(np.sum(np.abs(line.force - stiffness @ line.displacement) ** 2))
        squares.append((excess - noise) / run.force**2)
        noises.append(noise / run.force**2)
    if 2 * len(squares) < len(runs) or not squares:
        return None
    size = float(np.sqrt(max(float(np.median(squares)), 0.0)))
    return size, float(np.sqrt(np.median(noises) / len(squares)))


def change_conditions(
    change: FilmChange, uncertain: float, est: DynamicStiffness, amplitude: float, clearance: float | None
) -> tuple[Condition, ...]:
    """What to say of a point.

    A large motion alone is no fault where the harmonics show that the film answers it as a linear one.
    """
    if uncertain > _REFUSED:
        text = "by what the film makes of the motion at multiples of its frequency, the coefficients may be off by"
        return (Condition("film-not-linear", f"{text} {100 * uncertain:.0f} %. Excite less"),)
    if not clearance or not np.isfinite(est.h).all() or not amplitude > MAX_AMPLITUDE * clearance:
        return ()
    share = 100 * amplitude / clearance
    if amplitude > NEVER_LINEAR * clearance and not change.share:
        text = f"amplitude {share:.0f} % of the clearance without a harmonic of the film: check probes and clearance"
        return (Condition("large-amplitude", text),)
    room = float(np.min(np.abs(est.half_width()[[0, 3]] / np.diag(est.h).real)))
    if change.hidden < room or uncertain < change.share:  # what stays unseen is less than the interval
        return ()
    text = f"amplitude {share:.1f} % of the clearance > 5 %, and no harmonic tells what it does"
    return (Condition("large-amplitude", text),)
