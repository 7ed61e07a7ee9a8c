"""Predict: one call from a bearing and an operating point to coefficients, position and fields."""

import math
import operator
from collections.abc import Iterable
from typing import Any

import numpy as np

from model.bearing import ROTATIONS, Bearing
from model.dynamics import bearing_impedance, friction_regimes
from model.effects import Effect, apply_effects
from model.errors import ModelError, OptionError, check_known
from model.growth import grown
from model.mirror import MIRROR, mirrored, rotation_of, seen_by_shaft
from model.options import Options
from model.pivots import pivot_laws, pressed_beyond
from model.possible import check_possible
from model.prediction import Prediction
from model.setup import Mesh, Setup
from model.statics.equilibrium import Equilibrium
from model.statics.solve import solve_equilibrium
from rigdata.arrays import FloatArray
from rigdata.problem import Condition
from rigdata.units import UnitError, to_si

#: No shaker excites faster [rad/s]; beyond, squares overflow.
_FASTEST = 1e9
#: Loads below do not push [N].
_NO_LOAD = 1e-200


class _OperatingPointError(ModelError):
    """A load, direction, speed or excitation that no bearing can have."""


def predict(
    bearing: Bearing,
    load: Any,
    load_direction: Any = -math.pi / 2,
    speed: Any = None,
    excitation: Any = None,
    pivots: Any = "kirk",
    thermal: str = "adiabatic",
    effects: Iterable[Effect] = (),
    mesh: Mesh | tuple[int, int] | None = None,
    start: Prediction | None = None,
    options: Options | None = None,
    rotation: str = "",
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
    thermal : {"isothermal", "adiabatic", "tehd", "thd"}
        Adiabatic films are the paper's; "tehd": pads deform too; "thd": all that heat does, see `model.setup.Setup`.
    effects : iterable of Effect
    mesh : Mesh or (int, int), optional
        Intervals along the arc and across half the width.
    start : Prediction, optional
        A neighbouring prediction to start from.
    options : Options, optional
        Physics beyond the paper's model: heat into pads and journal, thermal growth, cavitation.
    rotation : {"counter-clockwise", "clockwise"}, optional
        Sense of turning; default: the bearing's, else counter-clockwise. All results are in the rig's own frame.

    Returns
    -------
    Prediction

    Raises
    ------
    BearingError, OperatingPointError
        The bearing, or the load, direction, speed or excitation, has a number that none can have.
    OptionError, EffectError
        Another argument has a wrong name, dimension or sign. All are `ModelError`, and a ValueError too.

    Examples
    --------
    >>> p = ti.predict(rocker, load=5000.0, speed=2 * np.pi * 22, excitation=2 * np.pi * 25)
    >>> print(f"kyy {p.kyy / 1e6:.1f} MN/m, thinnest film {1e6 * p.min_film:.1f} um")
    kyy 202.5 MN/m, thinnest film 33.5 um
    """
    if not isinstance(options, Options | None):
        raise OptionError(f"options must be an Options object, got {options!r}")
    check_possible(bearing)
    plain = Setup(bearing, pivot_laws(pivots, bearing), thermal, _mesh(mesh), options=options or Options())
    setup = apply_effects(plain, effects)
    rotation = rotation or bearing.rotation or ROTATIONS[0]
    check_known("rotation", rotation, ROTATIONS)
    if speed is None:
        raise _OperatingPointError("speed is missing. Give the shaft's [rad/s], such as 2 * pi * 22 for 22 Hz")
    speed_si = _number(speed, "speed", "speed")
    if not 0.0 < speed_si < math.inf:
        raise _OperatingPointError(
            f"speed must be positive [rad/s], got {speed_si!r}; `rotation` says which way the shaft turns"
        )
    omega = speed_si if excitation is None else _in_si(excitation, "speed", "excitation")
    force = _number(load, "force", "load")
    direction = _number(load_direction, "angle", "load_direction")
    spin = -speed_si if rotation == ROTATIONS[1] else speed_si
    return predict_setup(setup, force, direction, spin, omega, start.equilibrium if start is not None else None)


def _mesh(mesh: Any) -> Mesh:
    if isinstance(mesh, Mesh | None):
        return mesh or Mesh()
    try:
        along, across = (operator.index(n) for n in mesh)
    except (TypeError, ValueError) as error:
        raise OptionError(f"mesh must be two whole numbers, along and across, got {mesh!r}") from error
    return Mesh(along, across)


def _number(value: Any, dimension: str, name: str) -> float:
    try:
        if isinstance(value, bool):
            raise TypeError("a truth value")
        return float(_in_si(value, dimension, name))
    except TypeError as error:
        raise _OperatingPointError(f"{name} must be a number, got {value!r}") from error


def _in_si(value: Any, dimension: str, name: str) -> Any:
    try:
        return to_si(value, dimension, name)
    except UnitError as error:
        raise _OperatingPointError(str(error)) from error


def predict_setup(
    setup: Setup, load: float, load_direction: float, speed: float, excitation: Any, start: Equilibrium | None = None
) -> Prediction:
    """Predict for a `Setup` (effects applied); SI floats only, see `predict`; `speed` about +z, negative: clockwise."""
    try:
        omega = np.asarray(excitation, float)
    except TypeError as error:
        raise _OperatingPointError(f"excitation must be numbers [rad/s], got {excitation!r}") from error
    _check_point(load, load_direction, speed, omega)
    # A load near the smallest float is none: its quotients would not be numbers.
    pushing = load if load > _NO_LOAD else 0.0
    force = pushing * np.array([math.cos(load_direction), math.sin(load_direction)])
    running, equilibrium = solve_as_it_runs(setup, force, speed, start)
    lines = np.atleast_1d(omega)
    h, regimes = np.full((len(lines), 2, 2), complex(math.nan, math.nan)), tuple[Condition, ...]()
    if equilibrium.converged:
        h = bearing_impedance(running, equilibrium, lines)
        regimes = friction_regimes(running, equilibrium, lines) if running.friction else ()
    setup = mirrored(running) if running.mirrored else running
    instruments = setup.instruments
    films = equilibrium.films
    position = in_rig(running, equilibrium.position)
    tilt = np.array([f.tilt for f in films])
    pad_load = np.array([f.forces.force[0] if f.forces is not None else 0.0 for f in films])
    shape = (*omega.shape, 2, 2)
    return Prediction(
        load=load,
        load_direction=load_direction,
        speed=abs(speed),
        rotation=rotation_of(speed),
        excitation=float(omega) if omega.ndim == 0 else omega,
        h=instruments.shown_stiffness(h, lines).reshape(shape),
        bearing_h=h.reshape(shape),
        position=instruments.shown_position(position + setup.structure @ force),
        bearing_position=position,
        load_reading=instruments.shown_load(force),
        tilt=-tilt if running.mirrored else tilt,
        deflection=np.array([f.deflection for f in films]),
        pad_load=pad_load,
        status=(*equilibrium.status, *regimes, *pressed_beyond(setup.pivots, pad_load)),
        equilibrium=equilibrium,
        setup=setup,
        solver=predict_setup,
    )


def solve_as_it_runs(
    setup: Setup,
    force: FloatArray,
    speed: float,
    start: Equilibrium | None = None,
    patient: bool = True,
    near: bool = False,
) -> tuple[Setup, Equilibrium]:
    """Find the equilibrium with the clearances that belong to its own temperatures: `force` (2,) [N].

    `speed` [rad/s] is about +z. Both results are in the frame where the shaft turns counter-clockwise, see
    `model.mirror`; so is `start`. `patient` and `near` as of `solve_equilibrium`.
    """
    setup = seen_by_shaft(setup, speed)
    force = in_rig(setup, force)
    growth = setup.growth
    if growth is not None and growth.journal is not None:
        grown_bearing = grown(setup.bearing, growth, setup.inlet_temperature, growth.journal)
        setup = setup.change(bearing=grown_bearing, grown=True)
    equilibrium = solve_equilibrium(setup, force, abs(speed), start, patient, near)
    if setup.growth is not None:
        running = setup.bearing.with_pads(tuple(f.pad for f in equilibrium.films))
        setup = setup.change(bearing=running, grown=True)
    return setup, equilibrium


def in_rig(setup: Setup, vector: FloatArray) -> FloatArray:
    """A vector (2,) of a set-up's frame in the rig's frame, and the other way round."""
    return np.asarray(MIRROR @ vector) if setup.mirrored else vector


def _check_point(load: float, direction: float, speed: float, omega: FloatArray) -> None:
    if not (math.isfinite(load) and load >= 0):
        raise _OperatingPointError(
            f"load must be zero or positive [N], got {load!r}; give its direction as load_direction"
        )
    if not math.isfinite(direction):
        raise _OperatingPointError(f"load_direction must be finite [rad], got {direction!r}")
    if not (math.isfinite(speed) and speed != 0.0):
        raise _OperatingPointError(f"speed must be a number of rad/s other than zero, got {speed!r}")
    if omega.ndim > 1 or omega.size == 0 or not np.all((omega > 0) & (omega < _FASTEST)):
        raise _OperatingPointError(
            f"excitation must be a positive number below {_FASTEST:g} rad/s or a 1-D array of them, "
            f"got {np.array2string(omega, threshold=4, precision=3)}"
        )
