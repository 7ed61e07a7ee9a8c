"""How far from linear the film was shaken: what runs of several amplitudes show, and lines at 3f and 2X - f in one.

A film that hardens with the square of the motion answers a motion of amplitude a at f, beside a shaft's own of b at 1X,
with 3/4 kappa (a^2 + 2 b^2) more at f, and with lines at 3f and 2X - f of 1/4 kappa a^2 and 3/4 kappa b^2::

    change of h / h = 3 q3 + 2 qx,      q = |F - h(its frequency) D| / |F(f)|

What H explains of a line's force by its displacement is taken off: actuators have harmonics of their own. Held against
films integrated in time it is right within a fifth, so 1.3 times it is taken. Where 3f cannot be seen (a slow channel,
another line on it) the second harmonic stands in, 4.5 q2^2: for a force law x / (1 - x / c)^n the change is 2.7 q2^2.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition, Conditions, holding
from tpjb_ident.estimate.term import ALLOWED_CHANGE, CHANGE_BY_ORBIT, worth_stating
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.phasors.run_data import FilmLines
from tpjb_ident.runs.point_data import PointData

#: Runs of one direction must differ in amplitude by this factor to tell anything.
MIN_RATIO = 1.3
#: A slope is pointed out beyond this probability and this size (relative change per doubling).
SIGNIFICANCE = 0.01
NOTABLE = 0.01

#: Change of h per share of the force at 3f and at 2X - f, and per squared share at 2f.
_WEIGHTS = {"3f": 3.0, "2X-f": CHANGE_BY_ORBIT}
_SECOND = 4.5
#: From here on no interval can be answered for, as the records show it; by what films usually do.
_REFUSED, _REFUSED_UNSHOWN = 0.05, 0.15
#: Share of the clearance from which a motion may be too large for a linear film, if the harmonics do not tell,
MAX_AMPLITUDE = 0.05
#: and from which none is linear: where it looks so, the motion is not what the probes say.
NEVER_LINEAR = 0.3


@dataclass(frozen=True)
class AmplitudeSlope:
    """Relative change of the dynamic stiffness when the amplitude doubles."""

    stiffening: float = np.nan
    standard_error: float = np.nan
    runs: int = 0

    def condition(self) -> Conditions:
        """What to say about it in the point's quality, where it is more than noise."""
        limit = -float(stdtrit(max(self.runs - 2, 1), SIGNIFICANCE / 2)) * self.standard_error
        change, error = 100 * self.stiffening, 100 * self.standard_error
        text = f"h changes by {change:+.1f} % when the amplitude doubles (standard error {error:.1f} %)"
        return holding((abs(self.stiffening) > max(limit, NOTABLE), "nonlinear-amplitude", text))


def amplitude_slope(data: PointData, h: ComplexArray, weights: FloatArray) -> AmplitudeSlope:
    """Slope of h over the logarithm of the amplitude, from directions run at several amplitudes; NaN without such."""
    groups = defaultdict(list)
    for run, places in data.counted(weights) if np.isfinite(h).all() else ():
        if run.direction is not None:
            D, F = (np.average(z[places], axis=0, weights=weights[places]) for z in (data.D, data.F))
            fitted = h @ D
            excess = float((fitted.conj() @ (F - fitted)).real / np.linalg.norm(fitted) ** 2)
            angle = round(np.degrees(run.direction) % 180.0, 1)
            groups[angle].append((np.log2(np.linalg.norm(D)), excess))
    # Differences within a direction only: what a direction as a whole is off by is no amplitude effect.
    centred, runs = [], 0
    for group in groups.values():
        rows = np.array(group) - np.mean(group, axis=0)
        if np.ptp(rows[:, 0]) > np.log2(MIN_RATIO):
            centred.append(rows)
            runs += len(rows)
    if runs - len(centred) < 2:
        return AmplitudeSlope()
    x, y = np.concatenate(centred).T
    slope = float(x @ y / (x @ x))
    spare = max(runs - len(centred) - 1, 1)
    error = float(np.sqrt(np.sum((y - slope * x) ** 2) / spare / (x @ x)))
    return AmplitudeSlope(slope, error, runs)


@dataclass(frozen=True)
class FilmChange:
    """What the film's lines say of a point."""

    share: float = 0.0  #: of h, by which the amplitude of the motion may change it
    hidden: float = np.inf  #: what could stay unseen of it
    is_shown: bool = True  #: by the records; else it is a width that films of that motion have, as after a blow


def film_change(runs: Sequence[FilmLines | None], h: ComplexArray) -> FilmChange:
    """Share by which h (2, 2) [N/m] may be off through the amplitude of the motion, by its runs' lines."""
    usable = [run for run in runs if run is not None] if np.isfinite(h).all() else []
    sizes = {name: _size(usable, name, h) for name in ("2f", *_WEIGHTS)}
    rows = [weight * sizes[name] for name, weight in _WEIGHTS.items()]
    parts = np.array(rows if np.isfinite(sizes["3f"]).all() else [_SECOND * sizes["2f"] ** 2])
    parts = parts[np.isfinite(parts).all(axis=1)]
    if not len(parts):
        return FilmChange()
    share, hidden = (ALLOWED_CHANGE * parts.sum(axis=0)).tolist()
    return FilmChange(worth_stating(share), hidden)


def _size(runs: Sequence[FilmLines], name: str, h: ComplexArray) -> FloatArray:
    """Force at a line beyond what h makes of its motion, over that at the excitation; and what noise could hide, (2,).

    NaN where fewer than half of the runs show the line.
    """
    squares, noises = [], []
    for run in runs:
        line = run.get(name)
        if line is None or not np.isfinite(line.force).all():
            continue
        stiffness = h.real + 1j * line.ratio * h.imag
        noise = line.force_noise + np.linalg.norm(stiffness, 2) ** 2 * line.displacement_noise
        excess = np.sum(np.abs(line.force - stiffness @ line.displacement) ** 2)
        squares.append(excess - noise)
        noises.append(noise)
    if 2 * len(squares) < len(runs) or not squares:
        return np.full(2, np.nan)
    return np.sqrt([max(float(np.median(squares)), 0.0), np.median(noises) / len(squares)])


def change_conditions(
    change: FilmChange,
    budget: Mapping[str, FloatArray],
    est: DynamicStiffness,
    amplitude: float,
    clearance: float | None,
) -> Conditions:
    """What to say of a point, by what its `budget` leaves of the change.

    A large motion alone is no fault where the harmonics show that the film answers it as a linear one.
    """
    uncertain = change.share
    if "amplitude" in budget:  # runs of several amplitudes may have told it
        size = np.linalg.norm(est.h) / np.sqrt(2)
        uncertain = min((1.96 * np.sqrt(np.diag(budget["amplitude"]).max()) / size), uncertain)
    text = "by what the film makes of the motion at multiples of its frequency"
    if not change.is_shown:
        text = "blows in one sense, of which nothing tells how a film answers them, go so far that"
    text += f" the coefficients may be off by {100 * uncertain:.0f} %"
    if uncertain > (_REFUSED if change.is_shown else _REFUSED_UNSHOWN):
        return (Condition("film-not-linear", f"{text}. Excite less"),)
    if uncertain > _REFUSED:
        return (Condition("large-amplitude", f"{text}: so wide are the intervals. Strike in both senses"),)
    if not clearance or not np.isfinite(est.h).all() or not amplitude > MAX_AMPLITUDE * clearance:
        return ()
    share = 100 * amplitude / clearance
    if amplitude > NEVER_LINEAR * clearance and not change.share:
        text = f"amplitude {share:.0f} % of the clearance without a harmonic of the film: check probes and clearance"
        return (Condition("large-amplitude", text),)
    room = np.min(np.abs(est.half_width()[[0, 3]] / np.diag(est.h).real))
    if change.hidden < room or uncertain < change.share:  # what stays unseen is less than the interval
        return ()
    text = f"amplitude {share:.1f} % of the clearance > 5 %, and no harmonic tells what it does"
    return (Condition("large-amplitude", text),)
