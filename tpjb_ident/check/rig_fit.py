"""Sensors and housing of the dynamic runs held against one another, by the terms of identification.

The film is left free in every block: it takes two of its equations, and what remains is broken by no bearing. Planes of
probes tell one vector, a housing on springs moves against the cells' force, one that floats moves as the probes show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.check.findings import explanation, far, repairs
from tpjb_ident.check.observation import Observation
from tpjb_ident.estimate.arrowhead import free_force
from tpjb_ident.estimate.equation import (
    Blocks,
    Sensor,
    alive,
    axes_of,
    campaign_rig,
    film_force,
    mounted,
    stacked,
    vector,
)
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.phasors.run_data import by_channel
from tpjb_ident.terms.housing import Housing
from tpjb_ident.terms.registry import solve, solved_as_learnt

#: Degrees of freedom of a line's noise, and blocks that the terms need, at least.
_FREEDOM, _MIN_BLOCKS = 60.0, 4
#: Share of a run's acceleration that is not as in the other runs, and how many times theirs, for it to be told.
_OFF, _MANY = 0.1, 6.0
#: A channel below this share of the largest of its quantity is dead, which is told elsewhere.
_DEAD = 1e-3
#: Accelerations below this many times their noise say nothing of one run.
_CLEAR = 30.0


def rig_fit(campaign: Campaign, runs: Sequence[Observation], static: bool = True) -> Solution | None:
    """Fit the terms to all lines of dynamic runs, and name the runs whose accelerometers differ from the others.

    None where the lines are too few; `static`: cells show the static load.
    """
    clear = [run for run in runs if not run.report.cells_doubted and run.shows("force")]
    observations = []
    for run in clear:
        observations += [run] * len(run.lines.omega)
    if len(observations) < _MIN_BLOCKS:
        return None
    rig = campaign_rig(campaign)
    blocks = _blocks(rig.channels, clear)
    rig = mounted(rig, blocks, campaign.mount, float(static))
    shape, start = free_force(vector(rig, blocks, "displacement"), film_force(rig, blocks))
    if np.isfinite(start).all(axis=(1, 2)).sum() < _MIN_BLOCKS:
        return None
    shape = replace(shape, scatter=replace(Scatter.none(len(blocks), len(blocks)), together=True))
    solution = solved_as_learnt(rig, lambda rig: solve(rig, blocks, start, shape))
    _check_accelerometers(observations, solution)
    return solution


def _blocks(sensors: Sequence[Sensor], runs: Sequence[Observation]) -> Blocks:
    """A block a line, each of a point of its own, without a load: nothing of the film is shared."""
    rows: list[dict[str, object]] = []
    points, names = [], []
    for observation in runs:
        channels = {channel.name: channel for channel in observation.channels}
        along = axes_of([channels.get(sensor.name) for sensor in sensors])
        floor = by_channel(observation.lines.floor, observation.channels, sensors)
        phasors = by_channel(observation.lines.rows, observation.channels, sensors)
        for omega, z in zip(observation.lines.omega, phasors):
            present = np.isfinite(z) & np.isfinite(floor)
            row = {"point": len(rows), "run": len(rows), "omega": omega, "present": present, "along": along}
            noise = np.diag(np.nan_to_num(floor) ** 2)
            rows.append(row | {"z": np.where(present, z, 0.0), "noise": noise, "dof": _FREEDOM})
            points.append(replace(observation.run.point, static_load=0.0))
            names.append(observation.run.id)
    blocks = stacked(points, names, len(sensors), rows)
    return replace(blocks, present=blocks.present & alive(sensors, np.abs(blocks.z).max(axis=0), _DEAD))


def _check_accelerometers(observations: Sequence[Observation], solution: Solution) -> None:
    """Name the runs whose acceleration is not what springs, or the floating housing, make of it in the others."""
    rig, blocks = solution.rig, solution.blocks
    housing = next((term for term in solution.terms if isinstance(term, Housing)), None)
    rows = rig.pick("acceleration")
    if len(rows) != 2 or housing is None or housing.is_on_foundation(solution.fitted[housing.name]):
        return
    moved = housing.acceleration(blocks, solution.fitted[housing.name])
    shown = vector(rig, blocks, "acceleration")
    noise = np.sqrt(blocks.noise_power(rows))
    judged = np.flatnonzero(np.isfinite(moved).all(axis=1) & (np.linalg.norm(shown, axis=1) > _CLEAR * noise))
    for b in judged[far(_off(shown, moved)[judged], _OFF, _MANY, _MIN_BLOCKS)]:
        _report(observations[b], shown[b], moved[b])


def _report(observation: Observation, shown: ComplexArray, expected: ComplexArray) -> None:
    def misfit(repair: FloatArray) -> float:
        return float(_off(repair @ shown, expected))

    size = misfit(np.eye(2))
    hint = explanation(repairs(observation.of("acceleration"), scales=True), misfit, size / 3)
    observation.report.ask("housing", size, *observation.names("acceleration"), hint=hint)


def _off(shown: ComplexArray, expected: ComplexArray) -> FloatArray:
    """Distance of vectors (.., 2) from what is expected, as a share of that."""
    distance = np.linalg.norm(shown - expected, axis=-1)
    return distance / np.maximum(np.linalg.norm(expected, axis=-1), 1e-300)
