"""Tell the dynamic runs in which one probe or cell has another gain than in the other runs of its operating point."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from tpjb_ident.check.agreement import RunResponse
from tpjb_ident.check.findings import RUN_GAIN
from tpjb_ident.check.gain_evidence import PointReadings
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.one_gain import WrongGain, wrong_gains
from tpjb_ident.check.set_points import plane_of, to_plane

#: Median of the amplitude of a noise line, in standard deviations of its real part (Rayleigh).
_MEDIAN = math.sqrt(2 * math.log(2))
#: Sectors into which the directions of a sweep's load are sorted, and share of them that must be met.
_SECTORS, _MET = 36, 0.9


def check_gains(group: Sequence[RunResponse], known_outliers: Collection[int], readings: PointReadings) -> None:
    """Name runs with one wrong gain."""
    for gain in wrong_gains(readings, known_outliers):
        _tell(group[gain.run], gain, [group[0].names[i] for i in gain.channels])


def point_readings(group: Sequence[RunResponse], centres: dict[str, float]) -> PointReadings | None:
    """Phasors and means of all runs of a point, by channel.

    None where they have not the same two cells, or no means.
    """
    probes, observations = group[0].channels, [a.seen for a in group]
    cells = _cells(observations[0])
    names = [c.name for c in cells]
    lines = [observation.lines for observation in observations if observation.lines is not None]
    if (
        len(names) != 2
        or len(lines) < len(group)
        or any([c.name for c in _cells(observation)] != names for observation in observations)
    ):
        return None
    places = [(observation.pick("displacement"), observation.pick("force")) for observation in observations]
    cell_plane, cell_phasors = plane_of(cells), np.stack([f.phasor[c] for f, (_, c) in zip(lines, places, strict=True)])
    return PointReadings(
        probes=np.stack([a.readings for a in group]),
        cells=cell_phasors,
        inertia=np.stack([a.force for a in group]) - cell_phasors @ cell_plane.T,
        probe_means=np.stack([f.mean[p] for f, (p, _) in zip(lines, places, strict=True)]),
        cell_means=np.stack([f.mean[c] for f, (_, c) in zip(lines, places, strict=True)]),
        probe_plane=plane_of(probes),
        cell_plane=cell_plane,
        centre=(centres.get(probes[0].name), centres.get(probes[1].name)),
        noise=np.stack([np.concatenate([f.floor[p], f.floor[c]]) for f, (p, c) in zip(lines, places, strict=True)])
        / _MEDIAN,
    )


def _cells(observation: Observation) -> list[Channel]:
    return [observation.channels[i] for i in observation.pick("force")]


def probe_centres(sweeps: Sequence[Observation]) -> dict[str, float]:
    """What every probe reads at the bearing's centre [m], from clearance runs whose load goes around."""
    table: dict[str, list[float]] = {}
    for observation in sweeps:
        cells, probes = observation.pick("force"), observation.pick("displacement")
        if (
            len(cells) != 2
            or not probes
            or "force" in observation.report.doubts
            or "displacement" in observation.report.doubts
        ):
            continue
        load = to_plane([observation.channels[i] for i in cells], observation.samples[:, cells].T).T
        for index in probes:
            centre = swept_centre(load, observation.samples[:, index])
            if centre is not None:
                table.setdefault(observation.channels[index].name, []).append(centre)
    return {name: float(np.median(values)) for name, values in table.items()}


def swept_centre(load: FloatArray, reading: FloatArray) -> float | None:
    """Mean of a probe's readings (n,) over all directions of a sweeping load (n, 2); None where it does not go around.

    Sides and corners of the clearance polygon lie evenly around the centre.
    """
    finite = np.isfinite(load).all(axis=1) & np.isfinite(reading)
    if not finite.any():
        return None
    across = load[finite] - np.median(load[finite], axis=0)
    turn = np.arctan2(across[:, 1], across[:, 0]) / (2 * math.pi) + 0.5
    sector = np.floor(turn * _SECTORS) % _SECTORS
    middles = [float(np.median(reading[finite][sector == s])) for s in range(_SECTORS) if np.any(sector == s)]
    return float(np.mean(middles)) if len(middles) >= _MET * _SECTORS else None


def _tell(response: RunResponse, found: WrongGain, names: Sequence[str]) -> None:
    cure = "Check this channel's amplifier, range and cable in this run; leave it out or repeat it"
    response.seen.report.say(
        f"{RUN_GAIN}{names[0]}", "warning", f"channel {names[0]}", gain_in_words(found, names), cure
    )


def gain_in_words(gain: WrongGain, names: Sequence[str]) -> str:
    """What a wrong gain looks like; `names` are those of its channels, the likeliest first."""
    off = gain.gain - 1
    others = f" (or {' or '.join(names[1:])} another gain)" if len(names) > 1 else ""
    by = "phasor and mean say so" if gain.means else "its phasor says so, its mean cannot"
    return (
        f"reads {abs(off):.1%} too {'much' if off > 0 else 'little'} (standard error {gain.error:.1%}) beside the "
        f"other runs at this operating point{others}; {by}"
    )
