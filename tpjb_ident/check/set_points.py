"""Set points of a run against what its channels show: load, directions, speed, excitation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.questions import far
from tpjb_ident.check.wiring import angle_between, explanation, pointing, repairs

#: Angle [deg] from a stated direction within which a wiring fault brings a force when it is mended.
_MENDED = 8.0
#: A mean force below this share of the set point is none, if it is not clearly there.
_NO_STATIC = (0.002, 0.02)
#: Share (or angle, as a share of the load) that is no scatter of the runs' loads, and times their median.
_LOAD_OFF, _MANY = 0.04, 9.0
#: Angle [deg] within which an excitation acts as stated, runs that must not, and share that one fault must explain.
_ALONG, _SEVERAL, _NEARLY_ALL = 10.0, 3, 0.8
#: Angle [deg] within which the shaft moves as stated, whatever the force does.
_MOVED_ALONG = 3.0


def check_static_loads(observations: Sequence[Observation]) -> bool:
    """Mean force of dynamic and locus runs against the stated static load, its direction, and the other runs.

    Cells that show no static force in any run are of a kind that shows none: that is a note, and nothing is held
    against them; it is False then.
    """
    shown: list[tuple[Observation, complex]] = []
    for observation in observations:
        point, mean = observation.run.point, observation.mean("force")
        if observation.run.kind in {"dynamic", "locus"} and point.static_load > 0 and np.isfinite(mean).all():
            turn = np.exp(-1j * point.static_load_direction)
            shown.append((observation, complex(complex(*mean) / point.static_load * turn)))
    ratios = np.array([ratio for _, ratio in shown], dtype=complex)
    if without_static_part(ratios):
        for observation, _ in shown:
            observation.report.ask("no static force")
        return False
    if not shown:
        return True
    middle = complex(np.median(ratios.real), np.median(ratios.imag))
    outlying = far(np.abs(ratios - middle) / max(abs(middle), 1e-12), _LOAD_OFF, _MANY)
    for (observation, ratio), is_apart in zip(shown, outlying):
        severities = [_check_size(observation, abs(ratio))]
        if abs(ratio) >= _NO_STATIC[1]:
            severities.append(_check_direction(observation, math.degrees(np.angle(ratio))))
        if is_apart and not any(severities):
            share, turn = abs(ratio / middle) - 1, math.degrees(np.angle(ratio / middle))
            observation.report.ask("load ratio", share=share, turn=turn)
    return True


def without_static_part(ratios: ComplexArray) -> bool:
    """Whether the cells show no static force at all, as piezo-electric ones: not a little of it, but none."""
    if not len(ratios):
        return False
    mean = abs(complex(ratios.mean()))
    error = float(np.sqrt(np.mean(np.abs(ratios - ratios.mean()) ** 2) / max(len(ratios) - 1, 1)))
    return bool(mean < _NO_STATIC[0] or (mean < _NO_STATIC[1] and mean < 4 * error))


def _check_direction(observation: Observation, off: float) -> str:
    """Mean force that points so far from the stated load [deg]."""
    set_point = observation.run.point.static_load_direction_deg
    misfit = pointing(observation.mean("force"), set_point, _MENDED)
    # with the load along one cell's axis a wrong sign of the other one changes nothing
    hint = explanation(repairs(observation.of("force")), misfit, _MENDED, alike=2)
    shown = math.remainder(set_point + off, 360.0)
    severity = observation.report.ask("load direction", abs(off), hint=hint, shown=shown, stated=set_point)
    if severity == "error":
        observation.report.doubts.add("force")
    return severity


def _check_size(observation: Observation, ratio: float) -> str:
    decades, hint = round(math.log10(max(ratio, 1e-3))), ""
    if decades and abs(ratio / 10.0**decades - 1.0) < 0.3:
        word = "small" if decades > 0 else "large"
        hint = f"; as if the sensitivity in the manifest were {10 ** abs(decades)} times too {word}"
    load = observation.run.point.static_load
    off = abs(math.log(max(ratio, 1e-9)))
    return observation.report.ask("load size", off, hint=hint, shown=ratio * load, stated=load)


def check_speed(observation: Observation) -> None:
    """Speed channel against the stated shaft speed."""
    set_point, shown = observation.run.point.shaft_speed_hz, observation.speed / (2 * math.pi)
    if set_point == 0.0:
        observation.report.ask("turning", abs(shown), shown=shown)
    else:
        observation.report.ask("speed", abs(abs(shown / set_point) - 1.0), shown=shown, stated=set_point)


def check_excitation(runs: Sequence[Observation], mass: float) -> None:
    """Excitation of dynamic runs: there at all, as strong as in the point's other runs, in the stated direction."""
    measured = [run for run in runs if np.isfinite(run.film_force(mass)).all()]
    shown = [float(np.linalg.norm(run.film_force(mass))) if run.shows("force") else 0.0 for run in measured]
    alike: dict[OperatingPoint, list[float]] = {}
    for run, size in zip(measured, shown):
        alike.setdefault(run.run.point, []).extend([size] if size > 0 else [])
    directed: list[_Directed] = []
    for run, size in zip(measured, shown):
        present = alike[run.run.point]
        least = 0.1 * float(np.median(present)) if len(present) > 3 else 0.0
        if size <= 0 or size < least:
            hint = f"; the strongest other line is near {run.other_line:.3g} Hz" if np.isfinite(run.other_line) else ""
            run.report.ask("no excitation", hint=hint, stated=run.run.point.excitation_hz)
            run.report.doubts.add("force")
        elif "force" not in run.report.doubts and run.run.excitation_direction is not None:
            directed.append(_Directed(run, run.film_force(mass), math.degrees(run.run.excitation_direction)))
    _check_directions(directed)


class _Directed(NamedTuple):
    """A run whose force is excited along a stated direction [deg]."""

    observation: Observation
    force: ComplexArray
    direction: float

    def off(self, force: ComplexArray) -> float:
        """Angle [deg] of the long axis of a force ellipse from what is stated; NaN where it is nearly a circle."""
        sizes, axes = np.linalg.eigh(np.real(np.outer(force, force.conj())))
        shown = math.degrees(math.atan2(axes[1, 1], axes[0, 1])) if sizes[0] < 0.25 * sizes[1] else math.nan
        return (shown - self.direction + 90.0) % 180.0 - 90.0


def _check_directions(runs: Sequence[_Directed]) -> None:
    # an actuator that controls displacement moves the shaft along its direction, whatever force that takes
    moved = [abs(run.off(run.observation.line("displacement"))) <= _MOVED_ALONG for run in runs]
    off = [run for run, is_moved in zip(runs, moved) if abs(run.off(run.force)) > _ALONG and not is_moved]
    hint = ""
    if len(off) >= _SEVERAL:
        cells = runs[0].observation.names("force")
        alike = [run for run in runs if run.observation.names("force") == cells]

        def unexplained(repair: FloatArray) -> float:
            explained = [abs(run.off(repair @ run.observation.line("force"))) <= _ALONG for run in alike]
            return 1.0 - sum(explained) / len(runs)

        faults = repairs(runs[0].observation.of("force"))
        hint = explanation(faults, unexplained, 1.0 - _NEARLY_ALL + 1e-9, alike=4)
    for run in runs if hint else ():
        run.observation.report.doubts.add("force")  # the cells are wired wrongly in the other runs too
    for run in off:
        turn = run.off(run.force)
        size = angle_between(turn, 0.0, 180.0) if not hint else 90.0
        shown, report = run.direction + turn, run.observation.report
        if report.ask("excitation direction", size, hint=hint, shown=shown, stated=run.direction) == "error":
            report.doubts.add("force")
