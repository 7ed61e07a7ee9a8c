"""Set points of a run against what its channels show: load, directions, speed and sense of rotation, excitation."""

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import ROTATIONS, OperatingPoint
from rigdata.vector import directions
from tpjb_ident.check.findings import explanation, far, pointing, repairs
from tpjb_ident.check.observation import Observation
from tpjb_ident.estimate.statistics import huber_weight, reweighted
from tpjb_ident.phasors.run_data import complex_median

#: Condition of phasors that names the lines beside the stated ones.
_UNEXPECTED = "unexpected lines"
#: Angle [deg] from a stated direction within which a wiring fault brings a force when it is mended.
_MENDED = 8.0
#: A mean force below this share of the set point is none, if it is not clearly there.
_NO_STATIC = (0.002, 0.02)
#: Share (or angle, as a share of the load) that is no scatter of the runs' loads, and times their median.
_LOAD_OFF, _MANY = 0.04, 9.0
#: Angle [deg] within which an excitation acts as stated, runs that must not, and share that one fault must explain.
_ALONG, _SEVERAL, _NEARLY_ALL = 10.0, 3, 0.8
#: Mass of a shaft over that of the stator, at most.
_HEAVY = 12.0
#: Angle [deg] within which the shaft moves as stated, whatever the force does.
_MOVED_ALONG = 3.0
#: Ratio of the parts that go round one way and the other from which a run tells the sense: a film far stiffer in one
#: direction passes on both, forward more. Of the runs that tell it this share must agree, and so many there must be.
_ONE_WAY, _AGREED, _LEAST_RUNS = 1.5, 0.9, 3
#: Usual distances to the nearest run of the same load, within which a shaft stands where a run of another load has it,
#: and from the middle of its own runs beyond which it does not stand with them; what records resolve, at least [m].
_THERE, _NOT_HERE, _RESOLVED = 3.0, 10.0, 5e-8
#: Set points must differ by this share for a zero to be told from a gain.
_MIN_RANGE = 0.15
#: Standard deviations from which a run loses weight when the zero is looked for, and rounds of weighing.
_BEND, _ROUNDS = 1.5, 10
#: Standard errors beyond which an intercept is one,
_CLEAR = 5.0
#: and share of the smallest load that it must have.
_NOTABLE = 0.004
_MIN_RUNS = 4


def check_static_loads(observations: Sequence[Observation], mount: str | None = None) -> bool:
    """Mean force of dynamic and locus runs against the stated static load, its direction, and the other runs.

    Cells that show no static force in any run, whatever their zero, are of a kind that shows none, or in the stingers
    of a floating stator: that is a note, and nothing is held against them; it is False then.
    """
    shown, forces = [], []
    for observation in observations:
        run, mean = observation.run, observation.mean("force")
        if run.kind in {"dynamic", "locus"} and run.point.static_load > 0 and np.isfinite(mean).all():
            shown.append(observation)
            forces.append(mean @ [1, 1j])
    means, loads = np.array(forces, complex), np.array([set_point(run.run.point) for run in shown], complex)
    ratios = means / loads
    if mount == "floating" or without_static_part((means - cell_zero(means, loads)[0]) / loads, len(set(loads)) < 2):
        for observation in shown:
            observation.report.ask("no static force")
        return False
    if not shown:
        return True
    middle = complex(complex_median(ratios))
    outlying = far(np.abs(ratios - middle) / max(abs(middle), 1e-12), _LOAD_OFF, _MANY)
    for observation, ratio, is_apart in zip(shown, ratios.tolist(), outlying):
        severities = [_check_size(observation, abs(ratio))]
        if abs(ratio) >= _NO_STATIC[1]:
            severities.append(_check_direction(observation, math.degrees(np.angle(ratio))))
        if is_apart and not any(severities):
            share, turn = abs(ratio / middle) - 1, math.degrees(np.angle(ratio / middle))
            observation.report.ask("load ratio", share=share, turn=turn)
    return True


def set_point(point: OperatingPoint) -> complex:
    """Static load as stated, X + i Y [N]."""
    return complex(point.static_load * np.exp(1j * point.static_load_direction))


def cell_zero(means: ComplexArray, set_points: ComplexArray, uncertainty: float = 0.0) -> tuple[complex, float]:
    """Zero of the cells from all runs, with its standard error; `means` (n,), `set_points` (n,) [N]."""
    good = np.isfinite(means) & (np.abs(set_points) > 0)
    y, x = means[good], set_points[good]
    if len(y) < _MIN_RUNS or (np.abs(x - x[0]) < _MIN_RANGE * np.abs(x).max()).all():
        return 0j, 0.0
    size = np.abs(x)
    design, shares = np.stack([x, np.ones_like(x)], axis=1) / size[:, None], y / size
    values, weights, _, _ = reweighted(design, shares, lambda u: huber_weight(u, _BEND), most=_ROUNDS)
    spread = np.sum(weights * np.abs(shares - design @ values) ** 2) / max(weights.sum() - 2.0, 1.0)
    covariance = np.linalg.inv((design * weights[:, None]).conj().T @ design).real * spread
    zero, error = complex(values[1]), float(np.sqrt(covariance[1, 1]))
    is_clear = abs(zero) > _CLEAR * error and abs(zero) > _NOTABLE * size.min()
    allowed = uncertainty == 0.0 or abs(zero) < 3 * uncertainty + 3 * error
    return (zero, error) if is_clear and allowed else (0j, 0.0)


def without_static_part(ratios: ComplexArray, has_zero: bool = False) -> bool:
    """Whether the cells show no static force at all, as piezo-electric ones: not a little of it, but none.

    `has_zero`: the little may be their zero, as where one load does not tell it.
    """
    if not len(ratios):
        return False
    mean = abs(complex(ratios.mean()))
    error = ratios.std() / np.sqrt(max(len(ratios) - 1, 1))
    return bool(mean < _NO_STATIC[0] or (mean < _NO_STATIC[1] and (has_zero or mean < 4 * error)))


def _check_direction(observation: Observation, off: float) -> str:
    """Mean force that points so far from the stated load [deg]."""
    set_point = observation.run.point.static_load_direction_deg
    misfit = pointing(observation.mean("force"), set_point, _MENDED)
    # with the load along one cell's axis a wrong sign of the other one changes nothing
    hint = explanation(repairs(observation.of("force")), misfit, _MENDED, alike=2)
    shown = math.remainder(set_point + off, 360.0)
    severity = observation.report.ask("load direction", abs(off), hint=hint, shown=shown, stated=set_point)
    if severity == "error":
        observation.report.cells_doubted = True
    return severity


def _check_size(observation: Observation, ratio: float) -> str:
    decades, hint = round(math.log10(max(ratio, 1e-3))), ""
    if decades and abs(ratio / 10.0**decades - 1.0) < 0.3:
        word = "small" if decades > 0 else "large"
        hint = f"; as if the sensitivity in the manifest were {10 ** abs(decades)} times too {word}"
    load = observation.run.point.static_load
    size = abs(math.log(max(ratio, 1e-9)))
    return observation.report.ask("load size", size, hint=hint, shown=ratio * load, stated=load)


def check_speed(observation: Observation) -> None:
    """Speed channel against the stated shaft speed."""
    set_point, shown = observation.run.point.shaft_speed_hz, observation.speed / (2 * math.pi)
    if set_point == 0.0:
        observation.report.ask("turning", abs(shown), shown=shown)
    else:
        observation.report.ask("speed", abs(abs(shown / set_point) - 1.0), shown=shown, stated=set_point)


def check_places(runs: Sequence[Observation]) -> None:
    """Warn where the shaft stands as in the runs of another static load, and not as in others of its own.

    Cells that carry no static load tell nothing of it; a film's thickness does.
    """
    shown = [run for run in runs if len(run.of("displacement")) > 1]
    places = np.array([run.plane("displacement", run.spread[1]).real for run in shown]).reshape(-1, 2)
    keys = [run.run.point.static_key for run in shown]
    load = np.array([keys.index(key) for key in keys], dtype=int)  # by its first run
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    np.fill_diagonal(distance, np.inf)
    is_alike = load[:, None] == load
    nearest, elsewhere = np.where(is_alike, distance, np.inf), np.where(is_alike, np.inf, distance)
    if not np.isfinite(nearest.min(axis=1, initial=np.inf)).all() or not np.isfinite(elsewhere).any():
        return
    usual = max(float(np.median(nearest.min(axis=1))), _RESOLVED)
    for k, run in enumerate(shown):
        there = int(np.argmin(elsewhere[k]))
        off = float(np.linalg.norm(places[k] - np.median(places[is_alike[k]], axis=0)))
        if elsewhere[k, there] < _THERE * usual and off > _NOT_HERE * usual:
            run.report.ask("other load", load=keys[there][0], off=1e6 * off)


def check_rotation(runs: Sequence[Observation]) -> None:
    """Warn where the 1X force clearly goes round against the stated sense of rotation."""
    for stated, other, sense in ((*ROTATIONS, 1.0), (*ROTATIONS[::-1], -1.0)):
        alike = [r for r in runs if r.run.point.rotation == stated and not r.report.cells_doubted]
        clear = [r for r in alike if abs(r.shaft_force) > math.log(_ONE_WAY)]
        against = [r for r in clear if sense * r.shaft_force < 0.0]
        if len(against) >= max(_LEAST_RUNS, _AGREED * len(clear)):
            for observation in against:
                observation.report.ask("rotation", other=other, stated=stated)


def check_excitation(runs: Sequence[Observation]) -> None:
    """Excitation of dynamic runs: there at all, as strong as in the point's other runs, in the stated direction."""
    strengths = defaultdict(list)
    measured = []
    for run in runs:
        strength = float(np.linalg.norm(run.film_force))
        if np.isfinite(strength):
            measured.append((run, strength))
            strengths[run.run.point].extend([strength] if run.shows("force") else [])
    directed = []
    for run, strength in measured:
        present = strengths[run.run.point]
        least = 0.1 * np.median(present) if len(present) > 3 else 0.0
        if strength < least or not run.shows("force"):
            others = "".join(f"; there are {c.detail}" for c in run.conditions if c == _UNEXPECTED)
            run.report.ask("no excitation", stated=run.run.point.excitation_hz, others=others)
            run.report.cells_doubted = True
        elif any(condition.endswith("X on excitation line") for condition in run.conditions):
            run.report.ask("on shaft line", float(not run.run.of("keyphasor")))
        elif not run.report.cells_doubted and run.run.excitation_direction is not None:
            directed.append(run)
    _check_directions(directed)


def _turn(run: Observation, vector: ComplexArray) -> float:
    """Angle [deg] of the long axis of an ellipse from the stated excitation; NaN where it is nearly a circle."""
    sizes, axes = np.linalg.eigh(np.real(np.outer(vector, vector.conj())))
    shown = math.degrees(math.atan2(axes[1, 1], axes[0, 1])) if sizes[0] < 0.25 * sizes[1] else math.nan
    return math.remainder(shown - math.degrees(run.run.excitation_direction or 0.0), 180.0)


def _shaker_force(run: Observation) -> ComplexArray:
    """The film's force and the inertia of a shaft that is shaken, of a mass that brings them along, X and Y [N]."""
    across = directions((run.run.excitation_direction or 0.0) + np.pi / 2)
    moved = run.run.point.excitation**2 * np.nan_to_num(run.line("displacement"))
    shaft = np.nan_to_num(run.line("acceleration")) - moved
    mass = -(complex(across @ run.film_force) / (complex(across @ shaft) or 1.0)).real
    return run.film_force + np.clip(mass, 0.0, _HEAVY * run.run.housing_mass) * shaft


def _check_directions(runs: Sequence[Observation]) -> None:
    turned = []
    for run in runs:
        # of a floating stator the cells show the shaker's force itself
        turn = min(_turn(run, _shaker_force(run)), _turn(run, run.line("force")), key=abs)
        # an actuator that controls displacement moves the shaft along its direction, whatever force that takes
        if abs(turn) > _ALONG and not abs(_turn(run, run.line("displacement"))) <= _MOVED_ALONG:
            turned.append((run, turn))
    hint = _miswired_cells(runs) if len(turned) >= _SEVERAL else ""
    for run in runs if hint else ():
        run.report.cells_doubted = True  # the cells are wired wrongly in the other runs too
    for run, turn in turned:
        stated = math.degrees(run.run.excitation_direction or 0.0)
        size = 90.0 if hint else abs(turn)
        if run.report.ask("excitation direction", size, hint=hint, shown=stated + turn, stated=stated) == "error":
            run.report.cells_doubted = True


def _miswired_cells(runs: Sequence[Observation]) -> str:
    """The fault of the first run's cells that turns nearly all runs' forces as stated when it is mended."""
    alike = [run for run in runs if run.names("force") == runs[0].names("force")]

    def unexplained(repair: FloatArray) -> float:
        explained = [abs(_turn(run, repair @ run.line("force"))) <= _ALONG for run in alike]
        return 1.0 - sum(explained) / len(runs)

    return explanation(repairs(runs[0].of("force")), unexplained, 1.0 - _NEARLY_ALL + 1e-9, alike=4)
