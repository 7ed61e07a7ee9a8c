"""Dynamic coefficients, Eq. (9)-(12): the pads' full matrices and their reduction at the excitation frequency.

Per pad, in (x, y, theta, eta), the film gives Z = K + i omega C by J^T Z_film J with the film's own 2 x 2
matrices in (a, b) and J = d(a, b)/d(x, y, theta, eta). Pad mass, inertia, k_theta, c_eta and the pivot's tangent
stiffness stand on the pad's diagonal, Eq. (12); eliminating (theta, eta) gives the 2 x 2 of Eq. (10). Signs are
those of `docs/theory.md`: the force on the housing, dF = +h d.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from model.conditions import named
from model.film.faces import conductances
from model.film.following_heat import heat_impedance
from model.film.slopes import shape_slopes, squeeze_slopes
from model.mirror import MIRROR
from model.pad.bending import force_weights
from model.setup import Setup
from model.statics.compiled.bending import axial_levers, axial_shape
from model.statics.equilibrium import Equilibrium
from model.statics.pad_film import PadFilm
from model.tilt_hold import friction_limits, held_moment, hold_numbers
from rigdata.arrays import ComplexArray, FloatArray
from rigdata.problem import Condition

#: Turns of pressure and deformation at most, and the share of a deformation, or of a temperature, at which turns end.
_MOST_TURNS, _SETTLED = 40, 1e-7
#: A pivot this stiff lets eta take no part [N/m].
_RIGID = 1e30
_UNIT = np.eye(2)
#: Halvings of the amplitude with which a pivot with friction vibrates.
_HALVINGS = 60
#: A pad on a sphere that follows a shaft that leans has one more tilt, about the axis across it through its pivot: what
#: a unit of it adds to h, (nt + 1, nz + 1) [m/rad]; its moment by the pressure at the film's unknown nodes, less what
#: grows with the pad's load, (unknowns,) [m^3]; its stiffness [N m/rad] and inertia [kg m^2].
AxialTilt = tuple[FloatArray, FloatArray, float, float]
#: Conditions of pads whose pivots rub.
_HELD = "pivot friction holds pads {pads}"
_LOOSE = "vibration of {number:g} um breaks the pivots of pads {pads} loose"


def flexing_impedance(film: PadFilm, omega: FloatArray, factor: float, axial: AxialTilt | None = None) -> ComplexArray:
    """What bending and axial tilting with the motion add to a film's impedance.

    The perturbation of the baseline moves pads as rigid bodies. Here a pad's deformation w is an internal degree of
    freedom, as tilt and deflection are. With S_ab and S_w the film's complex pressure slopes at the excitation
    frequency by (a, b) and by its shape, C the pad's compliance (its own mass is left out: a pad's first bending
    mode lies at kilohertz) and W what pressure pushes with,

        p' = S_ab (a, b)' + S_w w',    w' = C p',    F' = W p'.

    The pad's softest shapes are solved at once, the rest follows in a few turns, as in an equilibrium. At rest this
    is the slope of the static locus with pads that bend; for a stiff pad it is the rigid one. A pad's axial tilt
    (`AxialTilt`) is one more column of S_ab, and leaves by its own equation of motion about the
    pivot.

    `omega` (n,) [rad/s].
    """
    weights = force_weights(film.grid)
    conductance = conductances(film.grid, film.work, film.wedge)

    def slopes(shapes: Any) -> tuple[Any, Any]:
        return shape_slopes(film.grid, film.work, conductance, shapes), squeeze_slopes(film.grid, film.work, shapes)

    still, moving = film.work.slopes[:, :2], film.work.slopes[:, 2:4]
    if axial is not None:
        shape, levers, stiffness, inertia = axial
        columns = slopes(shape[:, :, None])
        still, moving = np.hstack([still, columns[0]]), np.hstack([moving, columns[1]])
    softest = slopes(film.deformation.shapes) if factor and film.deformation is not None else None
    out = np.empty((len(omega), 2, 2), dtype=np.complex128)
    for k, w in enumerate(omega.tolist()):
        pressure = rigid = still + 1j * w * moving
        if softest is not None:
            pressure = _bent_pressure(film, factor, slopes, softest, rigid, w)
        out[k] = weights @ (pressure - rigid)[:, :2]
        if axial is not None:
            moment = levers @ pressure
            pad_impedance = stiffness - inertia * w * w - moment[2]
            out[k] += np.outer(weights @ pressure[:, 2], moment[:2]) / pad_impedance
    return out


def _bent_pressure(
    film: PadFilm, factor: float, slopes: Callable[[Any], Any], softest: Any, rigid: ComplexArray, omega: float
) -> ComplexArray:
    """Pressure (unknowns, m) with a pad that bends, from that with a rigid one; NaN where it finds no rest."""
    body, grid = film.deformation, film.grid
    assert body is not None
    closed = np.eye(len(body.response)) - factor * (body.response @ (softest[0] + 1j * omega * softest[1]))
    pressure = rigid
    bent = np.zeros((*film.work.pressure.shape, rigid.shape[1]), dtype=np.complex128)
    for _ in range(_MOST_TURNS):
        field = np.pad(pressure.reshape(len(bent) - 2, -1, rigid.shape[1]), ((1, 1), (grid.first, 1), (0, 0)))
        target = factor * (body.compliance @ field.reshape(-1, rigid.shape[1]))
        missing = target - bent.reshape(target.shape)
        if not np.abs(missing).max() > _SETTLED * np.abs(target).max():
            return pressure
        amplitudes = body.amplitudes @ missing
        bent += missing.reshape(bent.shape) + body.shapes @ (np.linalg.solve(closed, amplitudes) - amplitudes)
        still, moving = slopes(bent)
        pressure = rigid + still + 1j * omega * moving
    return np.full_like(rigid, np.nan)


def describing(amplitude: FloatArray, stick: Any, slip: Any) -> ComplexArray:
    """N(A) [N m/rad] of a pivot with contact stiffness `stick` [N m/rad] and friction moment `slip` [N m]."""
    share = slip / (stick * np.maximum(amplitude, slip / stick))
    phi = np.arccos(np.clip(1.0 - 2.0 * share, -1.0, 1.0))
    turning = phi - 0.5 * np.sin(2.0 * phi)
    return np.asarray(stick / math.pi * (turning + 4.0j * share * (1.0 - share)), dtype=np.complex128)


def friction_impedance(pad_impedance: ComplexArray, drive: FloatArray, stick: Any, slip: Any) -> ComplexArray:
    """Rotational impedance of a pivot's friction.

    A pivot that sticks has the stiffness k_s of its contact; one that slides passes the moment M_f = mu W R,
    whichever way it moves (Jenkins' element). Under harmonic vibration with tilt amplitude A its first harmonic is
    N(A) A with, for A > M_f / k_s and cos(phi) = 1 - 2 M_f / (k_s A),

        Re N = k_s (phi - sin(2 phi) / 2) / pi,    Im N = 4 M_f (1 - M_f / (k_s A)) / (pi A):

    from k_s where it just holds, to nothing where it moves far. The tilt amplitude follows from that of the
    journal, X and Y each excited alone.

    T. K. Caughey, ASME J. Appl. Mech. 27 (1960) 640 (harmonic response of the bilinear hysteretic element).

    `drive` [N m] as `pad_impedance`.
    """
    low = np.broadcast_to(slip / stick, pad_impedance.shape)
    # tilted as far as the contact gives, it would take more than there is
    held = np.abs(pad_impedance + stick) * low >= drive
    high = np.maximum(2.0 * low, 2.0 * drive / np.maximum(np.abs(pad_impedance), 1e-30) + 2.0 * low)
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        short = np.abs(pad_impedance + describing(middle, stick, slip)) * middle < drive
        low = np.where(short, middle, low)
        high = np.where(short, high, middle)
    return np.where(held, stick + 0.0j, describing(high, stick, slip))


class PadMatrices(NamedTuple):
    """Full matrices in (x, y, theta, eta), Eq. (11) and (12), of one pad; of several they have an axis in front."""

    number: Any
    frame: FloatArray  #: (2, 4): J, and what the film's forces do in these directions.
    moments: FloatArray
    stiffness: FloatArray  #: (4, 4): film [N/m, N/rad, N m/rad]; damping the same times s.
    damping: FloatArray
    pad_mass: FloatArray  #: (2, 2) each: Eq. (12), in (theta, eta); a rigid pivot has infinite k_eta.
    pad_damping: FloatArray
    pad_stiffness: FloatArray
    friction: FloatArray  #: (2,): See `friction_limits`; zero where there is none.


def pad_matrices(setup: Setup, films: Sequence[PadFilm]) -> PadMatrices:
    """Assemble the full matrices of the pads that carry."""
    smooth = hold_numbers(setup)._replace(slip=0.0)  # friction vibrates otherwise than it holds
    carrying = [film for film in films if film.forces is not None]
    n = len(carrying)
    frame, friction, (mass, damping, stiffness) = np.zeros((n, 2, 4)), np.zeros((n, 2)), np.zeros((3, n, 2, 2))
    frame[:, 0, 3], damping[:, 1, 1] = -1.0, setup.pivot_damping
    arms, of_film = np.zeros(n), np.zeros((2, n, 2, 2))
    for k, film in enumerate(carrying):
        assert film.forces is not None
        pad, load = film.pad, float(film.forces.force[0])
        hold = held_moment(smooth, film.tilt, load)
        if setup.friction:
            friction[k] = friction_limits(setup, load)
        frame[k, :, :2], frame[k, 1, 2], arms[k] = (film.normal, film.tangent), film.pivot_radius, hold.arm
        of_film[:, k] = film.forces.stiffness, film.forces.damping
        coupling = -pad.mass * mass_centre_offset(setup, film)  # the centre moves outward by eta - b tilt
        mass[k] = (pad.moment_of_inertia, coupling), (coupling, pad.mass)
        stiffness[k, 0, 0] = hold.stiffness + friction[k, 0]
        stiffness[k, 1, 1] = setup.pivots[film.number - 1].vibration_stiffness(load)
    moments = frame.copy()
    moments[:, 0, 2] = arms
    of_pad = moments.swapaxes(1, 2) @ of_film @ frame
    numbers = [film.number for film in carrying]
    return PadMatrices(numbers, frame, moments, of_pad[0], of_pad[1], mass, damping, stiffness, friction)


def mass_centre_offset(setup: Setup, film: PadFilm) -> float:
    """b_G, the mass centre's distance from the pivot line [m], positive with rotation; zero for a central pivot."""
    half = 0.5 * film.pad.arc
    return _radii(setup, film)[2] * math.sin(half) / half * math.sin((0.5 - film.pad.pivot_offset) * film.pad.arc)


def _radii(setup: Setup, film: PadFilm) -> tuple[float, float, float]:
    """Inner and outer radius of a pad, and the mean of its sector's area [m]."""
    inner = setup.bearing.journal_radius + film.pad.pad_clearance
    outer = inner + film.pad.thickness
    return inner, outer, 2.0 / 3.0 * (outer**3 - inner**3) / (outer**2 - inner**2)


def reduce_pads(
    pads: PadMatrices, omega: FloatArray, vibration: float = 0.0, added: ComplexArray | float = 0.0
) -> ComplexArray:
    """Eq. (10): the bearing's 2 x 2 impedance at every excitation frequency; `omega` (n,) [rad/s]."""
    z, film = _impedances(pads, omega, added)
    driven = z[..., 2:, :2]
    follow = np.linalg.solve(film, driven)
    rubbing = np.flatnonzero(pads.friction[:, 0])
    if rubbing.size:
        loose = _broken_loose(pads.friction[rubbing], z[rubbing], film[rubbing], vibration)
        for axis in range(2):  # X and Y excited one at a time
            held, column = film[rubbing], driven[rubbing][..., axis : axis + 1]
            held[..., 0, 0] += loose[..., axis] - pads.friction[rubbing, :1]
            follow[rubbing, :, :, axis] = np.linalg.solve(held, column)[..., 0]
    return np.asarray((z[..., :2, :2] - z[..., :2, 2:] @ follow).sum(axis=0), dtype=np.complex128)


def _impedances(
    pads: PadMatrices, omega: FloatArray, added: ComplexArray | float = 0.0
) -> tuple[ComplexArray, ComplexArray]:
    """Film impedance (pads, n, 4, 4), with more beside it, and that of tilt and deflection with pad and pivot."""
    s = 1j * omega[:, None, None]
    z = pads.stiffness[:, None] + s * pads.damping[:, None] + added
    held = np.minimum(pads.pad_stiffness, _RIGID)[:, None]
    return z, z[..., 2:, 2:] + held + s * (pads.pad_damping[:, None] + s * pads.pad_mass[:, None])


def _broken_loose(friction: FloatArray, z: ComplexArray, film: ComplexArray, vibration: float) -> ComplexArray:
    """Rotational impedance (pads, n, 2) of the pivots' friction [N m/rad], the journal vibrating along X, along Y."""
    stick, slip = friction.T[:, :, None, None]
    compliance = film[..., 0, 1] / film[..., 1, 1]  # the pivot gives way as well
    pad_impedance = (film[..., 0, 0] - compliance * film[..., 1, 0])[..., None] - stick
    drive = z[..., 2, :2] - compliance[..., None] * z[..., 3, :2]
    pad_impedance = np.broadcast_to(pad_impedance, drive.shape)
    return friction_impedance(pad_impedance, np.abs(drive) * vibration, stick, slip)


def bearing_impedance(setup: Setup, equilibrium: Equilibrium, omega: FloatArray) -> ComplexArray:
    """h(omega) in the rig's frame of the bearing inside the measured displacement, with effects of the structure."""
    pads = pad_matrices(setup, equilibrium.films)
    added = np.zeros((len(pads.number), len(omega), 4, 4), dtype=np.complex128)
    heat = setup.options.perturbed_heat and setup.thermal != "isothermal"
    if heat or setup.pads_follow or (setup.options.perturbed_bending and setup.flexible_pads):
        for k, number in enumerate(pads.number):
            film = equilibrium.films[number - 1]
            if heat:
                held = film.grid, film.work, film.wedge, equilibrium.running
                correction = np.array([heat_impedance(*held, w, _SETTLED) for w in omega.tolist()])
            else:
                factor = setup.bending_factor if setup.options.perturbed_bending else 0.0
                axial = _axial_tilt(setup, film) if setup.pads_follow else None
                correction = flexing_impedance(film, omega, factor, axial)
            added[k] = pads.moments[k].T @ correction @ pads.frame[k]
    h = with_structure(setup, reduce_pads(pads, omega, setup.vibration, added), omega)
    return np.asarray(MIRROR @ h @ MIRROR) if setup.mirrored else h


def _axial_tilt(setup: Setup, film: PadFilm) -> AxialTilt:
    """A pad's freedom to tilt along the shaft, a sector of a ring about the axis across it through its pivot."""
    assert film.forces is not None
    pad, grid = film.pad, film.grid
    hold = held_moment(hold_numbers(setup), film.axial, float(film.forces.force[0]))
    levers = axial_levers(grid, hold.arm)[grid.node]
    inner, outer, middle = _radii(setup, film)
    ends = pad.leading_edge, pad.leading_edge + pad.arc
    mean, square = (math.sin(ends[1]) - math.sin(ends[0])) / pad.arc, 0.5
    square += 0.25 * (math.sin(2.0 * ends[1]) - math.sin(2.0 * ends[0])) / pad.arc
    reach = 0.5 * (outer**2 + inner**2) * square + film.pivot_radius**2
    reach -= 2.0 * film.pivot_radius * middle * mean
    return axial_shape(grid), levers, hold.stiffness, pad.mass * (reach + setup.bearing.length**2 / 12.0)


def with_structure(setup: Setup, h: ComplexArray, omega: FloatArray) -> ComplexArray:
    """What the structure around a bearing makes of its impedance: `omega` (n,) [rad/s]."""
    s = 1j * omega[:, None, None]
    h = h + s**2 * setup.added_mass * _UNIT
    if any(setup.series_compliance):
        # of C and h both may be singular: (1 + h C)^-1 h needs neither inverse
        h = np.linalg.solve(_UNIT + h @ setup.structure, h).astype(np.complex128, copy=False)
    k, c = np.reshape([setup.parallel_stiffness, setup.parallel_damping], (2, 2, 2))
    return h + k + s * c


def friction_regimes(setup: Setup, equilibrium: Equilibrium, omega: FloatArray) -> tuple[Condition, ...]:
    """Named regimes of pivots with friction: which ones it holds, and which ones the vibration breaks loose."""
    pads = pad_matrices(setup, equilibrium.films)
    impedances = _impedances(pads, omega)
    loose = np.abs(_broken_loose(pads.friction, *impedances, setup.vibration)).min(axis=(1, 2)) < pads.friction[:, 0]
    regimes = []
    for kind, holds in ((_HELD, ~loose), (_LOOSE, loose)):
        if holds.any():
            regimes.append(named(kind, np.array(pads.number)[holds].tolist(), 1e6 * setup.vibration))
    return tuple(regimes)
