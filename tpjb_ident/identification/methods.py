"""Every method's answer on the windows of one operating point."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.estimate import estimate_table
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.estimators.rlm import RlmSettings
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.runs.point_data import PointData

#: Windows that a run needs, for its mean to be nearly free of each window's own noise.
_MIN_WINDOWS = 5
#: Smallest sine of the angle between two excitation directions that counts as two.
_MIN_SINE = 0.1


def own_method(method: str) -> str:
    """A method that needs no instruments, the one asked for if it is such."""
    return "mm-eiv" if method == "iv" else method.partition(":")[0]


def all_methods(
    data: PointData,
    settings: IdentifySettings,
    solved: dict[str, DynamicStiffness],
    reference: DynamicStiffness | None,
) -> dict[str, DynamicStiffness]:
    """Every method that was asked for and applies, the default one in any case; those of `solved` are there already.

    `known`: the solve of the campaign, whose scatter is that of all methods.
    """
    drive = _nominal_drive(data)
    table = phasor_table(data.D, data.F, data.run_index, drive)
    estimates: dict[str, DynamicStiffness] = {}
    for name in dict.fromkeys((*settings.methods, settings.method)):
        method, _, norm = name.partition(":")
        if name in solved:
            estimates[name] = solved[name]
        elif method != "iv" or drive is not None or settings.method == "iv":
            estimates[name] = estimate_table(table, data.omega, method, RlmSettings(norm or "huber"), reference)
    return estimates


def disagreement(by_method: dict[str, DynamicStiffness], default: str) -> tuple[Condition, ...]:
    """Say which methods differ from the default beyond both intervals."""
    best = by_method[default]
    conditions = []
    for name, estimate in by_method.items():
        if name == default or not (np.isfinite(estimate.h).all() and np.isfinite(best.h).all()):
            continue
        gap = np.abs(estimate.vector - best.vector)
        room = np.hypot(estimate.half_width(systematic=False), best.half_width(systematic=False))
        if (gap > room).any():
            worst = int(np.argmax(gap / room))
            conditions.append(f"{name} ({gap[worst] / room[worst]:.1f} times the interval)")
    if not conditions:
        return ()
    return (Condition("methods-disagree", f"{', '.join(conditions)} away from {default}"),)


def _nominal_drive(data: PointData) -> ComplexArray | None:
    """Instruments (n, 2) [N] of one point's windows; None where the campaign cannot give them.

    The format has no channel for the actuators' command. But every run states the direction of its excitation, and the
    part of its own mean force along that direction has the size and phase of the command: averaged over the run's
    windows it knows next to nothing of a single window's noise, and nothing of the displacements' noise.
    """
    angles = [run.direction for run in data.runs]
    stated_angles = np.array([a for a in angles if a is not None])
    if (
        len(stated_angles) < len(angles)
        or len(stated_angles) < 2
        or np.abs(np.sin(stated_angles - stated_angles[0])).max() < _MIN_SINE
    ):
        return None
    result = np.full(data.F.shape, np.nan + 0j)
    for i, angle in enumerate(stated_angles):
        selected = data.run_index == i
        along = data.F[selected] @ np.array([np.cos(angle), np.sin(angle)])
        along = along[np.isfinite(along)]
        if len(along) < _MIN_WINDOWS:
            return None
        drive = np.median(along.real) + 1j * np.median(along.imag)
        result[selected] = drive * np.array([np.cos(angle), np.sin(angle)])
    return result
