"""Whether the dynamic stiffness depends on how hard the bearing was shaken; K and C at zero amplitude where it does."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import stdtrit

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median

#: Runs of one direction must differ in amplitude by this factor to tell anything.
MIN_RATIO = 1.3
#: A slope is pointed out beyond this probability and this size (relative change per doubling).
SIGNIFICANCE = 0.01
NOTABLE = 0.01
#: G is expected to be below this many times what the second harmonic lets expect, one standard deviation:
#: loose, as the runs themselves tell better.
_LOOSE = 2.0
_ROUNDS = 5
#: Windows this many times farther from the middle of their run than half of them are left out.
_FAR = 4.0


@dataclass(frozen=True)
class ZeroAmplitude:
    """How H changes with the square of the motion at one point."""

    change: ComplexArray  #: (2, 2) complex, N/m: G: by which H is larger at the runs' mean square motion than at none
    square: FloatArray  #: (n_runs,): square of every run's motion over its mean
    left: FloatArray = field(repr=False)  #: (8, 8), (N/m)^2: covariance that the uncertainty of G leaves on H
    share: float

    def apply(self, data: PointData) -> PointData:
        """The point's windows with forces as for the smallest motions."""
        more = self.square[data.run_index][:, None] * (data.D @ self.change.T)
        return replace(data, F=data.F - more)

    def uncertain(self, h: ComplexArray) -> float:
        """Half the width of the 95 % interval of what is left of the change, as a share of H; `h` (2, 2) [N/m]."""
        return float(1.96 * np.sqrt(np.diag(self.left).max()) / (np.linalg.norm(h) / np.sqrt(2)))

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of it."""
        text = f"h at the runs' mean amplitude differs by {100 * self.share:.1f} % from that at none"
        return (Condition("zero amplitude", f"{text}; K and C are those at none, by the runs' several amplitudes"),)


@dataclass(frozen=True)
class AmplitudeSlope:
    """Relative change of the dynamic stiffness when the amplitude doubles."""

    stiffening: float
    standard_error: float
    runs: int

    @property
    def significant(self) -> bool:
        """Whether it is more than noise."""
        dof = max(self.runs - 2, 1)
        limit = -float(stdtrit(dof, SIGNIFICANCE / 2)) * self.standard_error
        return abs(self.stiffening) > max(limit, NOTABLE)

    def condition(self) -> tuple[Condition, ...]:
        """What to say about it in the point's quality."""
        if not self.significant:
            return ()
        return (
            Condition(
                "nonlinear-amplitude",
                f"h changes by {100 * self.stiffening:+.1f} % when the amplitude doubles "
                f"(standard error {100 * self.standard_error:.1f} %)",
            ),
        )


def amplitude_slope(data: PointData, h: ComplexArray, weights: FloatArray) -> AmplitudeSlope | None:
    """Slope of h over the logarithm of the amplitude, from directions run at several amplitudes."""
    groups: dict[float, list[tuple[float, float]]] = {}
    for i, run in enumerate(data.runs):
        selected = (data.run_index == i) & (weights > 0) & np.isfinite(data.D).all(axis=1)
        if run.direction is None or not selected.any() or not np.isfinite(h).all():
            continue
        D = np.average(data.D[selected], axis=0, weights=weights[selected])
        F = np.average(data.F[selected], axis=0, weights=weights[selected])
        fitted = h @ D
        excess = float((fitted.conj() @ (F - fitted)).real / np.linalg.norm(fitted) ** 2)
        angle = round(float(np.degrees(run.direction)) % 180.0, 1)
        groups.setdefault(angle, []).append((np.log2(float(np.linalg.norm(D))), excess))
    comparable = [np.array(g) for g in groups.values() if len(g) > 1]
    comparable = [g for g in comparable if np.ptp(g[:, 0]) > np.log2(MIN_RATIO)]
    runs = sum(len(g) for g in comparable)
    if runs - len(comparable) < 2:
        return None
    # Differences within a direction only: what a direction as a whole is off by is no amplitude effect.
    x = np.concatenate([g[:, 0] - g[:, 0].mean() for g in comparable])
    y = np.concatenate([g[:, 1] - g[:, 1].mean() for g in comparable])
    slope = float(x @ y / (x @ x))
    spare = max(runs - len(comparable) - 1, 1)
    error = float(np.sqrt(np.sum((y - slope * x) ** 2) / spare / (x @ x)))
    return AmplitudeSlope(slope, error, runs)


def zero_amplitude(data: PointData, h: ComplexArray, expected: float) -> ZeroAmplitude | None:
    """Find how H changes with amplitude; None where the runs have one amplitude, or the film is linear.

    To second order in the motion a film's force at the excitation is F = (H + G a^2) D, with a^2 = |D|^2 of the run
    over its mean and G a 2x2 complex matrix. Where directions were run at several amplitudes, H and G are found
    together by a regression of the runs' means; the windows' forces are then brought to zero amplitude, as static loads
    to their set point. The film's second harmonic says beforehand how large G can be: that keeps it small where the
    runs tell little.

    `h` (2, 2) [N/m].
    """
    weights = _beside_repeats(data)
    slope = amplitude_slope(data, h, weights)
    if slope is None or not np.isfinite(h).all() or not (expected > 0 or slope.significant):
        return None
    means = _run_means(data, weights)
    if means is None:
        return None
    D, F, noise = means
    square = np.einsum("ra,ra->r", D, D.conj()).real
    square = square / square.mean()
    size = float(np.linalg.norm(h)) / np.sqrt(2)
    prior = _LOOSE * max(expected, abs(slope.stiffening) if slope.significant else 0.0) * size
    fits = [_row(D, F[:, row], square, noise[:, row], prior) for row in range(2)]
    change = np.array([found[2:] for found, _ in fits])
    remaining = np.zeros((8, 8))
    for row, (_, covariance) in enumerate(fits):
        at = [2 * row, 2 * row + 1, 4 + 2 * row, 5 + 2 * row]
        remaining[np.ix_(at, at)] = covariance
    share = float(np.linalg.norm(change)) / np.sqrt(2) / size
    # the next term, with the fourth power of the motion, is of the order of the square of this one
    remaining += np.diag((share**2 * np.abs(np.concatenate([h.real.ravel(), h.imag.ravel()]))) ** 2)
    return ZeroAmplitude(change, square, remaining, share)


def _beside_repeats(data: PointData) -> FloatArray:
    """Windows (n,) that are like the others of their run: 1, else 0. Runs of other amplitude are no outliers here."""
    good = np.zeros(len(data.D))
    for i in range(len(data.runs)):
        places = np.flatnonzero((data.run_index == i) & data.whole)
        if len(places):
            turned = _one_phase(data.D[places], data.F[places])
            off = np.max([np.abs(z - complex_median(z)).max(axis=1) / np.abs(z).max() for z in turned], axis=0)
            good[places] = off <= _FAR * np.median(off)
    return good


def _one_phase(d: ComplexArray, f: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Windows of a run turned to the phase of the first one's displacement: the drive may wander."""
    turn = np.einsum("na,a->n", d.conj(), d[0])
    turn = (turn / np.maximum(np.abs(turn), 1e-300))[:, None]
    return d * turn, f * turn


def _run_means(data: PointData, weights: FloatArray) -> tuple[ComplexArray, ComplexArray, FloatArray] | None:
    """Means (n_runs, 2) of the runs' good windows, and the standard errors of the forces' components."""
    D, F, noise = [], [], []
    for i in range(len(data.runs)):
        good = (data.run_index == i) & (weights > 0) & data.whole
        if good.sum() < 2:
            return None
        d, f = _one_phase(data.D[good], data.F[good])
        D.append(d.mean(axis=0))
        F.append(f.mean(axis=0))
        noise.append(np.sqrt(0.5 * np.sum(np.abs(f - f.mean(axis=0)) ** 2, axis=0) / (len(f) - 1) / len(f)))
    return np.array(D), np.array(F), np.array(noise)


def _row(
    D: ComplexArray, F: ComplexArray, square: FloatArray, noise: FloatArray, prior: float
) -> tuple[ComplexArray, FloatArray]:
    """One row of (H, G), and the real covariance (4, 4) that G's leaves on H's row at the runs' amplitudes.

    Runs differ by a share of their force (loads that miss their set point) and by noise; the share is found from what
    the fit leaves.
    """
    design = np.concatenate([D, square[:, None] * D], axis=1)
    force = np.abs(F) ** 2 + np.mean(np.abs(F) ** 2)
    loose = np.diag([0.0, 0.0, 1 / prior**2, 1 / prior**2])
    share = 1e-6
    for _ in range(_ROUNDS):
        variance = noise**2 + share * force
        root = 1 / np.sqrt(variance)[:, None]
        gram = (design * root).conj().T @ (design * root)
        covariance = np.linalg.inv(gram + 2 * loose)
        solution = covariance @ ((design * root).conj().T @ (F[:, None] * root))[:, 0]
        residual = np.abs(F - design @ solution) ** 2
        spent = float(np.trace(covariance @ gram).real)
        spare = max(len(F) - spent, 1.0)
        share = max(float(np.sum((residual - 2 * noise**2) / force)) / (2 * spare), 1e-12)
    mixing = np.linalg.pinv(D) @ (square[:, None] * D)
    spread = mixing @ covariance[2:, 2:] @ mixing.conj().T
    # of a circular complex error: each part has the variance that the weights were made of
    return solution, np.block([[spread.real, -spread.imag], [spread.imag, spread.real]])
