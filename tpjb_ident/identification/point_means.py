"""The windows of one operating point: a robust start of H, and one phasor per run and channel."""

from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.equation import Rig, alive
from tpjb_ident.estimate.window_means import Readings, WindowMeans, attenuation, motion_in, window_means
from tpjb_ident.estimators.least_trimmed import mm_fit, within_directions
from tpjb_ident.estimators.r_matrix import PhasorTable, displacement_condition, phasor_table
from tpjb_ident.phasors.frequency import shaft_order
from tpjb_ident.phasors.run_data import by_channel, places_of
from tpjb_ident.runs.point_data import PointData
from tpjb_ident.terms.shaft import SHAFT_FITTED, not_told

#: Share of the windows of a run's best channel in which a channel has a phasor, at least, to count as recorded.
_LEAST_WINDOWS = 0.4
#: Condition number of the displacement directions from which one direction is missing.
_ONE_LINE = 1e6


@dataclass(frozen=True, repr=False)
class PointMeans:
    """What the windows of a point say before the solve."""

    start: ComplexArray  #: (2, 2), N/m: NaN where the windows give none
    means: WindowMeans | None
    channels: tuple[tuple[Channel | None, ...], ...]  #: (g, m): None where a run says nothing of a sensor
    condition: float
    residual: tuple[float, ComplexArray]  #: degrees of freedom of the noise and its density (m, m)
    status: Conditions = ()
    shaft: ComplexArray = field(default_factory=lambda: np.empty(0, complex))  #: (g,): NaN where it is not on the line
    shaft_conditions: Conditions = ()


def point_means(rig: Rig, data: PointData) -> PointMeans:
    """Robust start and means of one point."""
    z, channels = channel_windows(data, rig)
    present = []
    for run in channels:
        present.append([channel is not None for channel in run])
    D, F = vectors(z, data, rig)
    table = phasor_table(D, F, data.run_index)
    weights, start, status = _robust_start(table)
    film = _film(rig, data.mass)
    readings = Readings([sensor.clock for sensor in rig.channels], film)
    means = window_means(z, data.run_index, _window_times(data), readings, weights, np.array(present))
    condition = displacement_condition(table.D, weights[table.valid])
    shaft, conditions = _shaft(data, means, rig)
    residual = _residual_density(data, rig, means, film)
    return PointMeans(start, means, channels, condition, residual, status, shaft, conditions)


def _film(rig: Rig, mass: float) -> FloatArray:
    """Displacements and oil forces as the sensors see them, of their readings, (m, m)."""
    film = np.diag([float(sensor.quantity != "acceleration") for sensor in rig.channels])
    cells, accelerometers = rig.pick("force"), rig.pick("acceleration")
    if len(accelerometers) > 1:
        inertia = mass * rig.along[cells] @ np.linalg.pinv(rig.along[accelerometers])
        film[np.ix_(cells, accelerometers)] = inertia
    return film


def _residual_density(
    data: PointData, rig: Rig, means: WindowMeans | None, film: FloatArray
) -> tuple[float, ComplexArray]:
    """Noise of a phasor times the length of its fit (m, m), by what lines leave of the records, after its freedom."""
    m = len(rig.channels)
    rows = [np.zeros((0, m), complex)]
    for run, line in zip(data.runs, data.lines):
        if line < len(run.residual):
            bins = by_channel(run.residual[line], run.channels, rig.channels)
            rows.append(np.sqrt(len(run.start) * run.length) * bins[np.isfinite(bins).all(axis=1)])
    bins = np.concatenate(rows)
    if means is not None:
        bins = bins - motion_in(bins, np.ones(len(bins)), means.mean, film)
    freedom = float(len(bins))
    return freedom, bins.T @ bins.conj() / max(freedom, 1.0)


def _shaft(data: PointData, means: WindowMeans | None, rig: Rig) -> tuple[ComplexArray, Conditions]:
    """Unit phasor of what turns with the shaft in every run (g,), where the runs tell it from the motion."""
    none = np.full(len(data.runs), np.nan + 0j)
    first = data.runs[0].lines
    order = shaft_order(first.excitation[data.lines[0]].frequency, first.speed)
    name = f"{order}X on excitation line"
    if not order or not data.says(name):
        return none, ()
    s = np.array([run.shaft_phase[i] if len(run.shaft_phase) else np.nan for run, i in zip(data.runs, data.lines)])
    motion = np.full((len(data.runs), 2), np.nan + 0j)
    if means is not None:
        motion = rig.plane("displacement", means.mean)
    reason = not_told(order, s, motion)
    if reason:
        return none, (Condition(name, f"what turns with the shaft cannot be told from the motion: {reason}"),)
    text = f"what turns with the shaft is told from the motion by the shaft's phase in {len(s)} runs"
    return s, (Condition(SHAFT_FITTED, text),)


def channel_windows(data: PointData, rig: Rig) -> tuple[ComplexArray, tuple[tuple[Channel | None, ...], ...]]:
    """Phasors of the windows channel by channel (n, m), NaN where there is none, and the channels of each run (g, m).

    What clocks run ahead is off it.
    """
    z = np.full((len(data.run_index), len(rig.channels)), np.nan + 0j)
    for g, (run, line) in enumerate(zip(data.runs, data.lines)):
        phasors = by_channel(run.z[:, line], run.channels, rig.channels)
        least = _LEAST_WINDOWS * np.isfinite(run.z[:, line]).mean(axis=0).max(initial=0.0)
        # in more than a share of the windows, and not zeros throughout
        usable = (np.isfinite(phasors).mean(axis=0) > least) & np.nan_to_num(phasors).any(axis=0)
        z[data.run_index == g] = np.where(usable, phasors, np.nan)
    # channels that show nothing of what others of their quantity do
    z[:, ~alive(rig.channels, np.abs(np.nan_to_num(z)).max(axis=0, initial=0.0))] = np.nan
    living = []
    for g, run in enumerate(data.runs):
        shown = zip(places_of(rig.channels, run.channels), np.isfinite(z[data.run_index == g]).any(axis=0))
        living.append(tuple(run.channels[k] if is_shown else None for k, is_shown in shown))
    # how far the devices' clocks have run ahead
    rates = [rig.rates.get(sensor.clock, 0.0) for sensor in rig.channels]
    omega = 2 * np.pi * np.array([r.lines.driven[i] for r, i in zip(data.runs, data.lines)])
    ahead = np.multiply.outer(omega[data.run_index] * _window_times(data), rates)
    return z * np.exp(1j * ahead), tuple(living)


def vectors(z: ComplexArray, data: PointData, rig: Rig) -> tuple[ComplexArray, ComplexArray]:
    """Displacement and oil force of channels' phasors (n, m), (n, 2) each, from the sensors that have one."""
    inertia = np.nan_to_num(data.mass * rig.plane("acceleration", z))
    return rig.plane("displacement", z), rig.plane("force", z) + inertia


def _window_times(data: PointData) -> FloatArray:
    """Middles of the windows of all runs, (n,) [s]."""
    return np.concatenate([run.start + 0.5 * run.length for run in data.runs])


def _robust_start(table: PhasorTable) -> tuple[FloatArray, ComplexArray, Conditions]:
    """Weights (n,) of all given windows, H (2, 2) and the start's conditions."""
    weights = np.zeros(len(table.valid))
    none = np.full((2, 2), np.nan + 0j)
    if len(table) < 3 or table.n_directions < 2 or not displacement_condition(table.D) < _ONE_LINE:
        weights[table.valid] = 1.0
        return weights, none, ()
    fit = mm_fit(table.D, table.F, table.direction, tolerance=1e-7)
    weights[table.valid] = within_directions(fit.weights, table.direction)
    # few windows have no robust start; their runs are judged beside those of the other points all the same
    conditions = tuple(c for c in fit.conditions if c != "no-robust-start")
    return weights, fit.coefficients * table.h_scale, conditions


def means_attenuation(means: WindowMeans, rig: Rig) -> FloatArray:
    """Noise over total power of the displacements, (2,)."""
    rows = rig.pick("displacement")
    plane = np.linalg.pinv(rig.along[rows])
    noise = plane @ means.noise[np.ix_(rows, rows)] @ plane.T
    return attenuation(means.mean[:, rows] @ plane.T, means.count, noise)
