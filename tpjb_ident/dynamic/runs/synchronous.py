"""A drive that turns with the shaft: what the shaft itself brings into the readings, told from the motion by the runs.

Runout r of the probes and a force q that turns with the shaft have the drive's frequency: F = H (D - r s) + q s
= H D + c s, with c = q - H r the same in all runs and s the unit phasor of the shaft in each. So c is one more
unknown vector beside H. Runs whose motion does not follow s tell the two apart: combinations of the runs in which s
cancels obey F = H D, and are estimated like any others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, IntArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median
from tpjb_ident.phasors.shaft import shaft_order

_FITTED = "shaft lines fitted"
#: Runs that tell H and what turns with the shaft: three unknowns for each force.
_MIN_RUNS = 3
#: Condition number of the motions, without what follows the shaft, from which errors are strongly amplified.
_ILL_CONDITIONED = 30.0


def without_shaft(data: PointData) -> PointData:
    """The point with what turns with the shaft taken off, where the runs tell it; else its runs say what would."""
    first = data.runs[0].lines
    n = shaft_order(first.excitation[data.lines[0]].frequency, first.speed)
    name = f"{n}X on excitation line"
    if not n or not any(name in run.conditions for run in data.runs):
        return data
    s = np.array([run.shaft_phase[i] if len(run.shaft_phase) else np.nan for run, i in zip(data.runs, data.lines)])
    why = _unknown(n, s)
    if not why:
        means = [_mean(data, i) for i in range(len(data.runs))]
        why = _too_alike(means, s) if all(np.isfinite(m).all() for m in means) else "a run has no usable window"
    if why:
        return _saying(data, name, Condition(name, f"what turns with the shaft cannot be told from the motion: {why}"))
    z = np.array(means)
    scale = np.linalg.norm(z[:, :2])
    design = np.concatenate([z[:, :2] / scale, s[:, None]], axis=1)
    solution = np.linalg.lstsq(design, z[:, 2:], rcond=None)[0]
    r = -np.linalg.solve(solution[:2].T / scale, solution[2])
    text = f"{n}X as of {1e6 * np.linalg.norm(r):.3g} um of runout, by the shaft's phase in {len(s)} runs"
    # taken off the displacements: what the load does to H acts on the motion without it
    moved = data.D - s[data.run_index][:, None] * r
    return replace(_saying(data, name, Condition(_FITTED, text)), D=moved, shaft=s)


def without_synchronous(data: PointData) -> PointData:
    """Combinations of the runs, window by window, in which what turns with the shaft cancels.

    They are orthonormal, so the noise of their windows is that of the runs' own; there is one less of them than runs.
    """
    if data.shaft is None:
        return data
    rows = [_whole(data, i) for i in range(len(data.runs))]
    count = min(len(row) for row in rows)
    combine = np.linalg.svd(data.shaft[None, :])[2][1:].conj()
    picked = np.array([row[:count] for row in rows])

    def combined(z: ComplexArray) -> ComplexArray:
        return np.asarray(np.einsum("ji,iwk->jwk", combine, z[picked]).reshape(-1, 2))

    index = np.repeat(np.arange(len(combine)), count)
    runs = tuple(replace(run, direction=None) for run in data.runs[1:])
    return replace(
        data,
        runs=runs,
        lines=data.lines[1:],
        D=combined(data.D),
        F=combined(data.F),
        A=combined(data.A),
        run_index=index,
    )


def _unknown(n: int, s: ComplexArray) -> str:
    """Why the shaft's phase does not serve; "" where it does."""
    if not np.isfinite(s).all():
        if n == 1:
            return "no keyphasor tells the shaft's phase, or the drive is not locked to it. Record one"
        return "neither a keyphasor nor a steady 1X line tells the shaft's phase. Record a keyphasor"
    if len(s) < _MIN_RUNS:
        return f"{len(s)} runs; excite in {_MIN_RUNS} directions at least"
    return ""


def _too_alike(means: list[ComplexArray], s: ComplexArray) -> str:
    """Why the runs do not tell motion and shaft apart; "" where they do."""
    combine = np.linalg.svd(s[None, :])[2][1:].conj()
    condition = float(np.linalg.cond(combine @ np.array(means)[:, :2]))
    if condition < _ILL_CONDITIONED:
        return ""
    return (
        f"the runs' motions follow the shaft's phase alike (condition number {condition:.0f}). Repeat them with the "
        "drive half a turn later against the shaft, or with another amplitude, or in directions over the whole turn"
    )


def _saying(data: PointData, name: str, condition: Condition) -> PointData:
    """The point with another condition of its runs in the place of that one."""
    told = (tuple(condition if c == name else c for c in run.conditions) for run in data.runs)
    return replace(data, runs=tuple(replace(run, conditions=c) for run, c in zip(data.runs, told)))


def _whole(data: PointData, i: int) -> IntArray:
    return np.flatnonzero(data.whole & np.isfinite(data.A).all(axis=1) & (data.run_index == i))


def _mean(data: PointData, i: int) -> ComplexArray:
    mine = _whole(data, i)
    if not len(mine):
        return np.full(4, np.nan + 0j)
    return np.asarray(complex_median(np.concatenate([data.D[mine], data.F[mine]], axis=1)))
