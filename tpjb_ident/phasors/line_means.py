"""Means of single lines over a run: second harmonics and mains, kept when the windows' phasors are put away."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.phasors.run_data import RunPhasors

#: Sum of the windows' phasors over that of their sizes below which the drive wanders.
_COHERENT = 0.9
#: Windows farther than this from the middle one, in median distances, do not count.
_FAR = 4.0


@dataclass(frozen=True)
class LineMean:
    """One line of a run."""

    displacement: ComplexArray  #: (2,) complex, m
    force: ComplexArray  #: (2,) complex, N
    displacement_error: float
    force_error: float
    shared: bool = False


def second_harmonics(run: RunPhasors) -> tuple[tuple[LineMean, LineMean] | None, ...]:
    """Every excitation line of a run with its second harmonic; None where it is not fitted, or the shaft's."""
    lines = (run.lines.excitation + run.lines.nuisance)[: run.displacement.phasors.shape[1]]
    pairs: list[tuple[LineMean, LineMean] | None] = []
    for i, driven in enumerate(run.lines.excitation):
        doubled = [k for k, line in enumerate(lines) if abs(line.frequency - 2 * driven.frequency) < 1e-3]
        # mains on it adds little; what turns with the shaft does not count as the film's
        named = doubled and not lines[doubled[0]].name.endswith("X")
        mains = bool(named) and lines[doubled[0]].name.startswith("mains")
        pair = (_mean(run, i), replace(_mean(run, doubled[0]), shared=mains)) if named else None
        pairs.append(pair if pair is not None and np.isfinite(pair[0].force).all() else None)
    return tuple(pairs)


def _mean(run: RunPhasors, line: int) -> LineMean:
    d, f = run.displacement.phasors[:, line], run.oil_force(line)
    good = np.isfinite(d).all(axis=1) & np.isfinite(f).all(axis=1)
    if not good.any():
        none = np.full(2, np.nan + 0j)
        return LineMean(none, none, np.nan, np.nan)
    d, f = d[good], f[good]
    return LineMean(complex_median(d), complex_median(f), _error(d), _error(f))


def _error(z: ComplexArray) -> float:
    parts = np.concatenate([z.real, z.imag], axis=1)
    scale = 1.4826 * np.median(np.abs(parts - np.median(parts, axis=0)), axis=0)
    return float(1.25 * scale.max() / np.sqrt(len(z)))


def mains_line(run: RunPhasors) -> ComplexArray | None:
    """Typical displacement phasor (2,) at a run's mains line [m]; None where something else sits on it."""
    place = _place(run)
    return None if place is None else _typical_phasor(run.displacement.phasors[:, place])


def mains_force(run: RunPhasors) -> ComplexArray | None:
    """The same of the oil force [N]."""
    place = _place(run)
    return None if place is None else _typical_phasor(run.oil_force(place))


def _place(run: RunPhasors) -> int | None:
    names = [line.name for line in run.lines.nuisance]
    if "mains" not in names or _shared(run, names.index("mains")):
        return None
    return len(run.lines.excitation) + names.index("mains")


def _typical_phasor(z: ComplexArray) -> ComplexArray | None:
    z = z[np.isfinite(z).all(axis=1)]
    return complex_median(z) if len(z) else None


def _shared(run: RunPhasors, index: int) -> bool:
    """Whether a drive harmonic was merged into the mains line of this run."""
    mains = run.lines.nuisance[index]
    return any(abs(n * e.frequency - mains.frequency) <= mains.wander for e in run.lines.excitation for n in (2, 3))


def complex_median(z: ComplexArray) -> ComplexArray:
    """Median of real and imaginary parts over the first axis; `z` (n, ...)."""
    return np.asarray(np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0))


def channel_phasors(run: RunPhasors, line: int) -> ComplexArray:
    """Typical phasor of every channel at one line over a run, (n_channels,); NaN where a channel has none.

    Where the drive wanders, the windows are turned to one phase first, by the pattern that all of them show.
    """
    z = run.z[:, line]
    good = np.isfinite(z).all(axis=1)
    if good.sum() > 2:
        weighted = z[good] / np.maximum(np.median(run.scale[good], axis=0), np.finfo(float).tiny)
        course = np.linalg.svd(weighted, full_matrices=False)[0][:, 0]
        if abs(course.sum()) < _COHERENT * np.abs(course).sum():
            z = z[good] * np.exp(-1j * np.angle(course))[:, None]
    typical = np.full(z.shape[1], np.nan + 0j)
    for k, windows in enumerate(z.T):
        present = windows[np.isfinite(windows)]
        if len(present):
            middle = complex_median(present)
            distance = np.abs(present - middle)
            typical[k] = present[distance <= _FAR * np.median(distance)].mean()
    return typical
