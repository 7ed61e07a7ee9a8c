"""The measurement equation z = T B(h) u: what probes, cells, accelerometers and the housing make of the true motion.

Rows are the sensors and two equations of the housing; columns the true displacement d and the housing's acceleration a,
free in every block::

    probe j           (  n_j^T       ,  0         )
    cell j            (  n_j^T h     , -m n_j^T   )       F_cell = F_oil - m a, Eq. (13); h with the bare rig's
    accelerometer j   (  0           ,  n_j^T     )
    housing, cells    (  w^2 C h     ,  I - w^2 m C )     a + w^2 C F_cell = 0: it stands on its cells
    housing, floating (-w^2 (kappa + C h), I      )       a = w^2 d: it hangs, and the shaft gives way by C

With C the compliance of the cells, [c_xx c_xy; c_xy c_yy] (1 - i loss), or of the shaft under a floating housing, whose
kappa is one but for wrong sensors. Where no accelerometer tells and the manifest does not say, kappa is not known: 0 of
a housing that stands still, 1 of one that floats.

A block is one run at one excitation line: one phasor per channel with the covariance of its noise, all blocks stacked.
Every channel keeps a row of its own, so that a gain, a delay or a clock is a factor of one row, and a channel that is
dead is a row that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from rigdata.vector import Directed, directions, levers, plane_vector
from tpjb_ident.conditions import Conditions


@dataclass(frozen=True)
class Sensor(Channel):
    """A channel as the equation knows it, with the axis that the campaign has; a run's own counts in its blocks."""

    corner_uncertainty: float = 0.0  #: Hz: of a low corner that nobody states, one deviation

    def doubted(self, gain: float = 0.0, turn: float = 0.0, corner: float = 0.0) -> Sensor:
        """The sensor, its gain, axis [rad] and low corner [Hz] known no better than this."""
        uncertainty, corner = max(self.uncertainty or 0.0, gain) or None, max(self.corner_uncertainty, corner)
        turn = max(self.axis_uncertainty, turn)
        return replace(self, uncertainty=uncertainty, axis_uncertainty=turn, corner_uncertainty=corner)


@dataclass(frozen=True)
class RigStiffness:
    """Dynamic stiffness of the rig without its bearing, at F frequencies: what hoses, seals and cables carry."""

    omega: FloatArray = field(default_factory=lambda: np.zeros(0))  #: (F,), rad/s, rising
    h: ComplexArray = field(default_factory=lambda: np.zeros((0, 2, 2), complex))  #: (F, 2, 2), N/m
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 8, 8)))  #: (F, 8, 8), (N/m)^2

    def weights(self, omega: FloatArray) -> FloatArray:
        """Weights of the frequencies at `omega` (n,), linear between them, (n, F); zero where it is not known."""
        rows = [np.interp(omega, self.omega, one) for one in np.eye(len(self.omega))]
        return np.reshape(rows, (len(self.omega), len(omega))).T * self.known(omega)[:, None]

    def known(self, omega: FloatArray) -> BoolArray:
        """Whether the rig was measured about `omega` (n,), (n,)."""
        if not len(self.omega):
            return np.zeros(len(omega), dtype=bool)
        return (omega >= 0.98 * self.omega[0]) & (omega <= 1.02 * self.omega[-1])

    def at(self, omega: FloatArray) -> ComplexArray:
        """H at `omega` (n,), (n, 2, 2) [N/m]; zero where it is not known."""
        return np.einsum("nf,fij->nij", self.weights(omega), self.h)


@dataclass(frozen=True, repr=False)
class Rig(Directed):
    """Sensors in the order of the rows, and the housing that they stand on."""

    channels: tuple[Sensor, ...]
    mass: float
    mass_uncertainty: float = 0.0
    mount: str = "cells"  #: "cells", "floating", or "unknown": no accelerometer tells
    #: by term: what its test said of sensors that are since taken as uncertain as it showed them
    contradicted: Mapping[str, Conditions] = field(default_factory=dict)
    #: by term and parameter: deviation of those that the records contradict, as far off as they show them
    widened: dict[tuple[str, str], float] = field(default_factory=dict)
    runs: tuple[str, ...] = ()  #: names of the dynamic runs, in the order of the campaign
    #: by run and sensor: deviation of a gain that is another one there
    off: Mapping[tuple[str, str], float] = field(default_factory=dict)
    bare: RigStiffness = field(default_factory=RigStiffness)
    static: bool = True  #: whether the cells show the static load
    to_set_point: bool = True  #: whether H is that at the set points, not at the runs' own loads
    #: of the clocks of devices, relative: put right in the readings before they became phasors
    rates: Mapping[str, float] = field(default_factory=dict)
    #: whether accelerometers lead what the springs under the housing make of the cells' force
    out_of_step: bool = False

    @property
    def has_acceleration(self) -> bool:
        """Whether accelerometers may tell the housing's acceleration."""
        return len(self.pick("acceleration")) > 1

    @property
    def along(self) -> FloatArray:
        """Unit vectors of the sensors' axes, (m, 2)."""
        return directions([sensor.axis or 0.0 for sensor in self.channels])

    @property
    def spare(self) -> BoolArray:
        """Whether a sensor is one of more than two of its quantity, (m,): they tell what is wrong with one of them."""
        return np.array([len(self.pick(sensor.quantity)) > 2 for sensor in self.channels])

    def __len__(self) -> int:
        return len(self.channels)


@dataclass(frozen=True)
class Blocks:
    """All blocks of a campaign, n of them, with m sensors each."""

    points: tuple[OperatingPoint, ...]
    runs: tuple[str, ...]
    point: IntArray  #: (n,): place in `points`
    run: IntArray  #: (n,): place in `runs`
    omega: FloatArray  #: (n,), rad/s: of the line found
    z: ComplexArray  #: (n, m), SI: phasors; 0 where a sensor gives none
    present: BoolArray  #: (n, m)
    along: FloatArray  #: (n, m, 2): unit vectors of the sensors' axes
    calibration: IntArray  #: (n, m): which of its sensor's calibrations a reading was made with
    noise: ComplexArray  #: (n, m, m): covariance of z
    dof: FloatArray  #: (n,): degrees of freedom of the noise, those of its point
    slope: ComplexArray  #: (n, m), 1/s: change of z over time
    slope_noise: ComplexArray  #: (n, m, m): its covariance
    windows: FloatArray  #: (n,): effective number of windows
    time: FloatArray  #: (n,), s: middle of the windows
    temperature: FloatArray  #: (n,), K: of the run; NaN where not known
    film_temperature: FloatArray  #: (n,), K: likewise
    miss: ComplexArray  #: (n,): static load against its set point, relative size + i turn [rad]
    miss_error: FloatArray  #: (n,): standard error of the run's own mean load, relative
    shaft: ComplexArray  #: (n,): unit phasor of what turns with the shaft; NaN where the line is not the shaft's
    uneven: FloatArray  #: (n, 2): scatter of the film's force along X and Y that no repeat averages away, relative
    gain_scatter: FloatArray  #: (n,): of its run's gain, relative: what all lines of a run have in common
    bent: FloatArray  #: (P,): share of H by which the motion may change it, by the film's harmonics or as stated
    band: IntArray  #: (P,): number of the band whose lines share that; -1 of a point by itself

    def __len__(self) -> int:
        return len(self.point)

    @property
    def usual_omega(self) -> float:
        """Median frequency of the blocks [rad/s]; one where there are none."""
        return float(np.median(self.omega)) if len(self) else 1.0

    def noise_power(self, rows: list[int]) -> FloatArray:
        """Sum of the noise's variances of some sensors, (n,)."""
        return np.einsum("njj->n", self.noise[:, rows][:, :, rows]).real

    def part(self, places: slice | IntArray) -> Blocks:
        """Some of the blocks."""
        stacked_names = [f.name for f in fields(self) if f.name not in ("points", "runs", "bent", "band")]
        return replace(self, **{name: getattr(self, name)[places] for name in stacked_names})


def stacked(
    points: Sequence[OperatingPoint],
    runs: Sequence[str],
    sensors: int,
    rows: Sequence[Mapping[str, Any]],
    bent: FloatArray | None = None,
    band: IntArray | None = None,
) -> Blocks:
    """Blocks of rows, each what is known of it by name; one that is said nothing else of is a single still window."""
    none = np.zeros(sensors)
    usual: dict[str, Any] = {
        "point": 0,
        "run": 0,
        "omega": 0.0,
        "z": none + 0j,
        "noise": np.diag(none) + 0j,
        "dof": 1.0,
        "present": none > 0,
        "along": np.zeros((sensors, 2)),
        "calibration": none.astype(int),
        "slope": none + 0j,
        "slope_noise": np.eye(sensors) + 0j,
        "windows": 1.0,
        "time": 0.0,
        "temperature": np.nan,
        "film_temperature": np.nan,
        "shaft": np.nan + 0j,
        "uneven": np.zeros(2),
        "gain_scatter": 0.0,
        "miss": 0j,
        "miss_error": 0.0,
    }
    columns: dict[str, Any] = {
        "bent": np.zeros(len(points)) if bent is None else bent,
        "band": np.full(len(points), -1) if band is None else band,
    }
    for name, value in usual.items():
        column = np.array([row.get(name, value) for row in rows], np.asarray(value).dtype)
        columns[name] = column.reshape(-1, *np.shape(value))
    return Blocks(tuple(points), tuple(runs), **columns)


def vector(rig: Rig, blocks: Blocks, quantity: str) -> ComplexArray:
    """X and Y of a quantity by least squares over its sensors, (n, 2); NaN without two directions."""
    rows = rig.pick(quantity)
    readings = np.where(blocks.present[:, rows], blocks.z[:, rows], np.nan)
    return plane_vector(blocks.along[:, rows], readings, levers([rig.channels[j] for j in rows]))


def film_force(rig: Rig, blocks: Blocks) -> ComplexArray:
    """X and Y of the force of the film (n, 2), without the housing's inertia where accelerometers measure it."""
    force = vector(rig, blocks, "force")
    if not rig.has_acceleration:
        return force
    return force + rig.mass * np.nan_to_num(vector(rig, blocks, "acceleration"))


def adjoint(matrices: Any) -> Any:
    """Conjugate transposes of matrices (n, k, m), (n, m, k)."""
    return matrices.conj().transpose(0, 2, 1)


def totals(place: IntArray, values: FloatArray | BoolArray, number: int) -> FloatArray:
    """Sums of values (n, ..) by place (n,), (number, ..)."""
    sums = np.zeros((number, *values.shape[1:]))
    np.add.at(sums, place, values)
    return sums


#: Equations of the housing.
HOUSING_ROWS = 2
#: Unknowns of a block: d and a, X and Y each.
UNKNOWNS = 4


@dataclass
class State:
    """The last iterate of the solve, for one set of blocks (n of them, m sensors, P points)."""

    h: ComplexArray  #: (P, 2, 2), N/m: at the set points
    slope: ComplexArray  #: (P, 2, 2), N/m: dH / d ln W
    slope_known: np.ndarray  #: (P,) bool
    compliance: ComplexArray  #: (2, 2), m/N: of the cells under the housing, or (n, 2, 2) of a floating one's shaft
    floating: ComplexArray  #: (2, 2) or (n, 2, 2): kappa
    factor: ComplexArray  #: (n, m): T
    shift: ComplexArray  #: (n, m + 2): s, what does not go with the motion
    u: ComplexArray  #: (n, 4): true motion
    bare: ComplexArray  #: (n, 2, 2), N/m: the rig beside the film
    parameters: dict[str, FloatArray] = field(default_factory=dict)  #: by term

    def at_run(self, blocks: Blocks) -> ComplexArray:
        """H of every block at its run's own load, what the rig carries beside the film with it, (n, 2, 2)."""
        known = self.slope_known[blocks.point][:, None, None]
        change = blocks.miss.real[:, None, None] * self.slope[blocks.point]
        return self.h[blocks.point] + np.where(known, change, 0.0) + self.bare

    def reading(self, rig: Rig, blocks: Blocks) -> ComplexArray:
        """T B u, (n, m + 2)."""
        return np.einsum("nri,ni->nr", with_factor(self.factor, motion_matrix(rig, blocks, self)), self.u)


def motion_matrix(rig: Rig, blocks: Blocks, state: State) -> ComplexArray:
    """B of every block, (n, m + 2, 4)."""
    n, m = blocks.z.shape
    B = np.zeros((n, m + HOUSING_ROWS, UNKNOWNS), complex)
    h, along = state.at_run(blocks), blocks.along
    probes, cells, accelerometers = (rig.pick(q) for q in ("displacement", "force", "acceleration"))
    B[:, probes, :2] = along[:, probes]
    B[:, cells, :2] = along[:, cells] @ h
    B[:, cells, 2:] = -rig.mass * along[:, cells]
    B[:, accelerometers, 2:] = along[:, accelerometers]
    B[:, m:] = housing_rows(rig, blocks, state, h)
    B[:, :m][~blocks.present] = 0.0
    return B


def housing_rows(rig: Rig, blocks: Blocks, state: State, h: ComplexArray) -> ComplexArray:
    """Rows of the housing, (n, 2, 4); `h` (n, 2, 2) of the runs."""
    square = (blocks.omega**2)[:, None, None]
    if rig.mount == "cells":
        moved, own = square * (state.compliance @ h), square * rig.mass * state.compliance
    else:
        moved, own = -square * (state.floating + state.compliance @ h), np.zeros_like(h)
    return np.concatenate([moved, np.eye(2) - own], axis=2)


def with_factor(factor: ComplexArray, B: ComplexArray) -> ComplexArray:
    """T B; `factor` (n, m) on the sensors' rows of B (n, m + 2, ..)."""
    result = B.copy()
    m = factor.shape[1]
    result[:, :m] *= factor.reshape(factor.shape + (1,) * (B.ndim - 2))
    return result


def film_columns(rig: Rig, blocks: Blocks, state: State) -> ComplexArray:
    """d(T B u) / d(h_xx, h_xy, h_yx, h_yy), complex, (n, m + 2, 4): h at the set point moves h at the run's load."""
    n = len(blocks)
    h = state.h[blocks.point]
    known = blocks.miss.real * state.slope_known[blocks.point]
    size = np.where(h.real == 0.0, 1.0, h.real)
    power = np.clip(state.slope[blocks.point].real / size, -2.0, 2.0)
    growth = 1 + known[:, None, None] * power
    return film_change_rows(rig, blocks, state, entry_changes(growth.reshape(n, 4)))


def entry_changes(size: ComplexArray | FloatArray) -> ComplexArray:
    """Changes of H by single entries xx, xy, yx, yy, over and over, `size` (n, k) each, (n, k, 2, 2)."""
    entries = np.tile(np.eye(4).reshape(4, 2, 2), (size.shape[1] // 4, 1, 1))
    return np.asarray(size[:, :, None, None] * entries, complex)


def entry_sizes(h: ComplexArray) -> ComplexArray:
    """Sizes of the eight numbers of H (n, 2, 2), those of Im h times i, (n, 8)."""
    return np.concatenate([np.abs(h.real), 1j * np.abs(h.imag)], axis=1).reshape(len(h), 8)


def film_change_rows(rig: Rig, blocks: Blocks, state: State, changes: ComplexArray) -> ComplexArray:
    """Changes of H (n, k, 2, 2) in the readings, by their forces at the motion, (n, m + 2, k)."""
    return film_force_rows(rig, blocks, state, np.einsum("nkij,nj->nik", changes, state.u[:, :2]))


def film_force_rows(rig: Rig, blocks: Blocks, state: State, force: ComplexArray) -> ComplexArray:
    """Forces of the film (n, 2, ..) as the cells read them and the housing answers, (n, m + 2, ..)."""
    n, m = blocks.z.shape
    rows = np.zeros((n, m + HOUSING_ROWS, *force.shape[2:]), complex)
    cells = rig.pick("force")
    seen = blocks.along[:, cells] * (state.factor * blocks.present)[:, cells, None]
    rows[:, cells] = np.einsum("nja,na...->nj...", seen, force)
    square = (blocks.omega**2).reshape((-1,) + (1,) * (force.ndim - 1))
    sign = 1.0 if rig.mount == "cells" else -1.0
    rows[:, m:] = sign * square * np.einsum("nij,nj...->ni...", np.broadcast_to(state.compliance, (n, 2, 2)), force)
    return rows


#: Distance of a / (w^2 d) from what it is of a floating housing, on both axes, within which the housing floats.
_FLOATS = 0.3
#: Motion of a floating housing's shaft over that of the housing, at most.
_SHAFT = 0.4
#: Cells over set points between which the cells carry the static load.
_CARRIED = (0.5, 2.0)
#: A sensor whose phasors are below this share of its quantity's is dead.
_NOTHING = 1e-6
#: Gain uncertainty of a sensor of more than two for which the manifest states none, as `[tolerances] probe_gain` has
#: it: what such sensors tell of one another needs one.
_USUAL_GAIN = 0.005
#: Low corners that are plausible where none is stated, by quantity, one deviation [Hz]: see `terms.corner`.
CORNERS = {"force": 0.5, "acceleration": 1.0}


def sensors_of(campaign: Campaign) -> tuple[Sensor, ...]:
    """Probes, cells and accelerometers of a campaign's dynamic runs."""
    channels = dict(campaign.channels)
    for run in campaign.of_kind("dynamic"):
        channels = dict(run.channels) | channels
    sensors = []
    for quantity in VECTOR_QUANTITIES:
        alike = [channel for channel in channels.values() if channel.quantity == quantity and channel.axis is not None]
        unstated = _USUAL_GAIN if len(alike) > 2 else None
        for channel in alike:
            stated = vars(channel)
            if channel.uncertainty is None:
                stated = stated | {"uncertainty": unstated}
            # with a filter that ends at a low corner, or a measured response, it is known
            corner = all(getattr(filtered, "side", "high") != "high" for filtered in channel.response.filters)
            sensors.append(Sensor(**stated, corner_uncertainty=CORNERS.get(quantity, 0.0) * corner))
    return tuple(sensors)


def alive(sensors: Sequence[Sensor], size: FloatArray, least: float = _NOTHING) -> BoolArray:
    """Which sensors show something of what the largest of their quantity does, (m,); `size` (m,) of their phasors."""
    quantities, size = np.array([sensor.quantity for sensor in sensors]), np.nan_to_num(size)
    largest = [size[quantities == quantity].max() for quantity in quantities]
    return np.asarray(size > least * np.array(largest), dtype=bool)


def axes_of(channels: Sequence[Channel | None]) -> FloatArray:
    """Unit vectors of the axes (m, 2); zero where a run has no such channel."""
    rows = [(0.0, 0.0) if c is None else (np.cos(c.axis or 0.0), np.sin(c.axis or 0.0)) for c in channels]
    return np.array(rows)


def campaign_rig(campaign: Campaign, doubted: Sequence[tuple[str, FloatArray]] = (), **known: Any) -> Rig:
    """The rig of a campaign's dynamic runs as stated; `known`: what else is of it, by name.

    `doubted`: names of sensors, with deviations of gain, axis [rad] and corner [Hz] that are known no better.
    """
    sensors = sensors_of(campaign)
    for name, deviations in doubted:
        sensors = tuple(s.doubted(*deviations) if s.name == name else s for s in sensors)
    runs = tuple(run.id for run in campaign.of_kind("dynamic"))
    return Rig(sensors, campaign.housing_mass, campaign.mass_uncertainty, runs=runs, **known)


def mounted(rig: Rig, blocks: Blocks, stated: str | None, ratio: complex) -> Rig:
    """The rig on what it stands on; `ratio`: cells over set points of all runs, zero where they show none."""
    return replace(rig, mount=found_mount(rig, blocks, stated, ratio), static=ratio != 0)


def found_mount(rig: Rig, blocks: Blocks, stated_mount: str | None, ratio: complex) -> str:
    """Whether the housing stands on its cells or floats: as stated, else by a over w^2 d.

    That is -c h of a housing on springs, 1 + g h of one that floats, c and g the compliance of what gives way. Without
    accelerometers cells tell that carry the static load (`ratio`: cells over set points of all runs): the housing
    stands on them. Cells of a floating stator show none; then it is "unknown".
    """
    if stated_mount:
        return stated_mount
    carried = "cells" if _CARRIED[0] < abs(ratio) < _CARRIED[1] else "unknown"
    if not rig.has_acceleration:
        return carried
    d, force, a = (vector(rig, blocks, quantity) for quantity in VECTOR_QUANTITIES)
    usable = np.isfinite(np.hstack([d, force, a])).all(axis=1)
    if not usable.any():
        return carried
    square = (blocks.omega[usable] ** 2)[:, None]
    d, force, a = square * d[usable], square * force[usable], a[usable]
    power = np.maximum(np.sum(np.abs(d) ** 2, axis=0), 1e-300)
    quotient, h = np.sum(d.conj() * a, axis=0) / power, np.sum(d.conj() * force, axis=0) / power
    standing, floating = _remainder(-quotient, h, np.inf), _remainder(quotient - 1, h, _SHAFT)
    return "floating" if floating.max() < _FLOATS and floating.sum() < standing.sum() else "cells"


def _remainder(share: ComplexArray, h: ComplexArray, most: float) -> FloatArray:
    """What a compliance times h (2,), nought to `most`, leaves of a share of the motion (2,)."""
    along = h / np.maximum(np.abs(h), 1e-300)
    return np.abs(share - np.clip((share * along.conj()).real, 0.0, most) * along)
