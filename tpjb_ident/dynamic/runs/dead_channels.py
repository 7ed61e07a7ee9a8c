"""Channels that read one value throughout a dynamic run.

A dead cell or accelerometer leaves phasors that look like any other: of the vector, not of the channel. Turned back to
the channels' axes they vanish. Only then is the run read once more and held against the rules of
`rigdata.check_campaign`, which know a computed record without noise from a dead sensor.
"""

from __future__ import annotations

import numpy as np

from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.records.run_data import RunPhasors
from tpjb_ident.dynamic.runs.left_out import DEAD_ACCELEROMETER

#: A channel whose lines are below this share of the vector's may be dead.
NOTHING = 1e-6
#: The same of its mean: what rounding leaves of a constant.
ROUNDING = 1e-10


def dead_accelerometers(run: Run, phasors: RunPhasors) -> tuple[Condition, ...]:
    """Refuse a run with a dead probe or cell; tell of a dead accelerometer.

    Parameters
    ----------
    run : rigdata.run.Run
        What only looks like one is not judged.
    phasors : RunPhasors
        Of the run.

    Returns
    -------
    tuple of Condition
        `DEAD_ACCELEROMETER` where one is dead. Whether the run can be used without it the other runs must tell.

    Raises
    ------
    RigDataError
        A displacement or force channel is dead.
    """
    found = _dead(run, phasors)
    grave = [p for name, p in found.items() if run.channels[name].quantity != "acceleration"]
    if grave:
        raise RigDataError(grave)
    return tuple(Condition(DEAD_ACCELEROMETER, f"{p.place} of {run.id} {p.what}") for p in found.values())


def _dead(run: Run, phasors: RunPhasors) -> dict[str, Problem]:
    blocks = {"displacement": phasors.displacement, "force": phasors.cell_force, "acceleration": phasors.acceleration}
    silent = [
        name
        for name, channel in run.channels.items()
        if channel.axis is not None and (block := blocks.get(channel.quantity)) is not None
        if _silent(block, channel.axis)
    ]
    if not silent:
        return {}
    errors = {f.key: f.problem for f in observe(run).report.found if f.problem.severity == "error"}
    return {name: errors[f"dead {name}"] for name in silent if f"dead {name}" in errors}


def _silent(block: PhasorBlock, axis: float) -> bool:
    """Whether no window shows any line along an axis; False where no window shows anything at all."""
    known = np.isfinite(block.phasors).all(axis=(1, 2))
    if not known.any():
        return False
    vector, mean = block.phasors[known], block.mean[known]
    along = np.array([np.cos(axis), np.sin(axis)])
    size = float(np.abs(vector @ along).max())
    return size <= max(NOTHING * float(np.abs(vector).max()), ROUNDING * float(np.abs(mean).max()))
