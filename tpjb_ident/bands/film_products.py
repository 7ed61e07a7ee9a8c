"""What a film that is not linear makes of a band's motion: at lines that nothing drives, and with the shaft's orbit.

A film that hardens with the square of the motion answers h D + kappa |D|^2 D. Of lines with random phases the sums of
three that meet at a fourth are noise that repeats with the period, of power 6 kappa^2 (S * S * S) with S the two-sided
power of the motion; what two of them take off again is no noise but a change of h by 3 kappa sigma^2, sigma^2 the
motion's mean square (Pintelon and Schoukens, System Identification, 2nd ed. 2012, chapter 3). A film with a square term
kappa_2 makes sums of two as well, 2 kappa_2^2 (S * S), which scatter and change nothing. Lines that are left out show
both, where sums reach them. A film of the form x / (1 - x / c)^n has kappa of about 3/4 kappa_2^2 / h, which is taken
at least: it stands in where all odd lines are driven (with sines, 4.5 q2^2).

The shaft's orbit makes of every line another one at f - 2X, half as large as its change of h at f. Where the shaft
turns with a multiple of the period, what it makes at f - X falls on other lines, with another phase in every run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import nnls

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.run_spectra import RunSpectra
from tpjb_ident.estimate.arrowhead import MODELS, complex_matrix, power_columns
from tpjb_ident.estimate.term import ALLOWED_CHANGE, CHANGE_BY_ORBIT

#: Undriven lines that tell, at least, and how much of what falls on driven lines must fall on them.
_LEAST_LINES, _REACHED = 3, 0.1
#: Bins of the whole record within which one line falls on another.
_ON_LINE = 1.0
#: Motion across the drive, over that along it, that is itself a product of other lines.
_ACROSS = 0.2
#: Kappa over kappa_2^2 / h.
_STANDS_IN = 0.75
#: Lines whose noise is taken together, and standard deviations from which products stand above it.
_NEIGHBOURS, _CLEAR = 9, 5.0
#: Rounds in which powers, each as uncertain as it is large, are weighed.
_ROUNDS = 4


@dataclass(frozen=True)
class FilmProducts:
    """What the film's curvature does to a band's result; NaN where no line tells."""

    change: float  #: share by which the band's own motion may change H
    scatter: FloatArray  #: (n_runs, n_bins, 2): along X and Y over a line's film force, alike in all repeats
    orbit: float  #: share by which the shaft's orbit may change H
    turning: float  #: relative scatter of a line's film force that differs from run to run with the shaft's angle
    even: bool  #: whether sums of two driven lines fall on driven ones
    seen: bool = False  #: whether undriven lines show products above their noise; else what that could hide is given


def film_products(runs: Sequence[RunSpectra]) -> FilmProducts:
    """What the lines of a point's runs tell; of a period, those beyond the band as well."""
    unknown = np.full((len(runs), len(runs[0].frequencies), 2), np.nan)
    within, runs = runs[0].frequencies, [run.wide or run for run in runs]
    driven = np.all([run.driven for run in runs], axis=0)
    if not driven.any():
        return FilmProducts(np.nan, unknown, 0.0, 0.0, True)
    film = _film(runs, driven)
    turned = [film.at_turned(runs, order) for order in (1, 2)]
    orbit = ALLOWED_CHANGE * CHANGE_BY_ORBIT * turned[1]
    if runs[0].period is None:
        return FilmProducts(np.nan, unknown, orbit, 0.0, True)
    number = np.round(runs[0].frequencies * runs[0].period).astype(int)
    beside = [np.isin(number, _beside_shaft(runs[0], order)) for order in (1, 2)]
    falls_on_lines = [bool((driven & places).any()) for places in beside]
    shaft = orbit, float(np.linalg.norm(np.multiply(falls_on_lines, turned)))
    undriven = ~np.any([*beside, *(run.driven | run.disturbed for run in runs)], axis=0)
    motion = [np.sum(np.abs(run.displacement.mean(axis=0)) ** 2, axis=1) * run.driven for run in runs]
    sums = np.array([_sums(number, power / 4) for power in motion])
    usual = sums.mean(axis=0)
    reached = usual > _REACHED * np.median(usual[driven | undriven], axis=0)
    undriven &= reached.any(axis=1)
    even = bool(reached[driven, 0].mean() > 0.5)
    if undriven.sum() < _LEAST_LINES:
        return FilmProducts(np.nan, unknown, *shaft, even)
    sums *= [8.0, 24.0]  # of amplitudes' squares, 4 S
    shown = sums[:, undriven], *film.excess(runs, undriven)
    curvature, clear = _hidden(*shown)
    seen = bool(clear.max() > _CLEAR)
    if seen:
        for of_run, part, *axes in zip(curvature, *shown):
            of_run[:] = [_curvature(part, *axis) for axis in zip(*axes)]
    square, cube = curvature.sum(axis=1).mean(axis=0)
    stiffness = np.sqrt(film.force / np.mean(motion, axis=0)[driven].mean())
    cube = max(cube, (_STANDS_IN * square / stiffness) ** 2)
    change = 3 * np.sqrt(cube) * max(run.rms for run in runs) ** 2 / stiffness
    force = np.array([np.sum(np.abs(run.force.mean(axis=0)) ** 2, axis=1) for run in runs])
    scatter = np.sqrt(np.einsum("rnk,rak->rna", sums, curvature) / np.maximum(force, 1e-300)[:, :, None])
    scatter = scatter[:, np.searchsorted(runs[0].frequencies, within - 0.5 / runs[0].period)]
    return FilmProducts(ALLOWED_CHANGE * float(change), ALLOWED_CHANGE * scatter, *shaft, even, seen)


def _hidden(sums: FloatArray, power: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Squares of kappa_2 and kappa that noise hides, and how clearly lines stand above it, (n_runs, 2, 2) each.

    Of lines (n_runs, n, 2) as `_curvature` takes them, `power`, `noise` (n_runs, 2, n).
    """
    weight = 1 / np.maximum(noise, 1e-12 * np.abs(power).max()) ** 2
    error = 1 / np.sqrt(np.maximum(np.einsum("rnk,ran->rak", sums**2, weight), 1e-300))
    return 2 * error, np.einsum("rnk,ran,ran->rak", sums, weight, power) * error


def _beside_shaft(run: RunSpectra, order: int) -> IntArray:
    """Numbers of the lines n X + f and n X - f of every driven f, of a shaft that turns with the period; else none."""
    assert run.period is not None
    turns = order * run.shaft * run.period
    if not turns or abs(turns - round(turns)) * len(run.start) > _ON_LINE:
        return np.zeros(0, dtype=int)
    number = np.round(run.frequencies[run.driven] * run.period).astype(int)
    return np.abs(round(turns) + np.concatenate([number, -number]))


def _curvature(sums: FloatArray, power: FloatArray, noise: FloatArray) -> tuple[float, float]:
    """Squares of kappa_2 and kappa by powers (n,) at some lines, as `sums` (n, 2) of two and three lines make them.

    `noise` (n,): of the powers, which are besides as uncertain as they are large.
    """
    size = np.maximum(sums.max(axis=0), np.finfo(float).tiny)
    unit = max(np.abs(power).max(), 1e-300)
    fitted = np.full(len(power), unit)
    for _ in range(_ROUNDS):
        expected = np.maximum((fitted + noise) / unit, 1e-3)
        numbers = nnls(sums / size / expected[:, None], power / expected)[0]
        fitted = sums / size @ numbers
    square, cube = numbers / size
    return float(square), float(cube)


def _sums(number: IntArray, power: FloatArray) -> FloatArray:
    """Sums (n, 2) over two and three lines of either sign that meet at a line, of their powers; `number` (n,)."""
    from scipy.signal import fftconvolve  # takes longer to import than a run to read

    top = int(number.max())
    lines = np.zeros(2 * top + 1)
    lines[top + number], lines[top - number] = power, power
    two = fftconvolve(lines, lines)
    three = fftconvolve(two, lines)
    return np.maximum(np.stack([two[2 * top + number], three[3 * top + number]], axis=1), 0.0)


@dataclass(frozen=True)
class _Film:
    """K-C-M of the driven lines by least squares."""

    driven: BoolArray  #: (n_bins,)
    numbers: FloatArray  #: (12,)
    middle: float  #: rad/s
    force: float  #: N^2: mean square of the driven lines' film force

    def unexplained(self, D: ComplexArray, F: ComplexArray, frequencies: FloatArray) -> ComplexArray:
        """Force beyond h D at some frequencies [Hz], negative ones too, (n_windows, n_bins, 2) [N]."""
        columns = power_columns(2 * np.pi * frequencies / self.middle, MODELS["K-C-M"])
        return F - np.einsum("kij,wkj->wki", complex_matrix(columns @ self.numbers), D)

    def excess(self, runs: Sequence[RunSpectra], places: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Square of every run's unexplained force at some bins along X and Y without its noise, and that noise.

        Both (n_runs, 2, n) [N^2].
        """
        squares, noises = [], []
        for run in runs:
            force = self.unexplained(run.displacement[:, places], run.force[:, places], run.frequencies[places])
            noise = np.var(force, axis=0, ddof=1) / len(force)
            squares.append((np.abs(force.mean(axis=0)) ** 2 - noise).T)
            noises.append(median_filter(noise, (_NEIGHBOURS, 1), mode="nearest").T)  # few windows tell a line's badly
        return np.array(squares), np.array(noises)

    def at_turned(self, runs: Sequence[RunSpectra], order: int) -> float:
        """Force at f - nX that goes with a run's motion at f, over the force at f; zero where noise explains it."""
        squares = [0.0]
        for run in runs:
            if order in run.turned:
                turned, motion = run.turned[order], run.displacement.mean(axis=0)[self.driven]
                D, F = turned.displacement, turned.force
                force = self.unexplained(D, F, run.frequencies - order * run.shaft)[0, self.driven]
                coherent = motion @ np.linalg.lstsq(motion, force, rcond=_ACROSS)[0]
                noise = np.sum(np.abs(force - coherent) ** 2) * 2 / max(len(force) - 2, 1)
                squares.append((np.sum(np.abs(coherent) ** 2) - noise) / len(force) / self.force)
        return float(np.sqrt(max(np.sum(squares) / max(len(squares) - 1, 1), 0.0)))


def _film(runs: Sequence[RunSpectra], driven: BoolArray) -> _Film:
    """The film of some runs by their driven lines (n_bins,)."""
    omega = 2 * np.pi * runs[0].frequencies[driven]
    middle = np.median(omega)
    columns = complex_matrix(power_columns(omega / middle, MODELS["K-C-M"]).transpose(0, 2, 1))
    D = np.array([run.displacement.mean(axis=0)[driven] for run in runs])
    F = np.array([run.force.mean(axis=0)[driven] for run in runs])
    design = np.einsum("kqij,rkj->rkiq", columns, D).reshape(-1, columns.shape[1])
    rows = np.concatenate([design.real, design.imag])
    numbers = np.linalg.lstsq(rows, np.concatenate([F.real.ravel(), F.imag.ravel()]), rcond=None)[0]
    return _Film(driven, numbers, middle, float(np.mean(np.sum(np.abs(F) ** 2, axis=2))))
