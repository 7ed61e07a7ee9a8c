"""What a campaign says about one operating point, and the figures and flags that say how far it can be trusted."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import bdtrc

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.vector import directions
from tpjb_ident.columns import place_of
from tpjb_ident.conditions import Conditions, holding, merged
from tpjb_ident.estimators.estimate import MIN_COHERENCE, REJECTED_WEIGHT
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.results.linearity import AmplitudeSlope
from tpjb_ident.runs.point_data import PointData, RunsOfPoint, pad_means
from tpjb_ident.terms.housing import HARMLESS, SOFT


@dataclass(frozen=True)
class WindowVerdict:
    """One window that lost its weight."""

    run: str
    time: float
    weight: float
    direction: float
    reason: str


@dataclass(frozen=True)
class PointResult:
    """Dynamic stiffness of one operating point.

    Attributes
    ----------
    point : OperatingPoint
        Set points.
    stiffness : DynamicStiffness
        By the default method.
    by_method : dict of str to DynamicStiffness
    static_load_measured : float
        Mean load that the cells show [N].
    position, position_se : (2,) ndarray
        Mean displacement (from the probes' zero) over the runs and its standard error [m].
    temperatures : dict of int to float
        Mean film temperature per pad [K].
    n_records, n_windows : int
    outlier_fraction : float
        Share of windows with (nearly) no weight.
    coherence : float
        Smaller of the two force axes' multiple coherences with the displacements.
    amplitude : float
        Largest displacement amplitude of a direction [m].
    quality : tuple of Condition
        Everything that a reader of the numbers should know; empty when all is well.
    rejected : tuple of WindowVerdict
    runs : tuple of str
    load_miss : (n_runs,) complex ndarray or None
        How far each run's static load was off: relative size + i turn [rad].
    linearity : AmplitudeSlope
        Change of h with amplitude, where directions were run at several; NaN where not.
    inertia_corrected : bool
        Whether the housing's inertia was added to the cells' force.
    clearance : float or None
        Assembled clearance, where the campaign carries a bearing [m].
    budget : dict of str to (8, 8) ndarray
        Covariance of the default method's H by source [N^2/m^2]; the interval is their sum.
    scattering : tuple of str
        Sources that scatter from run to run; all others are common to the runs.
    """

    point: OperatingPoint
    stiffness: DynamicStiffness
    by_method: dict[str, DynamicStiffness]
    static_load_measured: float
    position: FloatArray
    position_se: FloatArray
    temperatures: dict[int, float]
    n_records: int
    n_windows: int
    outlier_fraction: float
    coherence: float
    amplitude: float
    quality: Conditions
    rejected: tuple[WindowVerdict, ...]
    runs: tuple[str, ...]
    load_miss: ComplexArray | None = None
    linearity: AmplitudeSlope = field(default_factory=AmplitudeSlope)
    inertia_corrected: bool = False
    clearance: float | None = None
    budget: dict[str, FloatArray] = field(default_factory=dict)
    scattering: tuple[str, ...] = ("random", "load miss", "load direction", "mains")

    def __str__(self) -> str:
        flags = f" ({', '.join(str(q) for q in self.quality)})" if self.quality else ""
        place = place_of(self.point.static_load, self.point.excitation_hz)
        return f"{place}: {self.stiffness.direct_coefficients()}{flags}"

    def __repr__(self) -> str:
        return f"<PointResult: {self}>"


def by_static_point(points: Sequence[PointResult]) -> list[list[int]]:
    """Places of the points that have a stiffness, those of one load and speed together."""
    groups = defaultdict(list)
    for i, p in enumerate(points):
        if np.isfinite(p.stiffness.h).all():
            groups[p.point.static_key].append(i)
    return list(groups.values())


def quality_cell(conditions: Sequence[str]) -> str:
    """Names for a cell of a column ``quality``."""
    return "; ".join(conditions) or "ok"


def of_runs(recorded: RunsOfPoint) -> dict[str, Any]:
    """What a point's result has of its runs, by name."""
    positions, runs = recorded.mean_positions, len(recorded.names)
    error = positions.std(axis=0, ddof=1) / np.sqrt(runs) if runs > 1 else np.full(2, np.nan)
    return {
        "static_load_measured": float(np.abs(recorded.mean_loads.mean())),
        "position": positions.mean(axis=0),
        "position_se": error,
        "temperatures": pad_means([run.temperatures for run in recorded.runs]),
        "n_records": runs,
        "runs": recorded.names,
        "inertia_corrected": not recorded.inertia,
    }


#: Share of the windows without phasors beyond which what is left may not stand for the record.
_MAX_LOST = 0.6
#: Share of the force by which runs may differ: beyond it they have no H in common.
_MAX_DISAGREEMENT = 0.06
#: Antisymmetric part of the damping over its trace, beyond the interval, that films do not have (0.02 in 340 good
#: campaigns of bearings; seals with inertia have 0.2), from which axes are wrong by 12 deg; how alike stiffness is.
_DOUBTFUL, _SKEWED, _ALIKE_TURNED = 0.05, 0.22, 0.15
#: Half of a probe's travel in a sweep over the clearance, least and most: a polygon reaches up to twice its clearance.
_TRAVEL = (0.5, 2.5)
#: Distance between two mean positions over the clearance, at most.
_APART = 3.0
#: Clearance times stiffness over load, at least: pivots that give let the shaft move by more than the clearance.
_LEAST_STIFF = 0.5


def coherence(D: ComplexArray, F: ComplexArray, h: ComplexArray, weights: FloatArray) -> float:
    """Multiple coherence of the forces with the displacements, smaller axis.

    `D`, `F` (n, 2), `h` (2, 2), `weights` (n,).
    """
    good = np.isfinite(D).all(axis=1) & np.isfinite(F).all(axis=1) & (weights > 0)
    if not good.any() or not np.isfinite(h).all():
        return np.nan
    w = weights[good, None]
    residual = F[good] - D[good] @ h.T
    power = (w * np.abs(F[good]) ** 2).sum(axis=0)
    return float(np.clip(1 - (w * np.abs(residual) ** 2).sum(axis=0) / power, 0.0, 1.0).min())


def amplitude(data: PointData, weights: FloatArray) -> float:
    """Largest displacement amplitude (major half-axis of the orbit) of any run's mean phasor [m]; `weights` (n,)."""
    means = [np.average(data.D[places], axis=0, weights=weights[places]) for _, places in data.counted(weights)]
    orbits = np.array(means, complex).reshape(-1, 2)
    sizes = np.linalg.svd(np.stack([orbits.real, orbits.imag], axis=1), compute_uv=False)
    return float(sizes.max(initial=0.0))


def rejected_windows(data: PointData, h: ComplexArray, weights: FloatArray) -> tuple[WindowVerdict, ...]:
    """Windows without weight, each with the reason that shows in its own numbers; `h` (2, 2) [N/m], `weights` (n,)."""
    verdicts = []
    answered = bool(np.isfinite(h).all())
    for i in np.flatnonzero(weights < REJECTED_WEIGHT).tolist():
        run = data.runs[data.run_index[i]]
        k = int(i - np.searchsorted(data.run_index, data.run_index[i]))
        direction = np.nan if run.direction is None else run.direction
        reason = _reason(data, run.lost[k], i, weights, answered)
        verdicts.append(WindowVerdict(run.run, float(run.start[k]), float(weights[i]), direction, reason))
    return tuple(verdicts)


def _reason(data: PointData, lost: FloatArray, i: int, weights: FloatArray, answered: bool) -> str:
    """What shows in window `i`; `lost` (n_channels,): share of its samples left out, `weights` (n,)."""
    for name in ("displacement", "force"):
        share = lost[data.runs[data.run_index[i]].pick(name)].max(initial=0.0)
        if share > 0.5:
            return f"{100 * share:.0f} % of the {name} samples missing or glitched"
    if not data.whole[i]:
        return "missing values"
    if not answered:
        return "the point has no answer"
    siblings = (data.run_index == data.run_index[i]) & (weights >= REJECTED_WEIGHT)
    if not siblings.any():
        return "whole run disagrees with the other directions"
    moves = []
    for name, z in (("displacement", data.D), ("force", data.F)):
        mean = z[siblings].mean(axis=0)
        moves.append((np.linalg.norm(z[i] - mean) / max(np.linalg.norm(mean), np.finfo(float).tiny), name))
    share, worst = max(moves)
    return f"{worst} phasor {100 * share:.1f} % away from its repeats"


def flags(data: PointData, stiffness: DynamicStiffness, coherence: float) -> Conditions:
    """Conditions that the point's figures give rise to."""
    low = np.isfinite(stiffness.h).all() and not coherence >= MIN_COHERENCE
    text = f"coherence {coherence:.3f} < {MIN_COHERENCE}"
    return (*holding((low, "low-coherence", text)), *_missing(data), *physics(stiffness, data.inertia))


def _missing(data: PointData) -> Conditions:
    """Windows of the excitation without phasors, pointed out when they are many or a whole run's."""
    used = {run.run for run, _ in data.counted()}
    empty = [run.run for run in data.runs if run.run not in used]
    driven = data.whole[np.concatenate([_in_stretch(run) for run in data.runs])]
    lost = 1 - driven.mean()
    text = f"{int((~driven).sum())} of {len(driven)} windows gave no phasors"
    return holding(
        (empty, "run-without-data", f"no usable window in {', '.join(empty)}"),
        (not empty and 0.1 < lost <= _MAX_LOST, "windows-missing", text),
        (not empty and lost > _MAX_LOST, "most-windows-lost", text),
    )


def _in_stretch(run: RunPhasors) -> BoolArray:
    """Windows within the part of the record that has the run's excitation (n,)."""
    if run.span is None:
        return np.ones(len(run.start), dtype=bool)
    return (run.start >= run.span[0] - 1e-9) & (run.start + run.length <= run.span[1] + 1e-9)


def physics(stiffness: DynamicStiffness, inertia: float) -> Conditions:
    """Say whether `inertia` [kg] stays in the force, which nothing measures: on soft cells.

    And where damping, the symmetric part of Im h, is negative beyond doubt: no cross-coupled stiffness is in it. By
    Reynolds' equation the rest is nothing; where it is more than the interval, and stiffness is turned by the same
    angle, as by the inertia of no seal but by chance, axes are the sensors' work.
    """
    if not np.isfinite(stiffness.h).all():
        return ()
    share = inertia * stiffness.omega**2 * SOFT * 1e-9
    name = "inertia-not-corrected" if share > HARMLESS else "inertia-negligible"
    remains = f"no accelerometers: the housing's inertia stays in F, {100 * share:.2g} % of it on soft cells"
    damping = np.linalg.eigvalsh((stiffness.h.imag + stiffness.h.imag.T) / 2)[0]
    text = "the film would feed the motion instead of damping it: check polarity, axes and sign of forces"
    negative = damping < -3 * stiffness.standard_error[4:].max()
    skew, skew_k = turned = np.array([_skew(stiffness.h.imag), _skew(stiffness.h.real)])
    rooms = stiffness.half_width()[[5, 6, 1, 2]].reshape(2, 2)  # of c, which is Im h, and k
    traces = np.abs([np.trace(stiffness.h.imag), np.trace(stiffness.h.real)])
    room, room_k = np.linalg.norm(rooms, axis=1) / np.maximum(traces, 1e-300)
    is_turned = abs(skew - skew_k) < _ALIKE_TURNED * abs(skew) + room + room_k
    beyond = (abs(skew) - room) * is_turned
    shown = (
        f"cyx - cxy is {100 * skew:+.0f} % of cxx + cyy, kyx - kxy {100 * skew_k:+.0f} % of kxx + kyy: as if probes "
    )
    shown += f"and cells stood {np.degrees(np.arctan(turned)).mean():+.0f} deg from one another"
    return holding(
        (inertia > 0, name, remains),
        (negative, "negative-damping", text),
        (beyond > _SKEWED, "damping-not-symmetric", shown),
        (_DOUBTFUL < beyond <= _SKEWED, "damping-hardly-symmetric", shown),
    )


def _skew(part: FloatArray) -> float:
    """Antisymmetric part of a matrix over its trace: the tangent of the angle by which a symmetric one is turned."""
    return float((part[1, 0] - part[0, 1]) / (np.trace(part) or np.inf))


def directional_pattern(data: PointData, weights: FloatArray) -> Conditions:
    """Point out rejected windows that gather in some directions: physics may do that, glitches do not; `weights` (n,).

    A binomial test per run: more rejected windows than chance gives once in a thousand, in a run
    with at least three of them.
    """
    bad = (weights < REJECTED_WEIGHT) & data.whole
    total, count = int(bad.sum()), int(data.whole.sum())
    named = []
    for run, places in data.counted():
        n, hits = len(places), int(bad[places].sum())
        chance = (total - hits + 0.5) / (count - n + 1.0)
        if hits >= 3 and hits > 0.4 * n and bdtrc(hits - 1, n, min(chance, 1.0)) < 1e-3:
            angle = "" if run.direction is None else f" at {np.degrees(run.direction):.0f} deg"
            named.append(f"{run.run}{angle} ({hits} of {n})")
    text = f"rejected windows gather in {', '.join(named)}: look before discarding"
    return holding((named, "directional-rejection", text))


def differing_runs(share: float) -> Conditions:
    """Say where runs have no H in common: `share` of the film's force by which they differ beyond load and noise."""
    text = f"the runs differ by {100 * share:.1f} % in force over displacement (limit {100 * _MAX_DISAGREEMENT:.0f} %)"
    return holding((share > _MAX_DISAGREEMENT, "runs-disagree", text))


def with_probe_doubts(
    swept: Mapping[tuple[str, str], float], points: Sequence[PointResult], clearance: float | None
) -> tuple[PointResult, ...]:
    """The points, each with the doubt that the probes' readings are no lengths in this bearing, where there is one.

    Coefficients alone never show a wrong scale of the probes: stiffness and damping shrink alike. The drawing's
    clearance is a length that they can be held against, in three ways:

    - in a clearance sweep a probe travels once through the clearance, and little more (`swept`: half of it by run and
      probe [m]);
    - the shaft does not leave the clearance between one operating point and another;
    - a film stiffens as it is loaded, so that the load W moved the shaft by more than W / K, which the clearance must
      hold.
    """
    if not clearance or not clearance > 0:
        return tuple(points)
    by_probe = {}
    for (run, name), half in swept.items():
        if not _TRAVEL[0] * clearance < half < _TRAVEL[1] * clearance:
            by_probe[name] = f"{name} travels {1e6 * half:.3g} um to either side in the sweep {run}"
    sentences = list(by_probe.values())
    places = np.array([p.position for p in points if np.isfinite(p.position).all()]).reshape(-1, 2)
    distance = float(np.hypot(*np.ptp(places, axis=0))) if len(places) else 0.0
    if distance > _APART * clearance:
        sentences.append(f"the shaft's mean positions lie {1e6 * distance:.3g} um apart")
    load, value = min(_static_stiffness(points), key=lambda pair: pair[1] / pair[0], default=(0.0, 0.0))
    if load * _LEAST_STIFF > value * clearance:
        softest = f"{load / 1e3:g} kN on a stiffness of {value / 1e6:.3g} MN/m"
        sentences.append(f"{softest} would move the shaft by more than {1e6 * load / value:.3g} um")
    cure = "is the probes' sensitivity right in the manifest?"
    text = f"{'; '.join(sentences)} (clearance {1e6 * clearance:.0f} um): {cure}"
    doubts = holding((sentences, "probes-contradict-clearance", text))
    return tuple(replace(point, quality=merged(point.quality, doubts)) for point in points)


def _static_stiffness(points: Sequence[PointResult]) -> list[tuple[float, float]]:
    """Loads, and the stiffness along each [N/m], where it is one: Re h at the lowest frequency of the load."""
    result = []
    for places in by_static_point(points):
        first = min((points[i] for i in places), key=lambda p: p.stiffness.omega)
        along = directions(np.array([first.point.static_load_direction]))[0]
        load, value = first.point.static_load, float(along @ first.stiffness.k @ along)
        if load > 0 and value > 0:
            result.append((load, value))
    return result
