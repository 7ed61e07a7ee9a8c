"""Windows of one operating point to one phasor per run and channel, with noise, slope and weights.

Which windows are good, all channels say together: a window far from its run's others in the metric of their own
scatter loses its weight. Noise is their covariance about each device's own drift, pooled over the point's runs.

A drive that wanders or a line close by moves the shaft from window to window. That is no noise, F = H D holds for it:
counted as noise of the probes, such motion would explain away what an error of H leaves. It is known by its pattern:
displacements and oil forces answer it as they do in the means of the runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.estimate.equation import totals
from tpjb_ident.estimate.statistics import trimming_limits, trimming_weight

#: |sum| over sum of moduli of a run's windows below which its phase counts as wandering.
LOCKED = 0.9
#: Windows of a run from which its drift is told.
_DRIFT_WINDOWS = 4
#: Rounds of trimming.
_ROUNDS = 3
#: Part of the noise's own mean variance that every direction has at least: keeps exact data solvable.
_FLOOR = 1e-12
#: Power of a motion, over what the channels' own noise puts along it, up to which it counts as noise: an error of H
#: below a tenth is not explained away by so little, and noise that channels share is not taken for motion.
_AS_NOISE = 100.0
#: Rounds in which the channels' own noise is found.
_NOISE_ROUNDS = 3
#: Noise that every channel has at least, over what all channels leave: few bins fit exactly.
_LEAST = 1e-9
#: Keeps records without noise finite.
_TINY = 1e-300


@dataclass(frozen=True)
class Readings:
    """What is known of a point's m channels beside their phasors."""

    devices: Sequence[str]
    film: FloatArray  #: (m, m): displacements and oil forces of the channels


@dataclass(frozen=True)
class WindowMeans:
    """Runs of one point, g of them, m channels."""

    mean: ComplexArray  #: (g, m)
    slope: ComplexArray  #: (g, m), 1/s
    time: FloatArray  #: (g,), s: middle of the windows
    count: FloatArray  #: (g,): effective number of windows
    spread: FloatArray  #: (g,), s^2: sum of squared distances of the windows from their middle
    noise: ComplexArray  #: (m, m): covariance of a single window
    motion: ComplexArray  #: (m, m): covariance of what moves from window to window
    spare: float  #: degrees of freedom of the noise
    weights: FloatArray  #: (n,): of the windows
    residual: ComplexArray  #: (n, m): what differs from their runs' drift
    wandering: int = 0


def window_means(
    z: ComplexArray, run: IntArray, time: FloatArray, readings: Readings, weights: FloatArray, present: BoolArray
) -> WindowMeans | None:
    """Means of a point's windows; None where no window has a phasor of every channel that its run has.

    `z` (n, m) [SI], NaN where a window gives none, `run` (n,), `time` (n,) [s], `weights` (n,) of the robust start,
    `present` (g, m): channels of every run.
    """
    z = np.where(present[run], z, 0.0)
    complete = np.asarray(np.isfinite(z).all(axis=1))
    good = (complete & (weights > 0.2)).astype(float)
    if not good.any():
        return None
    z = np.where(complete[:, None], z, 0.0)
    scale = np.max(np.abs(z[complete]), axis=0) + 1e-300
    turned, wandering = aligned(z / scale, run, good)
    readings = replace(readings, film=readings.film * scale / scale[:, None])
    lower, upper, shrinkage = trimming_limits(2 * z.shape[1])
    means = _pooled(turned, run, time, readings, good, present)
    for _ in range(_ROUNDS):
        solved = np.linalg.solve(means.noise, means.residual.T)
        distance = 2 * np.einsum("na,an->n", means.residual.conj(), solved).real
        size = means.count[run]
        # one that took no part is far away by the noise of few others, which is too small on average
        few = max(means.spare / max(means.spare - z.shape[1], 1.0), 1.0)
        inside = np.where(good > 0, 1 - 1 / np.maximum(size, 2.0), few * (1 + 1 / np.maximum(size, 1.0)))
        trimmed = complete * (size > 0) * trimming_weight(distance / inside, lower, upper)
        lost = totals(run, trimmed, len(present)) < 1.0
        good = np.where(lost[run], good, trimmed)
        means = _pooled(turned, run, time, readings, good, present)
    outer = np.outer(scale, scale)
    return replace(
        means,
        mean=means.mean * scale,
        slope=means.slope * scale,
        noise=means.noise / shrinkage * outer,
        motion=means.motion * outer,
        residual=means.residual * scale,
        wandering=wandering,
    )


def _pooled(
    z: ComplexArray, run: IntArray, time: FloatArray, readings: Readings, weights: FloatArray, present: BoolArray
) -> WindowMeans:
    """Weighted mean and slope of every run, and the covariance of a window about them."""
    g = len(present)
    of_run = weights * (run == np.arange(g)[:, None])
    total = of_run.sum(axis=1)
    share = of_run / np.maximum(total, 1e-12)[:, None]
    mean, middle = share @ z, share @ time
    away = time - middle[run]
    spread = of_run @ away**2
    slope = of_run @ (away[:, None] * z) / np.maximum(spread, 1e-12)[:, None]
    slope[total < _DRIFT_WINDOWS] = 0.0
    drift = _drift(mean, slope, readings.devices)
    residual = z - mean[run] - drift[run] * away[:, None]
    complete = present.all(axis=1)
    complete |= not complete.any()
    runs = np.sqrt(total[complete])[:, None] * mean[complete]
    motion = motion_in(residual, weights, runs, readings.film) * present[run]
    residual = residual - motion
    # the mean, and one complex rate a device of several channels
    used = 1.0 + 0.5 * ((total >= _DRIFT_WINDOWS) & (spread > 0))
    remaining = np.maximum(total - used, 0.0)
    spare = float(remaining.sum())
    # a channel that some runs lack has fewer residuals: its row and column are scaled alike, which keeps N positive
    counts = np.maximum(remaining @ present, 1.0)
    root = np.sqrt(1 / counts)
    noise = (weights[:, None] * residual).T @ residual.conj() * np.outer(root, root)
    noise = noise + (1e-24 + _FLOOR * float(np.trace(noise).real)) * np.eye(z.shape[1])
    moved = (weights[:, None] * motion).T @ motion.conj() / max(spare, 1.0)
    return WindowMeans(mean, slope, middle, total, spread, noise, moved, spare, weights, residual)


def _drift(mean: ComplexArray, slope: ComplexArray, devices: Sequence[str]) -> ComplexArray:
    """Slope that all channels of a device share as one complex rate of their readings, (g, m) [1/s]."""
    drift = np.zeros_like(slope)
    for device in dict.fromkeys(devices):
        columns = [j for j, name in enumerate(devices) if name == device]
        power = np.sum(np.abs(mean[:, columns]) ** 2, axis=1)
        rate = np.sum(mean[:, columns].conj() * slope[:, columns], axis=1) / np.maximum(power, 1e-300)
        drift[:, columns] = rate[:, None] * mean[:, columns]
    return drift


def aligned(z: ComplexArray, direction: IntArray, weights: FloatArray) -> tuple[ComplexArray, int]:
    """Turn windows to their direction's common phase where the phase wanders, (n, m).

    Repeats are repeats of one phasor only while the actuators' generator is locked to the recorder. Where it is not,
    each window's phasors turn by a common angle, which F = H D does not see, but an average does.

    `z` (n, m), `direction` (n,), `weights` (n,).
    """
    result, wandering = z, 0
    for d in range(int(direction.max()) + 1):
        places = np.flatnonzero(direction == d)
        good = places[weights[places] > 0]
        if len(good) < 3:
            continue
        pattern = np.linalg.svd(z[good], full_matrices=False)[2][0].conj()
        along = z[places] @ pattern
        counted = z[good] @ pattern
        if abs(counted.sum()) >= LOCKED * np.abs(counted).sum():
            continue
        if wandering == 0:
            result = z.copy()
        wandering += 1
        turn = np.exp(-1j * np.angle(along))
        result[places] = z[places] * turn[:, None]
    return result, wandering


def attenuation(D: ComplexArray, count: FloatArray, noise: ComplexArray) -> FloatArray:
    """Noise power over total power of the displacements D (g, 2) along their principal directions, larger first."""
    total = count.sum()
    power = (count[:, None] * D).T @ D.conj() / total + noise * (1 - len(D) / total)
    return np.sort(np.linalg.eigvals(np.linalg.solve(power, noise)).real)[::-1]


def motion_in(residual: ComplexArray, weights: FloatArray, means: ComplexArray, film: FloatArray) -> ComplexArray:
    """The part of residuals (n, m) that is motion beyond what the channels' own noise explains, (n, m).

    `weights` (n,) of the residuals, `means` (g, m) of the runs, `film` (m, m): displacements and oil forces of the
    channels, accelerometers none.
    """
    if not len(residual):
        return residual
    shown = means @ film.T
    scale = np.abs(shown).max(axis=0, initial=0.0)
    scale[scale == 0] = 1.0
    # motion along two directions spans the runs
    pattern = np.linalg.svd(shown / scale, full_matrices=False)[2][:2].T
    z, root = residual @ film.T / scale, np.sqrt(weights)[:, None]
    rest, total = z, max(weights.sum(), 1.0)
    m, k = pattern.shape
    least = _LEAST * np.mean(np.abs(root * z) ** 2) + _TINY
    for _ in range(_NOISE_ROUNDS):
        variance = np.sum(np.abs(root * rest) ** 2, axis=0) / total * m / max(m - k, 1) + least
        gram = np.linalg.inv(pattern.conj().T @ (pattern / variance[:, None]) + _LEAST**2 / least * np.eye(k))
        along = z / variance @ pattern.conj()
        rest = z - along @ gram.T @ pattern.T
    size = np.linalg.cholesky(gram)  # noise has a covariance of one along the patterns in this unit
    unit = root * (along @ size.conj())
    power, axes = np.linalg.eigh(unit.T @ unit.conj() / total)
    excess = np.where(power > _AS_NOISE, 1 - 1 / np.sqrt(np.maximum(power, _TINY)), 0.0)
    part = size @ (axes * excess) @ axes.conj().T @ size.conj().T
    return along @ part.T @ pattern.T * scale
