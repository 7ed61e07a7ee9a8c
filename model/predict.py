"""Predict: one call from a bearing and an operating point to coefficients, position and fields."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from model.arrays import ComplexArray, FloatArray
from model.bearing import Bearing
from model.conditions import Condition
from model.dynamics.reduction import PadMatrices, bearing_impedance, friction_regimes, pad_matrices
from model.effects import Effect, apply_effects
from model.errors import ModelError, OptionError
from model.growth import grown
from model.options import Options
from model.pivots import pivot_laws
from model.possible import check_possible
from model.setup import Mesh, Setup
from model.statics.conditions import NOT_CONVERGED, UNSETTLED_GROWTH, largest_reynolds
from model.statics.equilibrium import Equilibrium
from model.statics.pad_flow import PadFlow, pad_flow
from model.statics.power import power_loss
from model.statics.solve import solve_equilibrium
from model.units import to_si

#: No shaker excites faster [rad/s]; beyond, squares overflow.
FASTEST = 1e9
#: Loads below do not push [N].
NO_LOAD = 1e-200


class OperatingPointError(ModelError):
    """A load, direction, speed or excitation that no bearing can have."""


@dataclass(frozen=True)
class Prediction:
    """What the model says about one operating point, as the records would show it.

    Measurement-side effects are in `h`, `position` and `load_reading`; `bearing_h` and `bearing_position` are
    free of them.

    Attributes
    ----------
    load, load_direction : float
        Static load [N] and where it pushes the shaft [rad].
    speed : float
        [rad/s]
    excitation : float or (n,) ndarray
        [rad/s]
    h : (2, 2) or (n, 2, 2) complex ndarray
        Dynamic stiffness k + i omega c [N/m].
    position : (2,) ndarray
        Journal from the bearing centre [m].
    tilt, deflection, pad_load : (n_pads,) ndarray
        [rad], [m], [N]
    status : tuple of Condition
        Named conditions, which compare and print like strings; empty when all is well.
    equilibrium : Equilibrium
    setup : Setup
    """

    load: float
    load_direction: float
    speed: float
    excitation: float | FloatArray
    h: ComplexArray
    bearing_h: ComplexArray = field(repr=False)
    position: FloatArray
    bearing_position: FloatArray = field(repr=False)
    load_reading: FloatArray = field(repr=False)
    tilt: FloatArray = field(repr=False)
    deflection: FloatArray = field(repr=False)
    pad_load: FloatArray
    status: tuple[Condition, ...]
    equilibrium: Equilibrium = field(repr=False)
    setup: Setup = field(repr=False)

    def __str__(self) -> str:
        x, y = 1e6 * self.position
        return (
            f"{self.load:g} N at {math.degrees(self.load_direction):.4g} deg, {self.speed / (2 * math.pi):.4g} Hz: "
            f"shaft at ({x:.4g}, {y:.4g}) um, thinnest film {1e6 * self.min_film:.3g} um, "
            f"hottest {self.max_temperature:.4g} degC; {', '.join(self.status) or 'all well'}"
        )

    @property
    def converged(self) -> bool:
        """Whether the equilibrium was found."""
        return self.equilibrium.converged

    @property
    def idle_pads(self) -> tuple[int, ...]:
        """Pads without a loaded attitude, numbers from 1."""
        return tuple(f.number for f in self.equilibrium.films if f.idle)

    @property
    def k(self) -> FloatArray:
        """Re h [N/m], shape of `h`."""
        return self.h.real

    @property
    def c(self) -> FloatArray:
        """Im h / omega [N s/m], shape of `h`."""
        omega = np.asarray(self.excitation, float)[..., None, None]
        return self.h.imag / omega

    def __getattr__(self, name: str) -> Any:
        if len(name) == 3 and name[0] in "kc" and set(name[1:]) <= {"x", "y"}:
            table = self.k if name[0] == "k" else self.c
            value = table[..., "xy".index(name[1]), "xy".index(name[2])]
            return float(value) if value.ndim == 0 else value
        raise AttributeError(f"Prediction has no attribute {name!r}")

    @property
    def pressure(self) -> tuple[FloatArray, ...]:
        """Per pad, (nt + 1, nz + 1) on the half width (full if misaligned) [Pa]."""
        return tuple(f.work.pressure for f in self.equilibrium.films)

    @property
    def film(self) -> tuple[FloatArray, ...]:
        """Film thickness per pad [m], shapes as `pressure`."""
        return tuple(f.work.thickness for f in self.equilibrium.films)

    @property
    def temperature(self) -> tuple[FloatArray, ...]:
        """Film temperature per pad [degC], shapes as `pressure`."""
        return tuple(f.work.temperature for f in self.equilibrium.films)

    @property
    def max_pressure(self) -> float:
        """Highest film pressure [Pa]."""
        return max(float(p.max()) for p in self.pressure)

    @property
    def max_temperature(self) -> float:
        """Hottest film of a pad that carries [degC]."""
        films = [f for f in self.equilibrium.films if not f.idle]
        return max((float(f.work.temperature.max()) for f in films), default=self.setup.inlet_temperature)

    @property
    def min_film(self) -> float:
        """Thinnest film [m]; infinite if no pad carries."""
        return min((float(f.work.thickness.min()) for f in self.equilibrium.films if not f.idle), default=math.inf)

    @property
    def face_temperature(self) -> tuple[FloatArray, ...]:
        """Temperature of the pads' faces [degC], shapes as `temperature`.

        The film's own, unless the journal takes part: then the parabola across the film that passes its heat, flat at
        the pad, is hotter there by half of what the mean is hotter than the journal.
        """
        journal = self.equilibrium.journal_temperature
        if not math.isfinite(journal):
            return self.temperature
        return tuple(t + 0.5 * (t - journal) for t in self.temperature)

    @functools.cached_property
    def pad_flow(self) -> tuple[PadFlow, ...]:
        """Per pad: oil in, out and over the sides [m^3/s], temperatures in and out [degC]."""
        return tuple(pad_flow(f, self.setup.bearing.oil) for f in self.equilibrium.films)

    @property
    def reynolds(self) -> float:
        """Largest local Reynolds number rho U h / mu of all films."""
        return largest_reynolds(self.equilibrium.films, self.speed * self.setup.bearing.journal_radius)

    @property
    def sommerfeld(self) -> float:
        """S = mu N D L / W (R / Cb)^2, N in rev/s, mu of the oil that enters, Cb the mean of the pads."""
        bearing, clearance = self.setup.bearing, self._clearance
        viscosity = float(bearing.oil.viscosity(self.setup.inlet_temperature))
        turns = self.speed / (2.0 * math.pi)
        size = viscosity * turns * bearing.journal_diameter * bearing.length
        return size * (bearing.journal_radius / clearance) ** 2 / self.load if self.load > 0.0 else math.inf

    @property
    def eccentricity_ratio(self) -> float:
        """Distance of the journal from the bearing centre over the mean Cb."""
        return math.hypot(*self.bearing_position) / self._clearance

    @property
    def attitude_angle(self) -> float:
        """Angle from the load's direction to that of the journal [rad], positive with rotation, within +-pi."""
        x, y = self.bearing_position
        return (math.atan2(y, x) - self.load_direction + math.pi) % (2.0 * math.pi) - math.pi

    @property
    def _clearance(self) -> float:
        pads = self.setup.bearing.pads
        return sum(p.assembled_clearance for p in pads) / len(pads) + self.setup.clearance_change

    @property
    def power_loss(self) -> float:
        """Shear of all films, those of idle pads too [W]."""
        turbulent = self.setup.options.turbulence != "none"
        return power_loss(self.equilibrium, self.speed * self.setup.bearing.journal_radius, turbulent)

    def pad_temperature(self, fraction: float = 0.75) -> FloatArray:
        """Film temperature at mid-length, at a fraction of the arc from the leading edge, per pad [degC].

        Parameters
        ----------
        fraction : float
            Of the arc, from the leading edge.

        Returns
        -------
        (n_pads,) ndarray
            [degC]
        """
        out = []
        for film in self.equilibrium.films:
            angle = film.pad.leading_edge + fraction * film.pad.arc
            middle = 0 if film.grid.first == 0 else len(film.grid.z) // 2
            out.append(float(np.interp(angle, film.grid.angle, film.work.temperature[:, middle])))
        return np.array(out)

    @property
    def pad_matrices(self) -> tuple[PadMatrices, ...]:
        """Full matrices of the pads that carry, Eq. (11) and (12)."""
        matrices = (pad_matrices(self.setup, f) for f in self.equilibrium.films)
        return tuple(m for m in matrices if m is not None)

    @functools.cached_property
    def mesh_error(self) -> float:
        """Estimated relative error of the direct coefficients from the mesh.

        A third of the difference to a mesh half as fine (second order), the largest of kxx, kyy, cxx, cyy. Solved
        when first asked for.
        """
        coarse = predict_setup(
            self.setup.change(mesh=self.setup.mesh.coarser()),
            self.load, self.load_direction, self.speed, self.excitation,
        )  # fmt: skip
        if not (coarse.converged and self.converged):
            return math.nan
        worst = 0.0
        for part in ("real", "imag"):
            fine, rough = (np.diagonal(getattr(p.bearing_h, part), axis1=-2, axis2=-1) for p in (self, coarse))
            scale = np.maximum(np.abs(fine), 0.05 * np.abs(np.diagonal(self.bearing_h, axis1=-2, axis2=-1)))
            worst = max(worst, float(np.max(np.abs(fine - rough) / scale)) / 3.0)
        return worst


def predict(
    bearing: Bearing,
    load: Any,
    load_direction: Any = -math.pi / 2,
    speed: Any = 0.0,
    excitation: Any = None,
    pivots: Any = "kirk",
    thermal: str = "adiabatic",
    effects: Iterable[Effect] = (),
    mesh: Mesh | tuple[int, int] | None = None,
    start: Prediction | None = None,
    options: Options | None = None,
) -> Prediction:
    """Predict a bearing's coefficients, position and fields at one operating point.

    Parameters
    ----------
    bearing : Bearing
    load : float or quantity
        Static load per bearing [N].
    load_direction : float or quantity
        Where it pushes the shaft [rad, counter-clockwise from +X].
    speed : float or quantity
        Shaft speed [rad/s].
    excitation : float, (n,) array or quantity, optional
        [rad/s]; default: synchronous.
    pivots : str, float, path or laws
        ``"rigid"``, ``"kirk"``, ``"kirk-secant"``, a constant stiffness [N/m], a ``pivots.toml``, or laws per pad.
    thermal : {"isothermal", "adiabatic", "tehd"}
    effects : iterable of Effect
    mesh : Mesh or (int, int), optional
        Intervals along the arc and across half the width.
    start : Prediction, optional
        A neighbouring prediction to start from.
    options : Options, optional
        Physics beyond the paper's model: heat into pads and journal, thermal growth, cavitation.

    Returns
    -------
    Prediction

    Raises
    ------
    BearingError
        The bearing has a number that no bearing has.
    OperatingPointError
        A load, direction, speed or excitation that is no number, or that no bearing can have.
    OptionError, UnitError, EffectError
        Another argument with a wrong name, dimension or sign (the message says which). All are `ModelError`, and
        a ValueError too.
    """
    if not (options is None or isinstance(options, Options)):
        raise OptionError(f"options must be an Options object, got {options!r}")
    check_possible(bearing)
    plain = Setup(bearing, pivot_laws(pivots, bearing), thermal, _mesh(mesh), options=options or Options())
    setup = apply_effects(plain, effects)
    speed_si = _number(speed, "angular speed", "speed")
    omega = speed_si if excitation is None else to_si(excitation, "angular speed", "excitation")
    return predict_setup(
        setup,
        _number(load, "force", "load"),
        _number(load_direction, "angle", "load_direction"),
        speed_si,
        omega,
        start.equilibrium if start is not None else None,
    )


def _mesh(mesh: Any) -> Mesh:
    if mesh is None or isinstance(mesh, Mesh):
        return mesh or Mesh()
    try:
        along, across = (operator.index(n) for n in mesh)
    except (TypeError, ValueError) as error:
        raise OptionError(f"mesh must be two whole numbers, along and across, got {mesh!r}") from error
    return Mesh(along, across)


def _number(value: Any, dimension: str, name: str) -> float:
    if isinstance(value, bool):
        raise OperatingPointError(f"{name} must be a number, got {value!r}")
    try:
        return float(to_si(value, dimension, name))
    except TypeError as error:
        raise OperatingPointError(f"{name} must be a number, got {value!r}") from error


def predict_setup(
    setup: Setup, load: float, load_direction: float, speed: float, excitation: Any, start: Equilibrium | None = None
) -> Prediction:
    """Predict for a `Setup` (effects applied); SI floats only, see `predict`.

    Parameters
    ----------
    setup : Setup
    load : float
        [N]
    load_direction : float
        [rad, counter-clockwise from +X]
    speed : float
        [rad/s]
    excitation : float or (n,) array_like
        [rad/s]
    start : Equilibrium, optional
        A neighbouring solution on the same mesh.

    Returns
    -------
    Prediction

    Raises
    ------
    OperatingPointError
        A load, direction, speed or excitation that no bearing can have.
    """
    try:
        omega = np.asarray(excitation, float)
    except TypeError as error:
        raise OperatingPointError(f"excitation must be numbers [rad/s], got {excitation!r}") from error
    _check_point(load, load_direction, speed, omega)
    # A load near the smallest float is none: its quotients would not be numbers.
    pushing = load if load > NO_LOAD else 0.0
    force = pushing * np.array([math.cos(load_direction), math.sin(load_direction)])
    setup, equilibrium = _solve_as_it_runs(setup, force, speed, start)
    lines = np.atleast_1d(omega)
    if equilibrium.converged:
        h = bearing_impedance(setup, equilibrium, lines)
        regimes = friction_regimes(setup, equilibrium, lines) if setup.friction else ()
    else:
        regimes = ()
        h = np.full((len(lines), 2, 2), complex(math.nan, math.nan))
    instruments = setup.instruments
    outside = equilibrium.position + setup.structure @ force
    films = equilibrium.films
    shape = (2, 2) if omega.ndim == 0 else (len(lines), 2, 2)
    return Prediction(
        load=load,
        load_direction=load_direction,
        speed=speed,
        excitation=float(omega) if omega.ndim == 0 else omega,
        h=instruments.shown_stiffness(h, lines).reshape(shape),
        bearing_h=h.reshape(shape),
        position=instruments.shown_position(outside),
        bearing_position=equilibrium.position,
        load_reading=instruments.shown_load(force),
        tilt=np.array([f.tilt for f in films]),
        deflection=np.array([f.deflection for f in films]),
        pad_load=np.array([f.forces.force[0] if f.forces is not None else 0.0 for f in films]),
        status=(*equilibrium.status, *regimes),
        equilibrium=equilibrium,
        setup=setup,
    )


def _solve_as_it_runs(
    setup: Setup, force: FloatArray, speed: float, start: Equilibrium | None
) -> tuple[Setup, Equilibrium]:
    """Equilibrium with the clearances that belong to its own temperatures; returns the setup they make, too."""
    growth = setup.options.growth
    if growth is None:
        return setup, solve_equilibrium(setup, force, speed, start)
    journal = setup.inlet_temperature if growth.journal is None else growth.journal
    settled = False
    for _ in range(MAX_GROWTH_STEPS):
        bearing = grown(setup.bearing, growth, setup.inlet_temperature, journal)
        running = setup.change(bearing=bearing, options=replace(setup.options, growth=None))
        equilibrium = start = solve_equilibrium(running, force, speed, start)
        felt = growth.journal if growth.journal is not None else equilibrium.mean_journal_temperature
        settled = not equilibrium.converged or abs(felt - journal) < GROWTH_TOLERANCE
        if settled:
            break
        journal = felt
    if not settled:
        names = (*equilibrium.status, UNSETTLED_GROWTH, NOT_CONVERGED)
        equilibrium = replace(equilibrium, status=names)
    return running, equilibrium


#: Journal temperature that is near enough for the clearances [K]: a few nanometres.
GROWTH_TOLERANCE = 0.01
MAX_GROWTH_STEPS = 20


def _check_point(load: float, direction: float, speed: float, omega: FloatArray) -> None:
    if not (math.isfinite(load) and load >= 0):
        raise OperatingPointError(
            f"load must be zero or positive [N], got {load!r}; give its direction as load_direction"
        )
    if not math.isfinite(direction):
        raise OperatingPointError(f"load_direction must be finite [rad], got {direction!r}")
    if not (math.isfinite(speed) and speed > 0):
        raise OperatingPointError(f"speed must be positive [rad/s] (the shaft turns counter-clockwise), got {speed!r}")
    if omega.ndim > 1 or omega.size == 0 or not np.all((omega > 0) & (omega < FASTEST)):
        raise OperatingPointError(
            f"excitation must be a positive number below {FASTEST:g} rad/s or a 1-D array of them, "
            f"got {np.array2string(omega, threshold=4, precision=3)}"
        )
