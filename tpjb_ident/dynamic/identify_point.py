"""One operating point: its windows to an estimate by every method, with figures and flags."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.estimators.estimate import REJECTED_WEIGHT, estimate_table
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.dynamic.estimators.rlm import RlmSettings
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.amplitude import AmplitudeSlope, amplitude_slope
from tpjb_ident.dynamic.results.point_result import PointResult, WindowVerdict
from tpjb_ident.dynamic.results.quality import (
    amplitude,
    coherence,
    directional_pattern,
    disagreeing_runs,
    flags,
    rejected_windows,
)
from tpjb_ident.dynamic.runs.point_data import PointData, pad_means
from tpjb_ident.dynamic.settings import IdentifySettings

#: Windows that a run needs, for its mean to be nearly free of each window's own noise.
_MIN_WINDOWS = 5
#: Smallest sine of the angle between two excitation directions that counts as two.
_MIN_SINE = 0.1


def first_estimate(data: PointData, settings: IdentifySettings) -> DynamicStiffness:
    """Estimate before any correction, for how H changes with load and how runs scatter; its weights are not needed."""
    estimate = estimate_table(phasor_table(data.D, data.F, data.run_index), data.omega, own_method(settings.method))
    return replace(estimate, weights=np.empty((0, 2)))


def own_method(method: str) -> str:
    """A method that needs no instruments, the one asked for if it is such."""
    return "mm-eiv" if method == "iv" else method.partition(":")[0]


@dataclass(frozen=True)
class Figures:
    """What the windows of a point say before its uncertainties are known."""

    by_method: dict[str, DynamicStiffness]
    outlier_fraction: float
    coherence: float
    amplitude: float
    linearity: AmplitudeSlope | None
    conditions: tuple[Condition, ...]
    rejected: tuple[WindowVerdict, ...]


@dataclass(frozen=True)
class Completion:
    """What corrections and systematic sources add: the estimates with their uncertainty, and what to say of them."""

    by_method: dict[str, DynamicStiffness]
    conditions: tuple[Condition, ...] = ()
    load_miss: LoadMiss | None = None
    budget: dict[str, FloatArray] = field(default_factory=dict)


def point_figures(data: PointData, settings: IdentifySettings, differ: bool, known: float = 0.0) -> Figures:
    """Every method's answer on the windows of a point, and what is said of the default one."""
    by_method = _all_methods(data, settings, differ)
    best = by_method[settings.method]
    weights = best.weights.min(axis=1)
    figure = coherence(data.D, data.F, best.h, weights)
    size = amplitude(data, weights)
    linearity = amplitude_slope(data, best.h, weights)
    patterns = (directional_pattern(data, weights), disagreeing_runs(data, best.h, weights, known))
    conditions = merged(
        *(run.conditions for run in data.runs),
        best.status,
        flags(data, best, figure),
        tuple(pattern for pattern in patterns if pattern is not None),
        () if linearity is None else linearity.condition(),
        disagreement(by_method, settings.method),
    )
    rejected = rejected_windows(data, best.h, weights)
    share = float((weights < REJECTED_WEIGHT).mean())
    return Figures(by_method, share, figure, size, linearity, conditions, rejected)


def point_result(
    data: PointData,
    figures: Figures,
    completion: Completion,
    temperatures: dict[str, dict[int, float]],
    settings: IdentifySettings,
) -> PointResult:
    """The point, made once, with everything that is known of it."""
    positions = data.mean_positions
    return PointResult(
        point=data.point,
        stiffness=completion.by_method[settings.method],
        by_method=completion.by_method,
        static_load_measured=float(np.linalg.norm(data.mean_loads.mean(axis=0))),
        position=positions.mean(axis=0),
        position_se=positions.std(axis=0, ddof=1) / np.sqrt(len(positions))
        if len(positions) > 1
        else np.full(2, np.nan),
        temperatures=pad_means([temperatures.get(run.run, {}) for run in data.runs]),
        n_records=len(data.runs),
        n_windows=len(data.D),
        outlier_fraction=figures.outlier_fraction,
        coherence=figures.coherence,
        amplitude=figures.amplitude,
        quality=merged(figures.conditions, completion.conditions),
        rejected=figures.rejected,
        runs=tuple(run.run for run in data.runs),
        load_miss=completion.load_miss,
        linearity=figures.linearity,
        inertia_corrected=data.runs[0].acceleration is not None,
        clearance=settings.clearance,
        budget=completion.budget,
    )


def _all_methods(data: PointData, settings: IdentifySettings, differ: bool) -> dict[str, DynamicStiffness]:
    """Every method that was asked for and applies, the default one in any case."""
    drive = _nominal_drive(data)
    table = phasor_table(data.D, data.F, data.run_index, drive)
    table = replace(table, directions_differ=differ)
    estimates: dict[str, DynamicStiffness] = {}
    for name in dict.fromkeys((*settings.methods, settings.method)):
        method, _, norm = name.partition(":")
        if method != "iv" or drive is not None or settings.method == "iv":
            estimates[name] = estimate_table(table, data.omega, method, RlmSettings(norm or "huber"))
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
