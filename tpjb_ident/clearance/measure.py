"""Clearance polygon from a sweep: clearance and direction of every pad, centre, corners (paper, Fig. 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.vector import directions
from tpjb_ident.clearance.polygon import Centre, CentreRule, SideFit, corners, find_centre, fit_sides, gain_ratio
from tpjb_ident.clearance.sweep import Touch, read_sweep
from tpjb_ident.conditions import Condition, sentences
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.presentation import Presented, shown_by
from tpjb_ident.schema import TANGENT
from tpjb_ident.slow_records.noise import NoiseModel

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.campaign import Campaign, Run
    from rigdata.operating_point import OperatingPoint

FEWEST_BLOCKS = 4  # per pad
SAME_WARMTH = 4.0  # [K]
IRREGULAR = 3.0  # standard errors
UNEQUAL = 0.02  # gains of two probes: twice what a usual certificate leaves open
GAIN_ERRORS = 4.0  # standard errors, of few sides
DISAGREES = 0.1  # share: a shaft that slides into its corner slowly makes up for some per cent


@dataclass(frozen=True, repr=False)
class ClearancePolygon(Presented):
    """The polygon in which the shaft centre can move, cold or hot.

    Attributes
    ----------
    run : str
        Where it came from.
    point : OperatingPoint
        Its set points: push load, shaft speed.
    angles : (n,) ndarray
        Nominal pad directions [rad].
    centre, centre_covariance : (2,), (2, 2) ndarray
        Reading of the bearing centre [m], by `centre_rule`; see `tpjb_ident.clearance.polygon` for what that means. The
        covariance holds the wander of the probes' zero from run to run, as far as this run's drift tells.
    clearance, clearance_se : (n,) ndarray
        Per pad at zero push load [m]; NaN where the pad was not reached.
    clearance_pushed, clearance_pushed_se : (n,) ndarray
        With the pivot pushed by the full load [m], as measured.
    fitted_angle, fitted_angle_se : (n,) ndarray
        Directions normal to the sides as swept [rad].
    corners : (n, 2) ndarray
        Between pad k and k + 1, from the centre, at zero load [m].
    push_load : float
        As measured [N].
    pivot_scale, pivot_scale_se : float
        By how much the pivots give in the sweep, over what the curves say; 1 when both tests agree. NaN without curves.
    noise : NoiseModel
        Of the displacement channels in this run.
    temperature : float
        Mean of the run's temperature channels [K]; NaN without any. Tells hot from cold.
    centre_rule : str
        How the centre was chosen.
    status : tuple of Condition
        Named conditions.
    """

    run: str
    point: OperatingPoint
    angles: FloatArray
    centre: FloatArray
    centre_covariance: FloatArray
    clearance: FloatArray
    clearance_se: FloatArray
    clearance_pushed: FloatArray
    clearance_pushed_se: FloatArray
    fitted_angle: FloatArray
    fitted_angle_se: FloatArray
    corners: FloatArray
    push_load: float
    pivot_scale: float
    pivot_scale_se: float
    noise: NoiseModel = field(repr=False)
    temperature: float = np.nan
    centre_rule: CentreRule = "least-absolute"
    status: tuple[Condition, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Table of `clearance.csv` (outputs.md): one row per pad, SI, angles in degrees."""
        import pandas as pd

        return pd.DataFrame(
            {
                "pad": np.arange(1, len(self.angles) + 1),
                "clearance_m": self.clearance,
                "clearance_m_se": self.clearance_se,
                "clearance_pushed_m": self.clearance_pushed,
                "clearance_pushed_m_se": self.clearance_pushed_se,
                "pad_angle_deg": np.degrees(self.angles),
                "fitted_angle_deg": np.degrees(self.fitted_angle),
                "fitted_angle_deg_se": np.degrees(self.fitted_angle_se),
                "corner_x_m": self.corners[:, 0],
                "corner_y_m": self.corners[:, 1],
                "push_load_N": self.push_load,
                "shaft_speed_Hz": self.point.shaft_speed_hz,
                "temperature_K": self.temperature,
                "run": self.run,
            }
        )

    @property
    def regular(self) -> bool:
        """Whether all clearances are one and the same, within their errors or half a micrometre."""
        return "irregular" not in self.status

    def plot(self, **options: Any) -> Any:
        """Draw the polygon; see `tpjb_ident.report.plots.clearance_and_locus`.

        Parameters
        ----------
        **options
            ``locus``, ``predicted``, ``drawing``, ``title``.
        """
        return shown_by("report.plots", "clearance_and_locus")(self, **options)

    def __str__(self) -> str:
        pads = ", ".join(
            f"{1e6 * c:.2f} ({1e6 * s:.2f})" for c, s in zip(self.clearance, self.clearance_se, strict=True)
        )
        text = f"clearance polygon {self.run}: per pad {pads} µm (se), pushed by {self.push_load:.0f} N"
        return text + (f"; {', '.join(sentences(self.status))}" if self.status else "")


def measure_clearance(
    campaign: Campaign,
    pivot_angles: Sequence[float],
    curves: Sequence[PivotCurve] | None = None,
    rule: CentreRule = "least-absolute",
) -> ClearancePolygon:
    """Measure the cold clearance polygon: the first clearance run at rest with the smallest push load.

    Parameters
    ----------
    campaign : Campaign
        With a run of kind ``clearance``.
    pivot_angles : sequence of float
        Pad directions [rad], pad #1 first.
    curves : sequence of PivotCurve, optional
        What the pivots give under the push load is taken off with them; without them it is extrapolated from the sweep
        itself, less surely.
    rule : {"least-absolute", "least-squares"}
        Convention for the centre, see `tpjb_ident.clearance.polygon`.

    Returns
    -------
    ClearancePolygon

    Raises
    ------
    RigDataError
        When there is no such run, or it does not go around.
    """
    runs = campaign.of_kind("clearance")
    if not runs:
        raise RigDataError(
            Problem("error", "campaign.toml", "runs", "has no run of kind clearance", "Record a clearance sweep")
        )
    return measure_run(coldest_run(runs), pivot_angles, curves, rule)


def measure_run(
    run: Run,
    pivot_angles: Sequence[float],
    curves: Sequence[PivotCurve] | None = None,
    rule: CentreRule = "least-absolute",
) -> ClearancePolygon:
    """Measure the polygon of one run; parameters as `measure_clearance`."""
    angles = np.asarray(pivot_angles, dtype=float)
    touch = read_sweep(run, angles)
    reached = np.bincount(touch.pad, minlength=len(angles)) >= FEWEST_BLOCKS
    if reached.sum() < 3:
        what = f"clearance run {run.id} reaches {int(reached.sum())} of {len(angles)} pads"
        raise RigDataError(Problem("error", run.file, "record", what, "Check pad angles and channels", run=run.id))
    fit = fit_sides(touch, angles, reached, curves)
    pads = np.flatnonzero(reached)
    centre = find_centre(angles[pads], fit.distance[pads], fit.covariance[np.ix_(pads, pads)], rule)
    found = _polygon(run, touch, angles, fit, centre, rule)
    return replace(found, status=(*found.status, *_gains_differ(run, found), *_extrapolated(touch.push, curves)))


def _polygon(
    run: Run, touch: Touch, angles: FloatArray, fit: SideFit, centre: Centre, rule: CentreRule
) -> ClearancePolygon:
    """Clearances about the centre, with the errors of both."""
    n = directions(angles)
    pads = np.flatnonzero(np.isfinite(fit.distance))
    clearance = fit.distance - n @ centre.position
    # clearance = (I - n G) distance on the reached pads: the centre's error is the same sides' error
    map_ = np.eye(len(pads)) - n[pads] @ centre.gain[:2]
    covariance = fit.covariance[np.ix_(pads, pads)]
    se = np.full(len(angles), np.nan)
    # a centre that makes clearances equal hides their differences: none is better known than the common clearance
    common = float(np.sqrt(centre.gain[2] @ covariance @ centre.gain[2]))
    se[pads] = np.maximum(np.sqrt(np.diag(map_ @ covariance @ map_.T)), common)
    fitted = angles + fit.tilt
    # another run meets the probes' zero elsewhere: by about what it drifts within this one
    wander = (fit.noise.drift * float(np.ptp(touch.time))) ** 2 * np.eye(2)
    found = np.full((len(angles), 2), np.nan)
    if len(pads) == len(angles):
        found = corners(fitted, clearance)
    return ClearancePolygon(
        run=run.id,
        point=run.point,
        angles=angles,
        centre=centre.position,
        centre_covariance=centre.gain[:2] @ covariance @ centre.gain[:2].T + wander,
        clearance=clearance,
        clearance_se=se,
        clearance_pushed=clearance + fit.give,
        clearance_pushed_se=np.hypot(se, fit.give_se),
        fitted_angle=fitted,
        fitted_angle_se=fit.tilt_se,
        corners=found,
        push_load=touch.push,
        pivot_scale=fit.scale,
        pivot_scale_se=fit.scale_se,
        noise=fit.noise,
        temperature=_mean_temperature(run),
        centre_rule=rule,
        status=_status(fit, clearance, se, len(pads)),
    )


def _gains_differ(run: Run, found: ClearancePolygon) -> tuple[Condition, ...]:
    """One probe reads more than the other: sizes do not tell, the angles between the sides do."""
    probes = [c for c in run.channels.values() if c.quantity == "displacement" and c.axis is not None]
    if len(probes) != 2:
        return ()
    first, second = probes
    axes = (float(first.axis or 0.0), float(second.axis or 0.0))
    ratio = gain_ratio(found.angles, found.fitted_angle - found.angles, found.fitted_angle_se, axes)
    if not abs(ratio.value) > max(UNEQUAL, GAIN_ERRORS * ratio.se):
        return ()
    share = f"{100 * abs(ratio.value):.1f} % (se {100 * ratio.se:.1f} %)"
    more = "more" if ratio.value > 0 else "less"
    detail = f"the sides stand as if {first.name} read {share} {more} than {second.name}"
    return (Condition("probe-gains-differ", detail),)


def _extrapolated(push: float, curves: Sequence[PivotCurve] | None) -> tuple[Condition, ...]:
    """The push lies outside what the dry tests measured: true of most sweeps, and to be said."""
    outside = [c for c in curves or () if bool(c.is_extrapolated(push))]
    if not outside:
        return ()
    lowest = min(c.valid_from for c in outside)
    pads = "all pads" if len(outside) == len(curves or ()) else "pads " + ", ".join(f"#{c.pad}" for c in outside)
    detail = f"pushed with {push:.0f} N, the dry tests of {pads} hold from {lowest:.0f} N on; the sweep corrects it"
    return (Condition("give-extrapolated", detail),)


def _mean_temperature(run: Run) -> float:
    """Mean over time and over all temperature channels of a run [K]; NaN without any."""
    names = [name for name, channel in run.channels.items() if channel.quantity == "temperature"]
    records = [np.asarray(run.record(name).values) for name in names]
    means = [float(np.mean(v[np.isfinite(v)])) for v in records if np.isfinite(v).any()]
    return float(np.mean(means)) if means else float("nan")


def coldest_run(runs: Sequence[Run]) -> Run:
    """The sweep at rest, or at the lowest speed, that is cold; of several such the one with the smallest push."""
    if len(runs) == 1:
        return runs[0]
    slowest = min(run.point.shaft_speed for run in runs)
    slow = [(run, _mean_temperature(run)) for run in runs if run.point.shaft_speed == slowest]
    cold = float(np.nanmin([t for _, t in slow])) if np.isfinite([t for _, t in slow]).any() else np.nan
    # a temperature that nobody measured does not rule a sweep out
    fit = [run for run, t in slow if not t > cold + SAME_WARMTH]
    return min(fit, key=lambda run: run.point.static_load)


def _status(fit: SideFit, clearance: FloatArray, se: FloatArray, reached: int) -> tuple[Condition, ...]:
    found = []
    if reached < len(clearance):
        missing = ", ".join(str(k + 1) for k in np.flatnonzero(np.isnan(clearance)))
        found.append(Condition("pads-not-reached", missing))
    if np.isnan(fit.scale):
        found.append(Condition("give-from-sweep", "no pivot curves, zero load extrapolated from the sweep alone"))
    elif abs(fit.scale - 1.0) > max(IRREGULAR * fit.scale_se, DISAGREES):
        detail = f"they give {fit.scale:.2f} (se {fit.scale_se:.2f}) of what the dry tests say"
        found.append(Condition("pivots-disagree", detail))
    spread = np.abs(clearance - np.nanmedian(clearance))
    # below half a micrometre a difference between pads is of no consequence, however well it is measured
    odd = np.flatnonzero(spread > np.maximum(IRREGULAR * se, 0.5e-6))
    if len(odd):
        apart = ", ".join(f"pad #{k + 1} {1e6 * (clearance[k] - np.nanmedian(clearance)):+.1f} µm" for k in odd)
        found.append(Condition("irregular", f"{apart} from the median of all: worn, damaged or wrongly assembled"))
    turn = np.nanmean(fit.tilt)
    if abs(turn) > IRREGULAR * np.sqrt(np.nanmean(fit.tilt_se**2) / reached) and abs(turn) > 5e-3:
        found.append(Condition("frame-turned", f"all sides by {np.degrees(turn):+.2f} deg"))
    if fit.misfit > 4.0:
        found.append(Condition("misfit", "the scatter exceeds the noise"))
    return tuple(found)


RISE = 0.2  # of the lighter push load: less tells nothing of the stiffness


@dataclass(frozen=True)
class RadialStiffness:
    """Pivot stiffness from two sweeps with different push loads."""

    load: float
    stiffness: FloatArray
    stiffness_se: FloatArray


def radial_stiffness(light: ClearancePolygon, heavy: ClearancePolygon) -> RadialStiffness:
    """Secant between two push loads of the same bearing in the same condition."""
    rise = heavy.push_load - light.push_load
    if rise <= RISE * light.push_load:
        loads = f"{light.push_load:.0f} and {heavy.push_load:.0f} N"
        raise ArgumentError(f"push loads must differ by a fifth at least, heavy after light; got {loads}")
    # each about its own centre: a zero that wandered between the runs is no give
    give = heavy.clearance_pushed - light.clearance_pushed
    se = np.hypot(heavy.clearance_pushed_se, light.clearance_pushed_se)
    stiffness = rise / give
    load = 0.5 * (heavy.push_load + light.push_load)
    return RadialStiffness(load, np.asarray(stiffness), np.asarray(np.abs(stiffness / give) * se))


@dataclass(frozen=True)
class ClearanceChange:
    """Growth of the clearance from one condition to another."""

    per_pad: FloatArray
    per_pad_se: FloatArray
    mean: float
    mean_se: float
    centre_shift: FloatArray


def clearance_change(before: ClearancePolygon, after: ClearancePolygon) -> ClearanceChange:
    """How much the clearance at zero load changed, as from cold to hot."""
    if before.angles.shape != after.angles.shape or not np.allclose(before.angles, after.angles, atol=1e-6):
        raise ArgumentError("both polygons must be of one bearing: their pad directions differ")
    shift = after.centre - before.centre
    per_pad = after.clearance - before.clearance
    se = np.hypot(before.clearance_se, after.clearance_se)
    known = np.isfinite(per_pad)
    # pads that do not surround the shaft evenly: a shift of the centre must not pass for growth
    design = np.column_stack([np.ones(known.sum()), directions(before.angles[known])])
    mean = np.linalg.lstsq(design, per_pad[known], rcond=None)[0][0]
    mean_se = float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * np.mean(se[known] ** 2)))
    return ClearanceChange(per_pad, se, float(mean), mean_se, shift)


def pairs_frame(base: ClearancePolygon, others: Sequence[ClearancePolygon]) -> pd.DataFrame:
    """Every other polygon against one: `clearance_pairs.csv`, one row per pad."""
    import pandas as pd

    rows = []
    for other in others:
        change = clearance_change(base, other)
        light, heavy = sorted((base, other), key=lambda p: p.push_load)
        same = _same_condition(base, other)
        spring = radial_stiffness(light, heavy) if same and _rises(light, heavy) else None
        for k in range(len(base.angles)):
            row = {
                "run": other.run,
                "against": base.run,
                "compared": "push load" if same else "condition",
                "pad": k + 1,
                "change_m": change.per_pad[k],
                "change_m_se": change.per_pad_se[k],
            }
            if spring is not None:
                row |= {
                    "load_N": spring.load,
                    TANGENT: spring.stiffness[k],
                    f"{TANGENT}_se": spring.stiffness_se[k],
                }
            rows.append(row)
    return pd.DataFrame(rows)


def _same_condition(one: ClearancePolygon, other: ClearancePolygon) -> bool:
    """Whether two sweeps were made at one speed and one temperature (or nobody knows better)."""
    apart = abs(one.temperature - other.temperature)
    return one.point.shaft_speed == other.point.shaft_speed and not apart > SAME_WARMTH


def _rises(light: ClearancePolygon, heavy: ClearancePolygon) -> bool:
    return heavy.push_load - light.push_load > RISE * light.push_load
