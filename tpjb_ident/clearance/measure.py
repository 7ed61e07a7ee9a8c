"""Clearance polygon from a sweep: clearance and direction of every pad, centre, corners (paper, Fig. 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.vector import directions
from tpjb_ident.clearance.polygon import Centre, SideFit, corners, find_centre, fit_sides, untested
from tpjb_ident.clearance.sweep import LARGEST_DEFLECTION, ContactIntervals, read_sweep
from tpjb_ident.columns import amount, size, symbol
from tpjb_ident.conditions import Conditions, holding, sentences
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.dry_record import axial_channels, refusal
from tpjb_ident.pivot.sweep_witness import as_witnessed, witness_of
from tpjb_ident.presentation import Presented
from tpjb_ident.schema import TANGENT

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.calibration import Channels
    from rigdata.campaign import Campaign, Run
    from rigdata.operating_point import OperatingPoint

_FEWEST_BLOCKS = 4  # per pad
_SAME_TEMPERATURE = 4.0  # [K]
_IRREGULAR = 3.0  # standard errors
_LEAST_ERROR = 1e-3  # of a preload, drawn or measured
_LARGEST_WALK = 1.5e-6  # [m], of a zero over a sweep: no probe's
_RISE = 0.2  # of the lighter push load: less tells nothing of the stiffness
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
        Reading of the bearing centre [m]; see `tpjb_ident.clearance.polygon` for what that means. The
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
    status : tuple of Condition
        Named conditions.
    relative_calibration : (n,) ndarray
        Standard uncertainty along the pads from the probes' certificates, relative; in `clearance_error` and in the
        tables' errors alone.
    sensors : mapping of str to Channel
        Sensors that the sweep shows otherwise than stated, as they were read here, by name.
    as_read : tuple of (n,) ndarray, optional
        Pushed clearances and fitted angles as the probes read them, where some are read otherwise.
    centre_doubt : (2, 2) ndarray
        Of a centre elsewhere, with other deviations of the pads, that fits as well [m^2]; in `clearance_error` and in
        the tables' errors alone.
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
    status: Conditions = ()
    relative_calibration: FloatArray | float = 0.0
    sensors: Channels = field(default_factory=dict, repr=False)
    as_read: tuple[FloatArray, FloatArray] | None = None
    centre_doubt: FloatArray = field(default_factory=lambda: np.zeros((2, 2)), repr=False)

    def to_frame(self) -> pd.DataFrame:
        """Table of `clearance.csv` (outputs.md): one row per pad, SI, angles in degrees."""
        import pandas as pd

        error, pushed = self.clearance_error, self.clearance_pushed_se**2 - self.clearance_se**2
        return pd.DataFrame(
            {
                "pad": np.arange(1, len(self.angles) + 1),
                "clearance_m": self.clearance,
                "clearance_m_se": error,
                "clearance_pushed_m": self.clearance_pushed,
                "clearance_pushed_m_se": np.sqrt(error**2 + pushed),
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

    @property
    def clearance_error(self) -> FloatArray:
        """Standard error of the clearances (n,) [m] with all that is known: of gains and of other centres as well."""
        n = directions(self.angles)
        others = np.sum(n @ self.centre_doubt * n, axis=1)
        return np.sqrt(self.clearance_se**2 + (self.relative_calibration * self.clearance) ** 2 + others)

    def negative_preloads(self, pad_clearance: Sequence[float]) -> str:
        """Pads that stand further out than their own clearances (n,) [m] allow, in words; empty where none does."""
        preload = 1.0 - self.clearance / pad_clearance
        error = self.clearance_error / self.clearance + _LEAST_ERROR
        listed = ", ".join(f"#{pad + 1} {preload[pad]:+.3f}" for pad in np.flatnonzero(preload < -_IRREGULAR * error))
        return f"the sweep shows pads of negative preload: {listed}" if listed else ""

    def plot(self, **options: Any) -> Any:
        """Draw the polygon; `tpjb_ident.report.plots.clearance_and_locus` takes the same options."""
        from tpjb_ident.report.plots import clearance_and_locus

        return clearance_and_locus(self, **options)

    def __str__(self) -> str:
        unit = size("length")
        pads = ", ".join(f"{c / unit:.4g} ({s / unit:.2g})" for c, s in zip(self.clearance, self.clearance_se))
        push = amount(self.push_load, "force", ".0f")
        text = f"clearance polygon {self.run}: per pad {pads} {symbol('length')} (se), pushed by {push}"
        return "; ".join([text, *sentences(self.status)])


def measure_clearance(
    campaign: Campaign, pivot_angles: Sequence[float], curves: Sequence[PivotCurve] | None = None
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
    return measure_run(coldest_first(runs)[0], pivot_angles, curves or ())


def measure_run(run: Run, pivot_angles: Sequence[float], curves: Sequence[PivotCurve] = ()) -> ClearancePolygon:
    """Measure the polygon of one run; parameters as `measure_clearance`."""
    angles, run = np.asarray(pivot_angles, dtype=float), live_run(run)
    witness, as_read = witness_of(run, angles), None
    if witness.channels:
        plain = _polygon(run, *_sides(run, angles, curves), angles)
        run, as_read = as_witnessed(run, witness.channels), (plain.clearance_pushed, plain.fitted_angle)
    contact, fit = _sides(run, angles, curves)
    polygon = replace(_polygon(run, contact, fit, angles), sensors=witness.channels, as_read=as_read)
    # the push lies outside what the dry tests measured in most sweeps
    outside = [curve for curve in curves if curve.is_extrapolated(contact.push)]
    lowest = min((curve.valid_from for curve in outside), default=0.0)
    pads = " of all pads" if len(outside) == len(angles) else _of_pads([curve.pad for curve in outside])
    push, valid = (amount(load, "force", ".0f") for load in (contact.push, lowest))
    detail = f"pushed with {push}, the dry tests{pads} hold from {valid} on; the sweep corrects it"
    extrapolated = holding((outside, "give-extrapolated", detail))
    return replace(
        polygon, status=(*polygon.status, *_status(fit, polygon, curves), *witness.conditions, *extrapolated)
    )


def _sides(run: Run, angles: FloatArray, curves: Sequence[PivotCurve]) -> tuple[ContactIntervals, SideFit]:
    """Averages and sides of a sweep whose shaft and probes stood still."""
    deflection = LARGEST_DEFLECTION
    for _ in range(2):
        contact = read_sweep(run, angles, deflection)
        pads = np.flatnonzero(np.bincount(contact.pad) >= _FEWEST_BLOCKS)
        if len(pads) < 3:
            what = f"reaches {len(pads)} of {len(angles)} pads"
            raise refusal(run, "record", what, "Check pad angles and channels")
        fit = fit_sides(contact, angles, pads, curves)
        if fit.deflection.max() <= deflection:
            break
        deflection = fit.deflection.max()  # pads that seemed not to be touched were
    walk = fit.noise.walk * np.sqrt(np.ptp(contact.time))
    if walk > _LARGEST_WALK:
        what = f"has a shaft that was turned, or probes that moved: their zero walks by {amount(walk, 'length', '.2g')}"
        raise refusal(run, "record", what, "Keep shaft and probes still")
    return contact, fit


def _polygon(run: Run, contact: ContactIntervals, fit: SideFit, angles: FloatArray) -> ClearancePolygon:
    """Clearances about the centre, with the errors of both; NaN where a pad was not reached."""
    n, covariance = directions(angles[fit.pads]), fit.covariance
    axes, uncertainty = probe_gains(run)
    gains = np.cos(angles[:, None] - axes) ** 2 * uncertainty
    centre = find_centre(angles[fit.pads], fit.distance, covariance, gains[fit.pads] * np.mean(fit.distance))
    # clearance = (I - n G) distance on the reached pads: the centre's error is the same sides' error
    map_ = np.eye(len(n)) - n @ centre.gain[:2]
    unknown = np.einsum("ki,ij,kj->k", n, centre.covariance, n)
    # a centre that makes clearances equal hides their differences: none is better known than the common clearance
    common = np.sqrt(centre.gain[2] @ covariance @ centre.gain[2])
    se = np.hypot(np.maximum(np.sqrt(np.diag(map_ @ covariance @ map_.T)), common), np.sqrt(unknown))
    columns = np.full((6, len(angles)), np.nan)
    columns[:, fit.pads] = np.array([fit.distance - n @ centre.position, se, fit.deflection, fit.deflection_se,
                                     angles[fit.pads] + fit.tilt, fit.tilt_se])  # fmt: skip
    clearance, clearance_se, deflection, deflection_se, fitted, fitted_se = columns
    # another run meets the probes' zero elsewhere: by about what it drifts within this one
    span = np.ptp(contact.time)
    drift = ((fit.noise.drift * span) ** 2 + fit.noise.walk**2 * span) * np.eye(2)
    return ClearancePolygon(
        run=run.id,
        point=run.point,
        angles=angles,
        centre=centre.position,
        centre_covariance=centre.gain[:2] @ covariance @ centre.gain[:2].T + drift + centre.covariance,
        clearance=clearance,
        clearance_se=clearance_se,
        clearance_pushed=clearance + deflection,
        clearance_pushed_se=np.hypot(clearance_se, deflection_se),
        fitted_angle=fitted,
        fitted_angle_se=fitted_se,
        corners=corners(fitted, clearance) if len(n) == len(angles) else np.full((len(angles), 2), np.nan),
        push_load=contact.push,
        pivot_scale=fit.scale,
        pivot_scale_se=fit.scale_se,
        noise=fit.noise,
        temperature=run.mean_temperature() or np.nan,
        status=_inseparable(fit, centre, gains),
        relative_calibration=np.linalg.norm(gains, axis=1),
        centre_doubt=centre.doubt,
    )


def probe_gains(run: Run) -> FloatArray:
    """Axes [rad] of a run's probes and how well their gains are known, (2, p)."""
    probes = [c for c in axial_channels(run).values() if c.quantity == "displacement"]
    return np.array([(probe.axis, probe.uncertainty or 0.0) for probe in probes]).T


def coldest_first(runs: Sequence[Run]) -> list[Run]:
    """Sweeps in order of speed, the cold ones of a speed before the warm ones, and those by their push."""
    temperature = {run.id: run.mean_temperature() or np.nan for run in runs}
    slowest = min((run.point.shaft_speed for run in runs), default=0.0)
    cold = [temperature[run.id] for run in runs if run.point.shaft_speed == slowest]
    warm = np.fmin.reduce(cold, initial=np.nan) + _SAME_TEMPERATURE
    # a temperature that nobody measured does not rule a sweep out
    return sorted(runs, key=lambda run: (run.point.shaft_speed, temperature[run.id] > warm, run.point.static_load))


def _of_pads(numbers: Sequence[int]) -> str:
    return f" of pads {', '.join(f'#{number}' for number in numbers)}"


def _status(fit: SideFit, polygon: ClearancePolygon, curves: Sequence[PivotCurve]) -> Conditions:
    """Named conditions of the sides and of the clearances."""
    others = (fit.pads[untested(curves, fit.pads)] + 1).tolist()
    pads = "" if len(others) == len(fit.pads) else _of_pads(others)
    missing = ", ".join(str(k + 1) for k in np.flatnonzero(np.isnan(polygon.clearance)))
    disagrees = abs(fit.scale - 1.0) > max(_IRREGULAR * fit.scale_se, _DISAGREES)
    give = f"they deflect {fit.scale:.2f} (se {fit.scale_se:.2f}) of what the dry tests say"
    offsets = polygon.clearance - np.nanmedian(polygon.clearance)
    # below half a micrometre a difference between pads is of no consequence, however well it is measured
    deviating = np.flatnonzero(np.abs(offsets) > np.maximum(_IRREGULAR * polygon.clearance_error, 0.5e-6))
    listed = _offsets(deviating, offsets[deviating])
    turn = np.mean(fit.tilt)
    is_turned = abs(turn) > max(_IRREGULAR * np.sqrt(np.mean(fit.tilt_se**2) / len(fit.pads)), 5e-3)
    return holding(
        (missing, "pads-not-reached", missing),
        (others, "give-from-sweep", f"no pivot curves{pads}, zero load extrapolated from the sweep alone"),
        (disagrees, "pivots-disagree", give),
        (listed, "irregular", f"{listed} from the median of all: worn, damaged or wrongly assembled"),
        (is_turned, "frame-turned", f"all sides by {np.degrees(turn):+.2f} deg"),
        (fit.misfit > 4.0, "misfit", "the scatter exceeds the noise"),
    )


def _offsets(pads: IntArray, offsets: FloatArray) -> str:
    """How far pads (k,) from 0 stand off, (k,) [m], in words."""
    return ", ".join(f"pad #{pad + 1} {1e6 * offset:+.1f} µm" for pad, offset in zip(pads, offsets, strict=True))


def _inseparable(fit: SideFit, centre: Centre, gains: FloatArray) -> Conditions:
    """What the sides leave open of which pads deviate, with what gains (n, p) make of distances, as a share."""
    error = np.sqrt(np.trace(fit.covariance) + np.sum((gains[fit.pads] * centre.clearance) ** 2))
    text = ""
    if len(fit.pads) == 3:
        text = "three pads fit every centre: equal clearances are assumed, only their mean is measured"
    elif centre.doubt.any():
        text = "all pads may be off as they are made: a centre elsewhere, with other deviations, fits the sweep as well"
    elif np.abs(centre.suspects).max() > max(_IRREGULAR * error, 0.5e-6):
        text = f"one of four is off, and nothing tells which: {_offsets(fit.pads, centre.suspects)}"
    return holding((text, "pads-not-separable", text))


def pairs_frame(base: ClearancePolygon, others: Sequence[ClearancePolygon]) -> pd.DataFrame:
    """Every other polygon against one: `clearance_pairs.csv`, one row per pad.

    The change of the clearance at zero load, as from cold to hot, and where the pushes differ alone the pivots' secant
    between them; each about its own centre, since a zero that drifted between the runs is no deflection.
    """
    import pandas as pd

    frames = []
    for polygon in others:
        light, heavy = sorted((base, polygon), key=lambda p: p.push_load)
        # one speed and one temperature, or nobody knows better
        warmer = abs(base.temperature - polygon.temperature) > _SAME_TEMPERATURE
        same = base.point.spin == polygon.point.spin and not warmer
        columns: dict[str, object] = {
            "run": polygon.run,
            "against": base.run,
            "compared": "push load" if same else "condition",
            "pad": np.arange(1, len(base.angles) + 1),
            "change_m": polygon.clearance - base.clearance,
            "change_m_se": np.hypot(base.clearance_se, polygon.clearance_se),
        }
        rise = heavy.push_load - light.push_load
        if same and rise > _RISE * light.push_load:
            deflection = heavy.clearance_pushed - light.clearance_pushed
            relative_se = np.hypot(heavy.clearance_pushed_se, light.clearance_pushed_se) / np.abs(deflection)
            stiffness = rise / deflection
            load = 0.5 * (heavy.push_load + light.push_load)
            columns |= {"load_N": load, TANGENT: stiffness, f"{TANGENT}_se": np.abs(stiffness) * relative_se}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)
