"""Rigs with clearance sweeps, and runs that are those of a campaign but for one thing."""

from dataclasses import replace

import numpy as np

from rigdata.virtual_rig import ClearanceSweep, Instruments, Noise, RigPlan, RigTruth, VirtualRig

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
CLEARANCE = np.array([80.0, 80.0, 86.0, 80.0, 80.0]) * 1e-6
SWEEP = RigPlan(clearance=(ClearanceSweep(),))


def sphere(pad, load):
    """Deflection of every pivot [m]."""
    return 6e-8 * np.asarray(load, dtype=float) ** (2 / 3)


def rig(plan=SWEEP, clearance=tuple(CLEARANCE), seed=4, **changes):
    """A bearing on spherical pivots."""
    truth = RigTruth.constant(
        np.diag([2e8, 4e8]), np.diag([4e5, 6e5]), pivot_deflection=sphere, clearance=tuple(clearance)
    )
    given = {"truth": truth, "instruments": Instruments.like_paper(seed=4), "noise": Noise.like_samples()}
    return VirtualRig(plan=plan, seed=seed, **(given | changes))


def bearing_centre(rig):
    """Reading of the bearing centre (2,) [m] from the gap voltages."""
    gaps = np.array([rig.instruments.gap_voltages()[name] for name in ("X1A", "X1B")])
    axes = np.radians([45.0, 135.0])
    return np.linalg.solve(np.column_stack([np.cos(axes), np.sin(axes)]), -gaps / 7780.0)


class OtherRun:
    """A run of a campaign with `told` in place of its own attributes; `moved` adds to its displacement, of the time."""

    def __init__(self, run, moved=lambda time: 0.0, **told):
        self._run, self._moved = run, moved
        self.__dict__.update(told)

    def __getattr__(self, name):
        return getattr(self._run, name)

    def vector(self, quantity):
        vector = self._run.vector(quantity)
        return (
            replace(vector, values=vector.values + self._moved(vector.time)) if quantity == "displacement" else vector
        )
