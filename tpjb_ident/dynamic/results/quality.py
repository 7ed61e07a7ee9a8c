"""Figures and flags that say how far a point's coefficients can be trusted."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.estimate import MIN_COHERENCE, REJECTED_WEIGHT
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.housing_balance import HARMLESS, SOFT
from tpjb_ident.dynamic.results.point_result import WindowVerdict
from tpjb_ident.dynamic.runs.point_data import PointData

#: Share of the windows without phasors beyond which what is left may not stand for the record.
_MAX_LOST = 0.6
#: Share of the force that H leaves in the runs' means beyond which they have no H in common.
_MAX_DISAGREEMENT = 0.06
#: What a few runs show of a force of random phase may be so many times its size.
_KNOWN_SCATTERS = 1.5


def coherence(D: ComplexArray, F: ComplexArray, h: ComplexArray, weights: FloatArray) -> float:
    """Multiple coherence of the forces with the displacements, smaller axis.

    `D`, `F` (n, 2), `h` (2, 2), `weights` (n,).
    """
    good = np.isfinite(D).all(axis=1) & np.isfinite(F).all(axis=1) & (weights > 0)
    if not good.any() or not np.isfinite(h).all():
        return float("nan")
    w = weights[good, None]
    residual = F[good] - D[good] @ h.T
    power = (w * np.abs(F[good]) ** 2).sum(axis=0)
    return float(np.min(1 - (w * np.abs(residual) ** 2).sum(axis=0) / power))


def amplitude(data: PointData, weights: FloatArray) -> float:
    """Largest displacement amplitude (major half-axis of the orbit) of any run's mean phasor [m]; `weights` (n,)."""
    largest = 0.0
    for i in range(len(data.runs)):
        selected = (data.run_index == i) & (weights > 0) & np.isfinite(data.D).all(axis=1)
        if selected.any():
            z = np.average(data.D[selected], axis=0, weights=weights[selected])
            sizes = np.linalg.svd(np.stack([z.real, z.imag]), compute_uv=False)
            largest = max(largest, float(sizes[0]))
    return largest


def rejected_windows(data: PointData, h: ComplexArray, weights: FloatArray) -> tuple[WindowVerdict, ...]:
    """Windows without weight, each with the reason that shows in its own numbers; `h` (2, 2) [N/m], `weights` (n,)."""
    verdicts = []
    answered = bool(np.isfinite(h).all())
    for i in np.flatnonzero(weights < REJECTED_WEIGHT):
        run = data.runs[data.run_index[i]]
        k = int(i - np.searchsorted(data.run_index, data.run_index[i]))
        direction = float("nan") if run.direction is None else run.direction
        reason = _reason(data, run.displacement.lost[k], run.cell_force.lost[k], int(i), weights, answered)
        verdicts.append(WindowVerdict(run.run, float(run.start[k]), float(weights[i]), direction, reason))
    return tuple(verdicts)


def _reason(data: PointData, lost_d: float, lost_f: float, i: int, weights: FloatArray, answered: bool) -> str:
    for name, lost in (("displacement", lost_d), ("force", lost_f)):
        if lost > 0.5:
            return f"{100 * lost:.0f} % of the {name} samples missing or glitched"
    if not (np.isfinite(data.D[i]).all() and np.isfinite(data.F[i]).all()):
        return "missing values"
    if not answered:
        return "the point has no answer"
    siblings = (data.run_index == data.run_index[i]) & (weights >= REJECTED_WEIGHT)
    if not siblings.any():
        return "whole run disagrees with the other directions"
    moves = {"displacement": _shift(data.D[i], data.D[siblings]), "force": _shift(data.F[i], data.F[siblings])}
    worst = max(moves, key=lambda name: moves[name])
    return f"{worst} phasor {100 * moves[worst]:.1f} % away from its repeats"


def _shift(z: ComplexArray, repeats: ComplexArray) -> float:
    mean = repeats.mean(axis=0)
    return float(np.linalg.norm(z - mean) / max(float(np.linalg.norm(mean)), np.finfo(float).tiny))


def flags(data: PointData, stiffness: DynamicStiffness, coherence: float) -> tuple[Condition, ...]:
    """Conditions that the point's figures give rise to."""
    conditions = []
    if not coherence >= MIN_COHERENCE and np.isfinite(stiffness.h).all():
        conditions.append(Condition("low-coherence", f"coherence {coherence:.3f} < {MIN_COHERENCE}"))
    conditions += _missing(data)
    if len(data.runs) and data.runs[0].acceleration is None and np.isfinite(stiffness.h).all():
        conditions.append(_inertia_left(data.runs[0].housing_mass, stiffness.omega))
    return (*conditions, *feeds_motion(stiffness))


def _inertia_left(mass: float, omega: float) -> Condition:
    """What the housing's inertia may come to where nothing measures it: on soft cells."""
    share = mass * omega**2 / SOFT
    text = f"no accelerometers: the housing's inertia stays in F, {100 * share:.2g} % of it on soft cells"
    return Condition("inertia-not-corrected" if share > HARMLESS else "inertia-negligible", text)


def _missing(data: PointData) -> list[Condition]:
    """Windows without phasors, pointed out when they are many or a whole run's."""
    complete = data.whole
    empty = [run.run for i, run in enumerate(data.runs) if not complete[data.run_index == i].any()]
    if empty:
        return [Condition("run-without-data", f"no usable window in {', '.join(empty)}")]
    if complete.mean() < 1 - _MAX_LOST:
        text = f"{int((~complete).sum())} of {len(complete)} windows gave no phasors"
        return [Condition("most-windows-lost", text)]
    if complete.mean() < 0.9:
        return [Condition("windows-missing", f"{int((~complete).sum())} of {len(complete)} windows gave no phasors")]
    return []


def feeds_motion(stiffness: DynamicStiffness) -> tuple[Condition, ...]:
    """Say where damping, the symmetric part of Im h, is negative beyond doubt: no cross-coupled stiffness is in it."""
    h = stiffness.h
    if not np.isfinite(h).all():
        return ()
    doubt = 3 * float(stiffness.standard_error[4:].max())
    if not np.linalg.eigvalsh((h.imag + h.imag.T) / 2)[0] < -doubt:
        return ()
    text = "the film would feed the motion instead of damping it: check polarity, axes and sign of forces"
    return (Condition("negative-damping", text),)


def directional_pattern(data: PointData, weights: FloatArray) -> Condition | None:
    """Point out rejected windows that gather in some directions: physics may do that, glitches do not; `weights` (n,).

    A binomial test per run: more rejected windows than chance gives once in a thousand, in a run
    with at least three of them.
    """
    from scipy.special import bdtrc

    complete = data.whole
    bad = (weights < REJECTED_WEIGHT) & complete
    total = int(bad.sum())
    named = []
    for i, run in enumerate(data.runs):
        selected = (data.run_index == i) & complete
        n, hits = int(selected.sum()), int(bad[selected].sum())
        others = (total - hits + 0.5) / (int(complete.sum()) - n + 1.0)
        if hits >= 3 and hits > 0.4 * n and bdtrc(hits - 1, n, min(others, 1.0)) < 1e-3:
            angle = "" if run.direction is None else f" at {np.degrees(run.direction):.0f} deg"
            named.append(f"{run.run}{angle} ({hits} of {n})")
    if not named:
        return None
    return Condition("directional-rejection", f"rejected windows gather in {', '.join(named)}: look before discarding")


def disagreeing_runs(data: PointData, h: ComplexArray, weights: FloatArray, known: float = 0.0) -> Condition | None:
    """Runs whose mean forces H does not explain: noise averages out of means, other faults do not."""
    if len(data.runs) < 3 or not np.isfinite(h).all():
        return None
    good = data.whole & (weights > 0)
    shares, sizes = [], []
    for i in range(len(data.runs)):
        selected = good & (data.run_index == i)
        if selected.any():
            # repeats of one motion, whatever phase the drive had in each
            gram = data.D[selected].conj().T @ data.D[selected]
            first = np.linalg.eigh(gram)[1][:, -1]
            along = data.D[selected] @ first.conj()
            residual = (data.F[selected] - data.D[selected] @ h.T) * np.exp(-1j * np.angle(along))[:, None]
            sizes.append(float(np.linalg.norm(data.F[selected], axis=1).mean()))
            shares.append(float(np.linalg.norm(residual.mean(axis=0))) / sizes[-1])
    if len(shares) < 3:
        return None
    # two runs fix H: what is left over is shared by all of them
    share = float(np.sqrt(np.mean(np.square(shares)) * len(shares) / (len(shares) - 2)))
    if share <= np.hypot(_MAX_DISAGREEMENT, _KNOWN_SCATTERS * known / float(np.mean(sizes))):
        return None
    text = f"the runs' mean forces are {100 * share:.0f} % away from one H (limit {100 * _MAX_DISAGREEMENT:.0f} %)"
    return Condition("runs-disagree", text)
