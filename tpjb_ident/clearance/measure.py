"""Clearance polygon from a sweep: clearance and direction of every pad, centre, corners (paper, Fig. 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import refuse
from rigdata.vector import directions
from tpjb_ident.clearance.polygon import Centre, CentreRule, SideFit, corners, find_centre, fit_sides, gain_ratio
from tpjb_ident.clearance.sweep import ContactIntervals, read_sweep
from tpjb_ident.conditions import Condition, sentences
from tpjb_ident.errors import ArgumentError
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.dry_record import axial_channels, relative_calibration
from tpjb_ident.presentation import Presented
from tpjb_ident.schema import TANGENT

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.calibration import Channel
    from rigdata.campaign import Campaign, Run
    from rigdata.operating_point import OperatingPoint

_FEWEST_BLOCKS = 4  # per pad
_SAME_TEMPERATURE = 4.0  # [K]
_IRREGULAR = 3.0  # standard errors
_UNEQUAL = 0.02  # gains of two probes: twice what a usual certificate leaves open
_GAIN_ERRORS = 4.0  # standard errors, of few sides
_DISAGREES = 0.1  # share: a shaft that slides into its corner slowly makes up for some per cent


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
        covariance holds the drift of the probes' zero from run to run, as far as this run's drift tells.
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
        By how much the pivots deflect in the sweep, over what the curves say; 1 when both tests
        agree. NaN without curves.
    noise : NoiseModel
        Of the displacement channels in this run.
    temperature : float
        Mean of the run's temperature channels [K]; NaN without any. Tells hot from cold.
    centre_rule : str
        How the centre was chosen.
    status : tuple of Condition
        Named conditions.
    relative_calibration : (n,) ndarray
        Standard uncertainty along the pads from the probes' certificates, relative; not in the standard errors, as in
        `PivotCurve`.
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
    relative_calibration: FloatArray | float = 0.0

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
                "push_load_N": self.push_load,
                "shaft_speed_Hz": self.point.shaft_speed_hz,
                "rotation": self.point.rotation,
                "temperature_K": self.temperature,
                "run": self.run,
            }
        )

    def plot(self, **options: Any) -> Any:
        """Draw the polygon; see `tpjb_ident.report.plots.clearance_and_locus`.

        Parameters
        ----------
        **options
            ``locus``, ``predicted``, ``drawing``, ``title``.
        """
        from tpjb_ident.report.plots import clearance_and_locus

        return clearance_and_locus(self, **options)

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
        The pivots' deflection under the push load is taken off with them; without them it is extrapolated from the
        sweep itself, less surely.
    rule : {"least-absolute", "least-squares"}
        Convention for the centre, see `tpjb_ident.clearance.polygon`.

    Returns
    -------
    ClearancePolygon

    Raises
    ------
    RigDataError
        When there is no such run, or it does not go around.

    Examples
    --------
    >>> angles = [pad.pivot_angle for pad in ti.load_bearing(rocker).pads]
    >>> polygon = ti.measure_clearance(ti.load_campaign(demo), angles)
    >>> polygon.clearance.shape
    (5,)
    """
    runs = campaign.of_kind("clearance")
    if not runs:
        raise refuse("campaign.toml", "runs", "has no run of kind clearance", "Record a clearance sweep")
    return measure_run(coldest_run(runs), pivot_angles, curves, rule)


def measure_run(
    run: Run,
    pivot_angles: Sequence[float],
    curves: Sequence[PivotCurve] | None = None,
    rule: CentreRule = "least-absolute",
) -> ClearancePolygon:
    """Measure the polygon of one run; parameters as `measure_clearance`."""
    angles, run = np.asarray(pivot_angles, dtype=float), live_run(run)
    contact = read_sweep(run, angles)
    reached = np.bincount(contact.pad, minlength=len(angles)) >= _FEWEST_BLOCKS
    if reached.sum() < 3:
        what = f"clearance run {run.id} reaches {int(reached.sum())} of {len(angles)} pads"
        raise refuse(run.file, "record", what, "Check pad angles and channels", run.id)
    fit = fit_sides(contact, angles, reached, curves)
    pads = np.flatnonzero(reached)
    centre = find_centre(angles[pads], fit.distance[pads], fit.covariance[np.ix_(pads, pads)], rule)
    polygon = _polygon(run, contact, angles, fit, centre)
    probes = [c for c in axial_channels(run).values() if c.quantity == "displacement"]
    status = (*polygon.status, *_gains_differ(probes, polygon), *_extrapolated(contact.push, curves))
    calibration = np.array([relative_calibration(probes, float(angle)) for angle in angles])
    return replace(polygon, status=status, centre_rule=rule, relative_calibration=calibration)


def _polygon(run: Run, contact: ContactIntervals, angles: FloatArray, fit: SideFit, centre: Centre) -> ClearancePolygon:
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
    drift = (fit.noise.drift * float(np.ptp(contact.time))) ** 2 * np.eye(2)
    reached_all = len(pads) == len(angles)
    return ClearancePolygon(
        run=run.id,
        point=run.point,
        angles=angles,
        centre=centre.position,
        centre_covariance=centre.gain[:2] @ covariance @ centre.gain[:2].T + drift,
        clearance=clearance,
        clearance_se=se,
        clearance_pushed=clearance + fit.deflection,
        clearance_pushed_se=np.hypot(se, fit.deflection_se),
        fitted_angle=fitted,
        fitted_angle_se=fit.tilt_se,
        corners=corners(fitted, clearance) if reached_all else np.full((len(angles), 2), np.nan),
        push_load=contact.push,
        pivot_scale=fit.scale,
        pivot_scale_se=fit.scale_se,
        noise=fit.noise,
        temperature=_mean_temperature(run),
        status=_status(fit, clearance, se, len(pads)),
    )


def _gains_differ(probes: Sequence[Channel], polygon: ClearancePolygon) -> tuple[Condition, ...]:
    """One probe reads more than the other: sizes do not tell, the angles between the sides do."""
    if len(probes) != 2:
        return ()
    first, second = probes
    axes = (float(first.axis or 0.0), float(second.axis or 0.0))
    ratio, se = gain_ratio(polygon.angles, polygon.fitted_angle - polygon.angles, polygon.fitted_angle_se, axes)
    if not abs(ratio) > max(_UNEQUAL, _GAIN_ERRORS * se):
        return ()
    share = f"{100 * abs(ratio):.1f} % (se {100 * se:.1f} %)"
    more = "more" if ratio > 0 else "less"
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
    """Temperature of a run [K]; NaN where it is neither stated nor measured."""
    temperature = run.mean_temperature()
    return float("nan") if temperature is None else temperature


def coldest_run(runs: Sequence[Run]) -> Run:
    """The sweep at rest, or at the lowest speed, that is cold; of several such the one with the smallest push."""
    if len(runs) == 1:
        return runs[0]
    slowest = min(run.point.shaft_speed for run in runs)
    slow = [run for run in runs if run.point.shaft_speed == slowest]
    temperatures = [_mean_temperature(run) for run in slow]
    coldest = min((t for t in temperatures if np.isfinite(t)), default=np.nan)
    # a temperature that nobody measured does not rule a sweep out
    cold = [run for run, t in zip(slow, temperatures, strict=True) if not t > coldest + _SAME_TEMPERATURE]
    return min(cold, key=lambda run: run.point.static_load)


def _status(fit: SideFit, clearance: FloatArray, se: FloatArray, reached: int) -> tuple[Condition, ...]:
    status = []
    if reached < len(clearance):
        missing = ", ".join(str(k + 1) for k in np.flatnonzero(np.isnan(clearance)))
        status.append(Condition("pads-not-reached", missing))
    if np.isnan(fit.scale):
        status.append(Condition("give-from-sweep", "no pivot curves, zero load extrapolated from the sweep alone"))
    elif abs(fit.scale - 1.0) > max(_IRREGULAR * fit.scale_se, _DISAGREES):
        detail = f"they deflect {fit.scale:.2f} (se {fit.scale_se:.2f}) of what the dry tests say"
        status.append(Condition("pivots-disagree", detail))
    spread = np.abs(clearance - np.nanmedian(clearance))
    # below half a micrometre a difference between pads is of no consequence, however well it is measured
    deviating = np.flatnonzero(spread > np.maximum(_IRREGULAR * se, 0.5e-6))
    if len(deviating):
        offsets = 1e6 * (clearance - np.nanmedian(clearance))
        listed = ", ".join(f"pad #{k + 1} {offsets[k]:+.1f} µm" for k in deviating)
        status.append(Condition("irregular", f"{listed} from the median of all: worn, damaged or wrongly assembled"))
    turn = np.nanmean(fit.tilt)
    if abs(turn) > _IRREGULAR * np.sqrt(np.nanmean(fit.tilt_se**2) / reached) and abs(turn) > 5e-3:
        status.append(Condition("frame-turned", f"all sides by {np.degrees(turn):+.2f} deg"))
    if fit.misfit > 4.0:
        status.append(Condition("misfit", "the scatter exceeds the noise"))
    return tuple(status)


_RISE = 0.2  # of the lighter push load: less tells nothing of the stiffness


def radial_stiffness(light: ClearancePolygon, heavy: ClearancePolygon) -> tuple[float, FloatArray, FloatArray]:
    """Secant between two push loads of the same bearing: mean load [N], stiffness (n,) [N/m] and its standard error."""
    rise = heavy.push_load - light.push_load
    if rise <= _RISE * light.push_load:
        loads = f"{light.push_load:.0f} and {heavy.push_load:.0f} N"
        raise ArgumentError(f"push loads must differ by a fifth at least, heavy after light; got {loads}")
    # each about its own centre: a zero that drifted between the runs is no deflection
    deflection = heavy.clearance_pushed - light.clearance_pushed
    se = np.hypot(heavy.clearance_pushed_se, light.clearance_pushed_se)
    stiffness = rise / deflection
    return 0.5 * (heavy.push_load + light.push_load), stiffness, np.abs(stiffness / deflection) * se


def clearance_change(before: ClearancePolygon, after: ClearancePolygon) -> tuple[FloatArray, FloatArray]:
    """Growth (n,) [m] of the clearance at zero load per pad, as from cold to hot, and its standard error."""
    if before.angles.shape != after.angles.shape or not np.allclose(before.angles, after.angles, atol=1e-6):
        raise ArgumentError("both polygons must be of one bearing: their pad directions differ")
    return after.clearance - before.clearance, np.hypot(before.clearance_se, after.clearance_se)


def pairs_frame(base: ClearancePolygon, others: Sequence[ClearancePolygon]) -> pd.DataFrame:
    """Every other polygon against one: `clearance_pairs.csv`, one row per pad."""
    import pandas as pd

    frames = []
    for polygon in others:
        change, change_se = clearance_change(base, polygon)
        light, heavy = sorted((base, polygon), key=lambda p: p.push_load)
        # one speed and one temperature, or nobody knows better
        warmer = abs(base.temperature - polygon.temperature) > _SAME_TEMPERATURE
        same = base.point.spin == polygon.point.spin and not warmer
        columns: dict[str, object] = {
            "run": polygon.run,
            "against": base.run,
            "compared": "push load" if same else "condition",
            "pad": np.arange(1, len(base.angles) + 1),
            "change_m": change,
            "change_m_se": change_se,
        }
        if same and heavy.push_load - light.push_load > _RISE * light.push_load:
            load, stiffness, stiffness_se = radial_stiffness(light, heavy)
            columns |= {"load_N": load, TANGENT: stiffness, f"{TANGENT}_se": stiffness_se}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)
