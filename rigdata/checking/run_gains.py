"""Tell the dynamic runs in which one probe or cell has another gain than in the other runs of its operating point."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from rigdata.calibration import Channel
from rigdata.checking.answers import Answer
from rigdata.checking.gain_evidence import PointReadings
from rigdata.checking.observation import Observation
from rigdata.checking.one_gain import WrongGain, wrong_gains
from rigdata.checking.set_points import to_plane

FloatArray = NDArray[np.float64]
#: Sectors into which the directions of a sweep's load are sorted, and share of them that must be met.
_SECTORS, _MET = 36, 0.9


def check_gains(group: Sequence[Answer], told: Collection[int], centres: dict[str, float]) -> None:
    """Name runs with one wrong gain.

    Parameters
    ----------
    group : sequence of Answer
        Runs of one operating point, with the same displacement channels.
    told : collection of int
        Places of those already told to differ.
    centres : dict
        What probes read at the bearing's centre, by channel [m].
    """
    cells = [[a.seen.channels[i] for i in a.seen.pick("force")] for a in group]
    names = [c.name for c in cells[0]]
    if len(names) != 2 or any([c.name for c in other] != names for other in cells):
        return
    readings = point_readings(group, cells[0])
    if not all(np.all(np.isfinite(values)) for values in (readings.probe_means, readings.cell_means)):
        return
    channels = [*group[0].channels, *cells[0]]
    for found in wrong_gains(readings, [centres.get(c.name) for c in channels[:2]], told):
        _tell(group[found.run], found, [channels[i].name for i in found.channels])


def point_readings(group: Sequence[Answer], cells: Sequence[Channel]) -> PointReadings:
    """Phasors and means of all runs of a point, by channel."""
    probes = group[0].channels
    places = [(a.seen.pick("displacement"), a.seen.pick("force")) for a in group]
    means = [a.seen.lines.mean for a in group if a.seen.lines is not None]
    phasors = [a.seen.lines.phasor for a in group if a.seen.lines is not None]
    cell_plane = _plane(cells)
    cell_phasors = np.stack([p[w] for p, (_, w) in zip(phasors, places, strict=True)])
    return PointReadings(
        probes=np.stack([a.readings for a in group]),
        cells=cell_phasors,
        inertia=np.stack([a.force for a in group]) - cell_phasors @ cell_plane.T,
        probe_means=np.stack([m[w] for m, (w, _) in zip(means, places, strict=True)]),
        cell_means=np.stack([m[w] for m, (_, w) in zip(means, places, strict=True)]),
        probe_plane=_plane(probes),
        cell_plane=cell_plane,
    )


def _plane(channels: Sequence[Channel]) -> FloatArray:
    """From two readings to X and Y, (2, 2)."""
    return np.stack([to_plane(channels, unit) for unit in np.eye(2)], axis=1)


def probe_centres(sweeps: Sequence[Observation]) -> dict[str, float]:
    """What every probe reads at the bearing's centre [m]: mean over all directions of a clearance run's load.

    Sides and corners of the polygon lie evenly around the centre. Runs whose load does not go around tell nothing.
    """
    found: dict[str, list[float]] = {}
    for seen in sweeps:
        cells, probes = seen.pick("force"), seen.pick("displacement")
        if len(cells) != 2 or not probes or "force" in seen.report.doubts or "displacement" in seen.report.doubts:
            continue
        load = to_plane([seen.channels[i] for i in cells], seen.samples[:, cells].T)
        angle = np.arctan2(load[1] - np.median(load[1]), load[0] - np.median(load[0]))
        sector = np.floor((angle / (2 * math.pi) + 0.5) * _SECTORS) % _SECTORS
        for index in probes:
            known = np.isfinite(seen.samples[:, index]) & np.isfinite(sector)
            values, where = seen.samples[known, index], sector[known]
            middles = [float(np.median(values[where == s])) for s in range(_SECTORS) if np.any(where == s)]
            if len(middles) >= _MET * _SECTORS:
                found.setdefault(seen.channels[index].name, []).append(float(np.mean(middles)))
    return {name: float(np.median(values)) for name, values in found.items()}


def _tell(answer: Answer, found: WrongGain, names: Sequence[str]) -> None:
    off = found.gain - 1
    others = f" (or {' or '.join(names[1:])} another gain)" if len(names) > 1 else ""
    by = "phasor and mean say so" if found.means else "its phasor says so, its mean cannot"
    what = (
        f"reads {abs(off):.1%} too {'much' if off > 0 else 'little'} (standard error {found.error:.1%}) beside the "
        f"other runs at this operating point{others}; {by}"
    )
    cure = "Check this channel's amplifier, range and cable in this run; leave it out or repeat it"
    answer.seen.report.say(f"gain {names[0]}", "warning", f"channel {names[0]}", what, cure)
