"""Accelerometers held against load cells: the housing stands on the cells, and a spring knows no phase.

The cells are the housing's springs, so its acceleration is a = -omega^2 K^-1 F_cell with K symmetric, positive
definite and real. Swapped or inverted accelerometers, a device that is late, a filter before the cells: each breaks
one of these, whatever the bearing does. A small phase as of late cells enters the intervals; one as of damping in the
cells' mounts does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median

#: Phase between cells and accelerometers [rad] beyond which one of them is late; housings on bolted joints have 0.01.
_MAX_PHASE = 0.04
#: Asymmetry, and cross over direct, beyond which channels are exchanged.
_MAX_CROSS = 0.5
#: Inertia's share of the force below which wrong accelerometers do no harm worth refusing a point for.
HARMLESS = 2e-3
#: The ratio must stand this many standard errors above nothing to be judged.
_CLEAR = 8.0
#: A lag of the cells counts from so many standard errors on.
_CLEAR_LAG = 2.0
#: Smaller singular value of the directions of force, of six runs or less, below which they are one.
_ONE_LINE = 0.3
_MIN_RUNS = 3
#: No housing stands on springs as stiff as this [N/m]: a steel bar of 1 m^2 and 2 m has it. One that seems to does not
#: move for its accelerometers, which are dead.
_STIFFEST = 1e11
#: Springs that a housing is taken to stand on [N/m] where its accelerometers cannot tell: those of soft cells.
SOFT = 3e8
#: Windows this many times farther from the middle of their run than half of them are left out.
_FAR = 4.0


@dataclass(frozen=True)
class BalanceRun:
    """Means of one run at its excitation line."""

    frequency: float
    cells: ComplexArray  #: (2,) complex, N
    acceleration: ComplexArray  #: (2,) complex, m/s^2
    inertia: float
    mass: float = 0.0
    variance: float = 0.0
    windows: int = 1


@dataclass(frozen=True)
class Balance:
    """Verdict on one excitation frequency."""

    phase: float = 0.0
    conditions: tuple[Condition, ...] = ()
    doubt: float = np.inf

    def spread(self, est: DynamicStiffness) -> FloatArray:
        """Covariance (8, 8) of H if the cells are late by that phase: one standard deviation [N^2/m^2]."""
        moved = 1j * self.phase * est.h
        shift = np.concatenate([moved.real.ravel(), moved.imag.ravel()])
        return np.outer(shift, shift)


def balance_runs(data: PointData) -> list[BalanceRun]:
    """Means of a point's runs; empty where the rig has no accelerometers."""
    if data.runs[0].acceleration is None:
        return []
    verdicts = []
    mass = data.runs[0].housing_mass
    for i, (run, line) in enumerate(zip(data.runs, data.lines)):
        selected = (data.run_index == i) & data.whole & np.isfinite(data.A).all(axis=1)
        if not selected.any():
            continue
        rotated = _one_phase(np.concatenate([data.F[selected], data.A[selected]], axis=1), data.D[selected])
        rotated = rotated[_ordinary(rotated[:, :2]) & _ordinary(rotated[:, 2:])]
        F, A, n = rotated[:, :2].mean(axis=0), rotated[:, 2:].mean(axis=0), len(rotated)
        share = float(mass * np.linalg.norm(A) / max(float(np.linalg.norm(F)), 1e-300))
        variance = float(np.sum(np.abs(rotated[:, 2:] - A) ** 2)) / max(4 * (n - 1), 1)
        verdicts.append(BalanceRun(run.lines.excitation[line].frequency, F - mass * A, A, share, mass, variance, n))
    return verdicts


def _one_phase(z: ComplexArray, d: ComplexArray) -> ComplexArray:
    """Windows turned to the phase of the first one's displacement: the drive may wander."""
    turn = np.einsum("ni,i->n", d.conj(), d[0])
    return np.asarray(z * np.where(np.abs(turn) > 0, turn / np.maximum(np.abs(turn), 1e-300), 1.0)[:, None])


def _ordinary(z: ComplexArray) -> BoolArray:
    """Windows that are not far from the middle of them all."""
    off = np.linalg.norm(z - complex_median(z), axis=1)
    return np.asarray(off <= _FAR * np.median(off))


def balances(runs: Sequence[BalanceRun]) -> dict[float, Balance]:
    """A verdict for every excitation frequency, rounded to 0.01 Hz, that enough runs were excited at."""
    groups: dict[float, list[BalanceRun]] = {}
    for run in runs:
        groups.setdefault(frequency_key(run.frequency), []).append(run)
    table = {frequency: _judge(group) for frequency, group in groups.items() if len(group) >= _MIN_RUNS}
    lag = _shared_lag([(2 * np.pi * f, verdict) for f, verdict in table.items()])
    return {f: replace(verdict, phase=2 * np.pi * f * lag) for f, verdict in table.items()}


def _shared_lag(verdicts: Sequence[tuple[float, Balance]]) -> float:
    """Lag of the cells that all frequencies share [s]; zero where it is not clear of its error."""
    told = [(v.phase / omega, v.doubt / omega) for omega, v in verdicts if np.isfinite(v.doubt) and not v.conditions]
    if not told:
        return 0.0
    lags, errors = np.array(told).T
    weight = 1 / np.maximum(errors, 1e-12) ** 2
    lag, error = float(np.sum(weight * lags) / weight.sum()), float(1 / np.sqrt(weight.sum()))
    # cells that come late make it positive; what damping the housing's supports have makes it negative
    return lag if lag > _CLEAR_LAG * error else 0.0


def frequency_key(frequency: float) -> float:
    """Under which a frequency is found again."""
    return round(frequency, 2)


def _judge(group: Sequence[BalanceRun]) -> Balance:
    cells = np.array([run.cells for run in group])
    accelerations = np.array([run.acceleration for run in group])
    size = np.linalg.norm(cells, axis=1, keepdims=True)
    if np.linalg.svd(cells / size, compute_uv=False)[-1] < _ONE_LINE * max(1.0, np.sqrt(len(cells) / 6)):
        return Balance()
    # the accelerometers' noise is the same in all runs: a run counts by its force and its windows
    usual = float(np.median([run.variance for run in group]))
    root = np.sqrt([max(run.windows, 1) for run in group])[:, None]
    fit = _ratio(cells * root, accelerations * root, usual)
    if fit is None:
        return Balance()
    G, error = fit
    if not np.abs(np.diag(G)).min() > _CLEAR * error:
        if np.abs(G).max() > _CLEAR * error and np.abs(G - np.diag(np.diag(G))).max() > _MAX_CROSS * np.abs(G).max():
            return Balance(0.0, _contradiction(group, G, "each answers the force along the other's axis"))
        return Balance(0.0, _silence(group, G, error))
    direct = np.diag(G)
    cross = float(np.sqrt(abs(G[0, 1] * G[1, 0]) / abs(direct[0] * direct[1])))
    if cross > _MAX_CROSS:
        return Balance(0.0, _contradiction(group, G, "each answers the force along the other's axis"))
    if (direct.real > 0).any():
        return Balance(0.0, _contradiction(group, G, "they move with the cells' force, and not against it"))
    phases = np.angle(-direct)
    doubt = error / np.abs(direct)
    worst = int(np.argmax(np.abs(phases) - 3 * doubt))
    if abs(phases[worst]) > _MAX_PHASE + 3 * doubt[worst]:
        return Balance(0.0, (_out_of_phase(group, float(phases[worst])),))
    weight = 1 / np.maximum(doubt, 1e-12) ** 2
    return Balance(float(np.sum(weight * phases) / weight.sum()), (), float(1 / np.sqrt(weight.sum())))


def _ratio(cells: ComplexArray, accelerations: ComplexArray, noise: float) -> tuple[ComplexArray, float] | None:
    """Robust a = G F and the standard error of a component of G's entries; rows of one variance, `noise` at least."""
    weight = np.ones(len(cells))
    for _ in range(10):
        root = np.sqrt(weight)[:, None]
        G = np.linalg.lstsq(cells * root, accelerations * root, rcond=None)[0].T.astype(np.complex128)
        residual = np.linalg.norm(accelerations - cells @ G.T, axis=1)
        scale = 1.4826 * float(np.median(residual)) + 1e-300
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(residual, 1e-300))
    gram = (cells * weight[:, None]).conj().T @ cells
    if np.linalg.cond(gram) > 1e8:
        return None
    spread = max(float(np.sum(weight * residual**2) / max(4 * (float(weight.sum()) - 2.0), 1.0)), noise)
    return G, float(np.sqrt(spread * np.linalg.inv(gram).real.diagonal().max()))


def _severity(share: float) -> str:
    """Name of what is said of wrong accelerometers, by the share of the force that inertia is."""
    return "accelerometers-contradict-cells" if share > HARMLESS else "accelerometers-doubtful"


def _contradiction(group: Sequence[BalanceRun], G: ComplexArray, what: str) -> tuple[Condition, ...]:
    share = float(np.median([run.inertia for run in group]))
    return (
        Condition(
            _severity(share),
            f"acceleration over cell force is {_shown(G)} 1/kg at {group[0].frequency:g} Hz: {what}; "
            f"inertia is {100 * share:.2g} % of the force",
        ),
    )


def _silence(group: Sequence[BalanceRun], G: ComplexArray, error: float) -> tuple[Condition, ...]:
    """Accelerometers that show nothing of a force that must move the housing."""
    omega = 2 * np.pi * group[0].frequency
    stiffness = omega**2 / (np.abs(np.diag(G)) + _CLEAR * error)
    silent = [axis for axis, k in zip("XY", stiffness, strict=True) if k > _STIFFEST]
    if not silent:
        return ()
    share = group[0].mass * omega**2 / SOFT
    text = (
        f"they show nothing along {' and '.join(silent)} at {group[0].frequency:g} Hz: the housing would stand on "
        f"springs of over {stiffness.max():.1e} N/m. Are they connected? On soft cells inertia is {100 * share:.2g} % "
        "of the force"
    )
    return (Condition(_severity(share), text),)


def _shown(G: ComplexArray) -> str:
    return "[" + ", ".join(f"{z.real:.2e}{z.imag:+.1e}i" for z in G.ravel()) + "]"


def _out_of_phase(group: Sequence[BalanceRun], phase: float) -> Condition:
    frequency = group[0].frequency
    lag = phase / (2 * np.pi * frequency)
    late = "cells" if lag > 0 else "accelerometers"
    return Condition(
        "cells-and-accelerometers-out-of-phase",
        f"{np.degrees(abs(phase)):.1f} deg at {frequency:g} Hz, as if the {late} were {1e3 * abs(lag):.2g} ms late or "
        "behind a filter; between springs and their housing there is none. State `delay` or `filter` of the channels",
    )
