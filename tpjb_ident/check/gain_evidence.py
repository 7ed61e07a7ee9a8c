"""What one operating point's runs say of a single gain in one of them, by their phasors and by their means.

Two probes and two cells serve all runs of a point. If one of them reads g times the truth in one run, the part
1 - 1/g of its own reading is too much there, at the excitation line and in the mean alike. Both parts are estimated
from the run against the others, by generalised least squares: noise is what the others scatter by, and beside it stands
what honest runs differ by (`_HONEST`): a bearing that answers a little softer or less damped in one run, a load that
misses its set point and moves the shaft as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray

#: Stiffness, damping and static load of one run may differ from the others' by this share, one standard deviation:
#: oil gets warmer, loads are set by hand.
_HONEST = 0.01
#: Least scatter that runs are credited with: phasors and mean loads as a share, mean positions [m].
_LEAST_PHASOR, _LEAST_LOAD, _LEAST_POSITION = 1e-4, 1e-3, 10e-9
#: Runs whose scatter has up to this many times the variance of their records' noise differ by that noise: 5 % of all
#: that do have more, with 12 degrees of freedom. Every record's noise was taken from 10 lines.
_NO_MORE, _LINES_TELL = 1.75, 10
#: Fewer degrees of freedom cannot tell whether runs differ by noise alone.
_TELLING = 8
#: How well the zero of a probe, and so its distance from there, is known from a clearance run.
LEVER_KNOWN = 0.25


@dataclass(frozen=True)
class PointReadings:
    """Readings of the n runs of one operating point, SI."""

    probes: ComplexArray  #: (n, 2) complex, m
    cells: ComplexArray  #: (n, 2) complex, N
    inertia: ComplexArray  #: (n, 2) complex, N: housing mass times acceleration, X and Y
    probe_means: FloatArray  #: (n, 2), m
    cell_means: FloatArray  #: (n, 2), N
    probe_plane: FloatArray  #: `probe_plane`, `cell_plane` (2, 2): from the two readings to X and Y
    cell_plane: FloatArray
    centre: tuple[float | None, float | None] = (None, None)
    noise: FloatArray | None = None  #: (n, 4)

    @property
    def displacement(self) -> ComplexArray:
        """X, Y of every run, (n, 2) [m]."""
        return np.asarray(self.probes @ self.probe_plane.T)

    @property
    def force(self) -> ComplexArray:
        """Of the film, X, Y of every run, (n, 2) [N]."""
        return np.asarray(self.cells @ self.cell_plane.T + self.inertia)


@dataclass(frozen=True)
class Difference:
    """How one run differs from what the others foretell, with its covariance."""

    rest: FloatArray  #: (m,)
    noise: FloatArray  #: (m, m): covariance that the others' scatter tells
    honest: FloatArray  #: (m, m): covariance of what honest runs differ by beyond it
    spare: int

    def evidence(self, pattern: FloatArray) -> Evidence:
        """Estimate the factor of `pattern` (m,) in the rest; of nothing where the pattern does not show."""
        weights = np.linalg.solve(self.noise + self.honest, pattern)
        information = float(pattern @ weights)
        if not information > 0:
            return Evidence(0.0, 0.0, 0.0)
        share = float(weights @ self.noise @ weights) / information**2
        return Evidence(float(weights @ self.rest) / information, information, share**2 / self.spare)

    def misfit(self, pattern: FloatArray, part: float) -> float:
        """Squared distance of the rest from `part` times the pattern, per equation, in units of its covariance."""
        remaining = self.rest - part * pattern
        return float(remaining @ np.linalg.solve(self.noise + self.honest, remaining)) / len(remaining)

    def widened(self, place: int, deviation: float) -> Difference:
        """The same with one equation less certain."""
        honest = self.honest.copy()
        honest[place, place] += deviation**2
        return Difference(self.rest, self.noise, honest, self.spare)


@dataclass(frozen=True)
class Evidence:
    """An estimate of 1 - 1/g."""

    part: float
    information: float
    doubt: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of its variance (Welch, Satterthwaite)."""
        return float(np.inf) if self.doubt <= 0 else self.information**-2 / self.doubt

    def chance(self) -> float:
        """Probability of so large a part where there is none, two-sided."""
        if self.information <= 0:
            return 1.0
        from scipy.special import stdtr

        # the t distribution of infinite freedom is the normal one, which stdtr takes as a large number
        return float(2 * stdtr(min(self.freedom, 1e9), -abs(self.part) * np.sqrt(self.information)))

    def joined(self, second: Evidence) -> Evidence:
        """Weighted mean of two independent estimates."""
        information = self.information + second.information
        if information <= 0:
            return self
        mine, share = self.information / information, second.information / information
        return Evidence(
            mine * self.part + share * second.part, information, mine**4 * self.doubt + share**4 * second.doubt
        )


def dynamic_difference(
    readings: PointReadings, run: int, agreeing: Sequence[int], stiffness: ComplexArray
) -> Difference | None:
    """Force of `run` minus H of the `agreeing` runs times its displacement: Re X, Re Y, Im X, Im Y [N].

    H is their `common_stiffness`; None where they leave no scatter.

    `stiffness` (2, 2) [N/m].
    """
    spare = 2 * (2 * len(agreeing) - 4)
    if spare < 4 or not np.any(readings.displacement[run]):
        return None
    displacement, force = readings.displacement, readings.force
    sizes = np.linalg.norm(displacement[list(agreeing)], axis=1)[:, None]
    unit = displacement[list(agreeing)] / sizes
    scatter = (force[list(agreeing)] - displacement[list(agreeing)] @ stiffness.T) / sizes
    run_displacement, size = displacement[run], float(np.linalg.norm(displacement[run]))
    noise = float(np.sum(np.abs(scatter) ** 2)) / spare
    noise_error = _noise_error(readings, agreeing, stiffness)
    if spare >= _TELLING and 0 < noise <= _NO_MORE * noise_error:
        # the runs differ by no more than their records' noise lets them, which is known from many lines
        noise, spare = max(noise, noise_error), spare + _LINES_TELL * len(agreeing)
    variance = noise * size**2 * (1 + leverage(unit, run_displacement / size))
    variance += (_LEAST_PHASOR * float(np.linalg.norm(force[run]))) ** 2
    changes = _bearing_changes(stiffness, run_displacement)
    honest = changes @ np.diag(_HONEST**2 + _bearing_wander(readings, agreeing, stiffness)) @ changes.T
    return Difference(_stacked(force[run] - stiffness @ run_displacement), variance * np.eye(4), honest, spare)


def _bearing_changes(stiffness: ComplexArray, displacement: ComplexArray) -> FloatArray:
    """Force by stiffness and by damping alone, (4, 2) as `_stacked` [N]: what a stiffer, a more damped bearing adds."""
    return np.stack([_stacked(stiffness.real @ displacement), _stacked(1j * stiffness.imag @ displacement)], axis=1)


def _bearing_wander(readings: PointReadings, runs: Sequence[int], stiffness: ComplexArray) -> FloatArray:
    """Variances by which some runs' stiffness and damping, as shares, differ about the matrix fitted to them, (2,)."""
    shares = []
    for displacement, force in zip(readings.displacement[list(runs)], readings.force[list(runs)], strict=True):
        residual = _stacked(force - stiffness @ displacement)
        shares.append(np.linalg.lstsq(_bearing_changes(stiffness, displacement), residual, rcond=None)[0])
    # the matrix took 8 of the 4 n equations along
    return np.asarray(np.mean(np.square(shares), axis=0) * len(runs) / (len(runs) - 2))


def _noise_error(readings: PointReadings, runs: Sequence[int], stiffness: ComplexArray) -> float:
    """Variance of (F - H D) / |D| per real equation by the records' noise, mean over runs; 0 where not known."""
    if readings.noise is None:
        return 0.0
    rows = list(runs)
    square = readings.noise[rows] ** 2
    by_probes = np.sum(np.abs(stiffness @ readings.probe_plane) ** 2, axis=0)
    by_cells = np.sum(readings.cell_plane**2, axis=0)
    sizes = np.linalg.norm(readings.displacement[rows], axis=1)
    error = (square[:, :2] @ by_probes + square[:, 2:] @ by_cells) / 2 / sizes**2
    return float(np.mean(error)) if np.all(np.isfinite(error)) else 0.0


def common_stiffness(readings: PointReadings, runs: Sequence[int]) -> ComplexArray | None:
    """H (2, 2) of F = H D over some runs; None where not determined."""
    return stiffness_of(readings.displacement[list(runs)], readings.force[list(runs)])


def stiffness_of(displacement: ComplexArray, force: ComplexArray) -> ComplexArray | None:
    """H (2, 2) of F = H D, every run weighted by one over its displacement; None where they move along one line.

    `displacement`, `force` (n, 2) [m], [N].
    """
    sizes = np.linalg.norm(displacement, axis=1)
    if len(sizes) < 2 or not np.all(sizes > 0) or not np.all(np.isfinite(sizes)):
        return None
    unit = displacement / sizes[:, None]
    singular = np.linalg.svd(unit, compute_uv=False)
    if singular[-1] < 0.2 * singular[0]:
        return None
    return np.asarray(np.linalg.lstsq(unit, force / sizes[:, None], rcond=None)[0].T)


def leverage(fitted: ComplexArray, own: ComplexArray) -> float:
    """Variance that a matrix fitted to displacements (n, 2) gives to its answer to one more (2,), over theirs."""
    return float(np.real(own.conj() @ np.linalg.solve(fitted.T @ fitted.conj(), own)))


def static_difference(
    readings: PointReadings, run: int, agreeing: Sequence[int], stiffness: ComplexArray
) -> Difference | None:
    """Mean readings of `run` minus those of the `agreeing` runs: probe, probe [m], cell, cell [N].

    A load that misses its set point shows in the cells and, over the stiffness, in the probes; what positions wander by
    besides is their scatter. None where the stiffness cannot carry a load.

    `stiffness` (2, 2) [N/m].
    """
    if len(agreeing) < 2 or np.linalg.eigvalsh(stiffness.real + stiffness.real.T)[0] <= 0:
        return None
    compliance = np.linalg.inv(stiffness.real)
    rows = list(agreeing)
    loads, places = readings.cell_means @ readings.cell_plane.T, readings.probe_means @ readings.probe_plane.T
    misses = loads[rows] - loads[rows].mean(axis=0)
    wander = places[rows] - places[rows].mean(axis=0) - misses @ compliance.T
    spare = 2 * (len(agreeing) - 1)
    size = float(np.linalg.norm(loads[rows].mean(axis=0)))
    to_probes, to_cells = np.linalg.inv(readings.probe_plane), np.linalg.inv(readings.cell_plane)
    by_load = np.vstack([to_probes @ compliance, to_cells])
    by_place = np.vstack([to_probes, np.zeros((2, 2))])
    more = 1 + 1 / len(agreeing)
    load_variance, place_variance = (float(np.sum(x**2)) / spare for x in (misses, wander))
    noise = more * (load_variance * by_load @ by_load.T + place_variance * by_place @ by_place.T)
    least = np.diag([_LEAST_POSITION**2] * 2 + [max((_LEAST_LOAD * size) ** 2, 1e-12)] * 2)
    honest = (_HONEST * size) ** 2 * by_load @ by_load.T + least
    residual = np.concatenate(
        [
            readings.probe_means[run] - readings.probe_means[rows].mean(axis=0),
            readings.cell_means[run] - readings.cell_means[rows].mean(axis=0),
        ]
    )
    return Difference(residual, noise, honest, spare)


def dynamic_pattern(readings: PointReadings, run: int, channel: int, stiffness: ComplexArray) -> FloatArray:
    """What a channel (probes 0 and 1, cells 2 and 3) contributes to force minus H times displacement, as `_stacked`.

    `stiffness` (2, 2) [N/m].
    """
    if channel < 2:
        return _stacked(-stiffness @ readings.probe_plane[:, channel] * readings.probes[run, channel])
    return _stacked(readings.cell_plane[:, channel - 2] * readings.cells[run, channel - 2])


def _stacked(vector: ComplexArray) -> FloatArray:
    """Real parts, then imaginary ones."""
    return np.concatenate([vector.real, vector.imag])
