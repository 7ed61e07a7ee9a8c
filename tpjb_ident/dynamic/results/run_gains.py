"""Runs of an operating point in which one probe or cell has another gain than in the others.

The search is that of `tpjb check`, `tpjb_ident.check.one_gain`; here it works on the phasors of all windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.campaign import Campaign
from rigdata.vector import inverse_directions
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.check.gain_evidence import PointReadings
from tpjb_ident.check.one_gain import wrong_gains
from tpjb_ident.check.run_gains import gain_in_words
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.line_means import complex_median
from tpjb_ident.dynamic.results.probes import SweptProbe
from tpjb_ident.dynamic.runs.point_data import PointData

#: Name of the condition.
RUN_GAIN_OFF = "run-gain-off"


@dataclass(frozen=True)
class Pairs:
    """The two probes and the two cells of a rig.

    Attributes
    ----------
    names : tuple of str
        Probes, then cells.
    probe_plane, cell_plane : (2, 2) ndarray
        From two readings to X and Y.
    centre : tuple of float or None
        What each probe reads at the bearing's centre [m].
    """

    names: tuple[str, ...]
    probe_plane: FloatArray
    cell_plane: FloatArray
    centre: tuple[float | None, float | None]


def channel_pairs(campaign: Campaign, sweeps: Sequence[SweptProbe] = ()) -> Pairs | None:
    """Probes and cells of a campaign; None where it has not two of each in different directions.

    Parameters
    ----------
    campaign : Campaign
    sweeps : sequence of SweptProbe
        Its probes in the clearance sweeps.
    """
    of = {q: [c for c in campaign.channels.values() if c.quantity == q] for q in ("displacement", "force")}
    if any(len(channels) != 2 for channels in of.values()):
        return None
    probe_plane, cell_plane = (
        inverse_directions(tuple(float(c.axis or 0.0) for c in channels)) for channels in of.values()
    )
    if not np.isfinite(probe_plane).all() or not np.isfinite(cell_plane).all():
        return None
    names = tuple(c.name for channels in of.values() for c in channels)
    first, second = (_centre(sweeps, name) for name in names[:2])
    return Pairs(names, probe_plane, cell_plane, (first, second))


def _centre(sweeps: Sequence[SweptProbe], probe: str) -> float | None:
    known = [sweep.centre for sweep in sweeps if sweep.name == probe and sweep.centre is not None]
    return float(np.median(known)) if known else None


def gain_doubts(data: PointData, pairs: Pairs | None) -> tuple[Condition, ...]:
    """A condition that names the runs of a point in which one channel has a gain of its own; none where there is none.

    Parameters
    ----------
    data : PointData
        Its windows as measured, nothing corrected.
    pairs : Pairs or None
        None says nothing.
    """
    if pairs is None:
        return ()
    medians = [_medians(data, k) for k in range(len(data.runs))]
    kept = [k for k, values in enumerate(medians) if all(np.isfinite(v).all() for v in values)]
    if not kept:
        return ()
    found = wrong_gains(_readings(data, [medians[k] for k in kept], kept, pairs))
    doubts = []
    for one in sorted(found, key=lambda f: f.run):
        names = [pairs.names[i] for i in one.channels]
        doubts.append(f"{data.runs[kept[one.run]].run}: {names[0]} {gain_in_words(one, names)}")
    return (Condition(RUN_GAIN_OFF, "; ".join(doubts)),) if doubts else ()


def _medians(data: PointData, k: int) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Displacement, cell force and oil force of one run, X and Y, medians over its windows; NaN where it has none."""
    mine = data.run_index == k
    run, line = data.runs[k], data.lines[k]
    blocks = (data.D[mine], run.cell_force.phasors[:, line], data.F[mine])
    good = np.logical_and.reduce([np.isfinite(block).all(axis=1) for block in blocks])
    if not good.any():
        nothing = np.full(2, np.nan + 0j)
        return nothing, nothing, nothing
    first, second, third = (complex_median(b[good]) for b in blocks)
    return first, second, third


def _readings(
    data: PointData,
    medians: Sequence[tuple[ComplexArray, ComplexArray, ComplexArray]],
    kept: Sequence[int],
    pairs: Pairs,
) -> PointReadings:
    displacement, cells, force = (np.stack([values[i] for values in medians]) for i in range(3))
    to_probes, to_cells = np.linalg.inv(pairs.probe_plane).T, np.linalg.inv(pairs.cell_plane).T
    return PointReadings(
        probes=displacement @ to_probes,
        cells=cells @ to_cells,
        inertia=force - cells,
        probe_means=data.mean_positions[list(kept)] @ to_probes,
        cell_means=data.mean_loads[list(kept)] @ to_cells,
        probe_plane=pairs.probe_plane,
        cell_plane=pairs.cell_plane,
        centre=pairs.centre,
    )
