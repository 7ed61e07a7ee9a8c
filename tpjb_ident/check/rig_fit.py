"""Sensors and housing of the dynamic runs held against one another, by the terms of identification.

The film is left free in every block: it takes two of its equations, and what remains is broken by no bearing. Planes of
probes tell one vector, a housing on springs moves against the cells' force, one that floats moves as the probes show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.campaign import Campaign
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import excited
from tpjb_ident.check.wiring import repairs
from tpjb_ident.estimate.blocks import Blocks, Rig, Sensor, stacked, vector
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.sensors import alive, axes_of, found_mount, sensors_of
from tpjb_ident.estimate.shape import free_force
from tpjb_ident.estimate.solve import Solution, Solver
from tpjb_ident.terms.axis import Axis
from tpjb_ident.terms.corner import Corner
from tpjb_ident.terms.delay import Delay
from tpjb_ident.terms.gain import Gain
from tpjb_ident.terms.housing import Housing
from tpjb_ident.terms.tilt import Tilt

#: Degrees of freedom of a line's noise, and blocks that the terms need, at least.
_FREEDOM, _MIN_BLOCKS = 60.0, 4
#: Share of a run's acceleration that is not as in the other runs, and how many times theirs, for it to be told.
_OFF, _MANY = 0.1, 6.0
#: A channel below this share of the largest of its quantity is dead, which is told elsewhere.
_DEAD = 1e-3
#: Accelerations below this many times their noise say nothing of one run.
_CLEAR = 30.0


@dataclass(frozen=True)
class RigFit:
    """What the terms make of a campaign's dynamic runs."""

    seen: tuple[Observation, ...] = field(repr=False)  #: of every block
    rig: Rig
    blocks: Blocks = field(repr=False)
    solution: Solution = field(repr=False)


def rig_fit(campaign: Campaign, runs: Sequence[Observation], static: bool = True) -> RigFit | None:
    """Fit the terms to all lines of dynamic runs; None where they are too few; `static`: cells show the static load."""
    clear = [o for o in runs if "force" not in o.report.doubts and excited(o)]
    lines = [(observation, omega, row) for observation in clear for omega, row in observation.phasors]
    if len(lines) < _MIN_BLOCKS:
        return None
    sensors = sensors_of(campaign)
    blocks = _blocks(sensors, lines)
    mass = float(np.nan_to_num(campaign.housing_mass))
    rig = Rig(sensors, mass, mount=found_mount(sensors, blocks, campaign.mount, 1.0), static=static)
    force = vector(rig, blocks, "force") + mass * np.nan_to_num(vector(rig, blocks, "acceleration"))
    shape, start = free_force(vector(rig, blocks, "displacement"), force)
    shape = replace(shape, scatter=replace(Scatter.none(len(blocks), len(blocks)), together=True))
    terms = [term(rig, blocks) for term in (Gain, Axis, Delay, Corner, Housing, Tilt)]
    if np.isfinite(start).all(axis=(1, 2)).sum() < _MIN_BLOCKS:
        return None
    solution = Solver(rig, blocks, terms, start, False, shape).run()
    return RigFit(tuple(observation for observation, _, _ in lines), rig, blocks, solution)


def _blocks(sensors: Sequence[Sensor], lines: Sequence[tuple[Observation, float, ComplexArray]]) -> Blocks:
    """A block a line, each of a point of its own, without a load: nothing of the film is shared."""
    rows: list[dict[str, object]] = []
    for b, (observation, omega, values) in enumerate(lines):
        floor = np.abs(values) if observation.lines is None else observation.lines.floor
        places = [_place(observation, sensor.name) for sensor in sensors]
        z = np.array([np.nan if k is None else values[k] for k in places], dtype=complex)
        noise = np.array([np.nan if k is None else floor[k] for k in places])
        present = np.isfinite(z) & np.isfinite(noise)
        rows.append(
            {
                "point": b,
                "run": b,
                "omega": omega,
                "z": np.where(present, z, 0.0),
                "present": present,
                "along": axes_of([None if k is None else observation.channels[k] for k in places]),
                "noise": np.diag(np.where(present, noise, 0.0) ** 2),
                "dof": _FREEDOM,
            }
        )
    points = [replace(observation.run.point, static_load=0.0) for observation, _, _ in lines]
    blocks = stacked(points, [observation.run.id for observation, _, _ in lines], len(sensors), rows)
    return replace(blocks, present=blocks.present & alive(sensors, np.abs(blocks.z).max(axis=0), _DEAD))


def _place(observation: Observation, name: str) -> int | None:
    return next((k for k, channel in enumerate(observation.channels) if channel.name == name), None)


def check_accelerometers(fit: RigFit) -> None:
    """Name the runs whose acceleration is not what springs, or the floating housing, make of it in the others."""
    rows = fit.rig.of("acceleration")
    housing = next((term for term in fit.solution.terms if isinstance(term, Housing)), None)
    if len(rows) != 2 or housing is None:
        return
    moved = housing.acceleration(fit.blocks, fit.solution.fitted[housing.name])
    foretold = np.einsum("nja,na->nj", fit.blocks.along[:, rows], moved)
    shown = fit.blocks.z[:, rows]
    size = np.linalg.norm(shown, axis=1)
    noise = np.sqrt(np.einsum("njj->n", fit.blocks.noise[:, rows][:, :, rows]).real)
    judged = np.flatnonzero(np.isfinite(foretold).all(axis=1) & (size > _CLEAR * noise))
    if len(judged) < _MIN_BLOCKS:
        return
    off = np.linalg.norm(shown - foretold, axis=1) / np.maximum(size, 1e-300)
    allowed = max(_OFF, _MANY * float(np.median(off[judged])))
    for b in judged[off[judged] > allowed]:
        _tell(fit.seen[b], shown[b], foretold[b])


def _tell(observation: Observation, shown: ComplexArray, foretold: ComplexArray) -> None:
    channels = observation.of("acceleration")
    tried = sorted((_misfit(matrix @ shown, foretold), words) for words, matrix in repairs(channels, scales=True))
    misfit = _misfit(shown, foretold)
    hint = f"; as if {tried[0][1]}" if tried[0][0] < min(misfit / 3, tried[1][0] / 2) else ""
    text = f"differs by {misfit:.0%} from what the housing's mount and the other runs foretell{hint}"
    cure = "Check polarity, cables and sensitivity of the accelerometers in this run"
    place = f"channels {' and '.join(channel.name for channel in channels)}"
    observation.report.say("housing", "warning", place, text, cure)


def _misfit(shown: ComplexArray, foretold: ComplexArray) -> float:
    return float(np.linalg.norm(shown - foretold) / np.linalg.norm(foretold))
