"""Means of single lines over a run: what is kept of the disturbing ones once the windows' phasors are put away."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tpjb_ident.arrays import ComplexArray
from tpjb_ident.dynamic.records.run_data import RunPhasors


@dataclass(frozen=True)
class LineMean:
    """One line of a run.

    Attributes
    ----------
    displacement, force : (2,) complex ndarray
        Medians over the windows [m], oil force [N].
    displacement_error, force_error : float
        Standard errors of their components.
    shared : bool
        Whether mains stand on the line too.
    """

    displacement: ComplexArray
    force: ComplexArray
    displacement_error: float
    force_error: float
    shared: bool = False


def second_harmonics(run: RunPhasors) -> tuple[tuple[LineMean, LineMean] | None, ...]:
    """Every excitation line of a run with its second harmonic; None where it is not fitted, or the shaft's.

    Parameters
    ----------
    run : RunPhasors
    """
    lines = (run.lines.excitation + run.lines.nuisance)[: run.displacement.phasors.shape[1]]
    found: list[tuple[LineMean, LineMean] | None] = []
    for i, driven in enumerate(run.lines.excitation):
        own = [k for k, line in enumerate(lines) if abs(line.frequency - 2 * driven.frequency) < 1e-3]
        # mains on it adds little; what turns with the shaft does not count as the film's
        named = own and not lines[own[0]].name.endswith("X")
        mains = bool(named) and lines[own[0]].name.startswith("mains")
        pair = (_mean(run, i), replace(_mean(run, own[0]), shared=mains)) if named else None
        found.append(pair if pair is not None and np.isfinite(pair[0].force).all() else None)
    return tuple(found)


def _mean(run: RunPhasors, line: int) -> LineMean:
    d, f = run.displacement.phasors[:, line], run.oil_force(line)
    good = np.isfinite(d).all(axis=1) & np.isfinite(f).all(axis=1)
    if not good.any():
        none = np.full(2, np.nan + 0j)
        return LineMean(none, none, np.nan, np.nan)
    d, f = d[good], f[good]
    return LineMean(_median(d), _median(f), _error(d), _error(f))


def _median(z: ComplexArray) -> ComplexArray:
    return np.asarray(np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0))


def _error(z: ComplexArray) -> float:
    parts = np.concatenate([z.real, z.imag], axis=1)
    scale = 1.4826 * np.median(np.abs(parts - np.median(parts, axis=0)), axis=0)
    return float(1.25 * scale.max() / np.sqrt(len(z)))
