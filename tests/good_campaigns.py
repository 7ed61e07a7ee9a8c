"""Good campaigns of the virtual rig, for tests and benchmarks that spoil, kill, fill or repeat something.

Two linear bearings: `stiff_rig` for what is judged by `check` (five pads from no bearing file), `rocker_rig` for whole
commands (the rocker bearing file, three temperatures). Everything random hangs on the seed.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.virtual_rig import (
    ClearanceSweep,
    DryTest,
    Fault,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    Timing,
    VirtualRig,
    locus_points,
    operating_points,
    write_campaign,
)

BEARINGS = Path(__file__).resolve().parents[1] / "model" / "bearings"
STIFFNESS = np.array([[3.0e8, 0.2e8], [-0.3e8, 4.5e8]])
DAMPING = np.array([[5e5, 2e4], [1e4, 7e5]])
#: Of the rig with the rocker bearing file.
ROCKER_STIFFNESS = np.array([[1.0e8, 2e6], [1e6, 2.0e8]])
ROCKER_DAMPING = np.array([[5e5, 1e4], [1e4, 7e5]])


def directions(count: int) -> tuple[float, ...]:
    """Directions of excitation, evenly over half a turn [rad]."""
    return tuple(math.radians(180.0 / count * i) for i in range(count))


#: One operating point in six directions, and one or some of every other kind of run.
PLAN = RigPlan(
    dynamic=operating_points([(5000.0, 25.0)]),
    directions=directions(6),
    locus=locus_points(6),
    dry=tuple(DryTest(p, levels=(1000.0, 3000.0), hold=0.3) for p in range(1, 6)),
    clearance=(ClearanceSweep(seconds=6.0),),
    timing=Timing(locus_seconds=1.0),
)
#: The dynamic run of `PLAN` that faults strike.
RUN = "d-05000-25-03"
#: A little of everything, for whole commands.
SMALL_PLAN = RigPlan(
    dynamic=operating_points([(5000.0, 25.0)]),
    directions=directions(3),
    locus=locus_points(3, load=1000.0),
    dry=tuple(DryTest(p, levels=(500.0, 1000.0, 2000.0, 3000.0), hold=0.3) for p in range(1, 6)),
    clearance=(ClearanceSweep(seconds=6.0),),
    timing=Timing(dynamic_seconds=1.0),
)


def stiff_rig(seed: int, *faults: Fault, plan: RigPlan = PLAN, noise: Noise | None = None, **truth: Any) -> VirtualRig:
    """A rig for `check`; `truth` are arguments of `RigTruth.constant` besides, or in place of, K and C."""
    made = RigTruth.constant(**{"k": STIFFNESS, "c": DAMPING, **truth})
    return VirtualRig(made, plan, noise=noise or Noise.like_samples(), faults=faults, seed=seed)


def rocker_rig(seed: int, *faults: Fault, plan: RigPlan = SMALL_PLAN, **names: str) -> VirtualRig:
    """A rig that carries the rocker bearing's file; `names` are `campaign` and `description`."""
    text = (BEARINGS / "rocker.toml").read_text("utf-8")
    truth = RigTruth.constant(ROCKER_STIFFNESS, ROCKER_DAMPING, bearing_name="rocker.toml", bearing_text=text)
    instruments = Instruments.like_paper(5, 3)
    return VirtualRig(truth, plan, instruments, Noise.like_samples(), faults=faults, seed=seed, **names)


def written(path: Path, rig: VirtualRig, layout: str = "hdf5") -> Path:
    """Write a rig's campaign; its path."""
    write_campaign(path, rig, layout)
    return path


def once(path: Path, write: Callable[[Path], object], patience: float = 120.0) -> Path:
    """Let one of several workers write `path`, the others wait for it; after `patience` [s] one that waits writes."""
    lock = path.with_name(f"{path.name}.lock")
    began = time.monotonic()
    while not path.exists():
        try:
            os.close(os.open(lock, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            if time.monotonic() - began < patience:
                time.sleep(0.05)
                continue
        made = path.with_name(f"{os.getpid()}-{path.name}")
        write(made)
        made.replace(path)
    return path
