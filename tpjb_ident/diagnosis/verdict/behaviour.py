"""Behaviour: what lies beyond the library, in few numbers, and what of the library drifts.

A spring in series, a parallel stiffness or damping; a pad whose clearance or whose pivot is further off than stated; an
amplitude that is not the same at every load, speed and frequency.
"""

import math
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.evidence import Linear, posterior
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Fault
from tpjb_ident.diagnosis.observations.constants import Deciding

#: What a pad by itself may be off by: kind, effect and parameter that say it, unit.
_PADS = {
    "clearance_scatter": ("clearance by pad", "pad_offset", "radial_offset", "m"),
    "pivot_stiffness_scatter": ("pivot law of a pad", "soft_pivot", "stiffness_factor", "1"),
}


@dataclass(frozen=True)
class Behaviour:
    """A term that describes what the library does not."""

    kind: str
    size: float
    unit: str
    direction_deg: float | None
    spread: float
    words: str
    effect: str
    parameters: dict[str, float]


def behaviours(fit: Fit) -> tuple[Behaviour, ...]:
    """Describe the generic terms of a fit, and the pads that are further off than stated."""
    out = []
    for fault, amplitudes, errors in zip(fit.faults, fit.amplitudes, fit.errors, strict=True):
        if not fault.is_term:
            continue
        values = fault.values(amplitudes)
        matrix = np.array([[values["xx"], values["xy"]], [values.get("yx", values["xy"]), values["yy"]]])
        spread = float(np.max(errors) / max(np.max(np.abs(amplitudes)), 1e-300))
        out.append(_described(fault.name, fault.candidate.form, matrix, spread, values))
    return (*out, *_pads(fit))


def _pads(fit: Fit) -> list[Behaviour]:
    """Pads whose clearance or pivot is off by more than `visible` standard deviations of what is stated."""
    nuisances = {f"{n.name} {n.place}".strip(): n for n in fit.problem.nuisances}
    out = []
    for deviation in fit.tolerances:
        nuisance = nuisances.get(deviation.name)
        if nuisance is None or nuisance.name not in _PADS or abs(deviation.significance) < Deciding.visible:
            continue
        pad, change = int(nuisance.place.split()[-1]), deviation.size * nuisance.sigma
        spread = math.sqrt(max(1.0 - deviation.heard, 0.0)) / abs(deviation.size)
        kind, effect, parameter, unit = _PADS[nuisance.name]
        if effect == "pad_offset":
            size, words = change, f"pad #{pad} stands {1e6 * change:+.1f} um from where the drawing has it"
        else:
            size = math.exp(change)
            words = f"the pivot of pad #{pad} has {100 * size:.0f} % of the stiffness that its law says"
        parameters = {"pad": float(pad), parameter: size}
        out.append(Behaviour(kind, size, unit, None, spread, words, effect, parameters))
    return out


def _described(name: str, form: str, matrix: FloatArray, spread: float, values: dict[str, float]) -> Behaviour:
    kind = name.replace("_", " ")
    unit = "N s/m" if name == "parallel_damping" else "N/m"
    direction: float | None = None
    if form == "cross-coupled":
        size, how = float(matrix[0, 1]), "cross-coupled"
    elif form == "isotropic":
        size, how = float(matrix[0, 0]), "equal in all directions"
    else:
        sizes, axes = np.linalg.eigh(0.5 * (matrix + matrix.T))
        first = int(np.argmax(np.abs(sizes)))
        size = float(sizes[first])
        angle = math.degrees(math.atan2(axes[1, first], axes[0, first]))
        direction = (angle + 90.0) % 180.0 - 90.0
        second = float(sizes[1 - first])
        how = f"in one direction, {direction:.0f} deg"
        if abs(second) > Deciding.one_way * abs(size):
            how = f"unequal: {direction:.0f} deg and, {second / size:.2f} times as much, across"
    if name == "series_compliance":
        size = 1.0 / size if size else math.inf
    noun = {"series_compliance": "a spring", "parallel_stiffness": "a stiffness", "parallel_damping": "a damping"}[name]
    place = "between bearing and probes" if name == "series_compliance" else "beside the bearing"
    words = f"{noun} of {size:.3g} {unit} {how}, {place}"
    return Behaviour(kind, size, unit, direction, spread, words, name, values)


@dataclass(frozen=True)
class Drift:
    """How a parameter changes over the operating range."""

    effect: str
    parameter: str
    over: str
    start: float
    end: float
    words: str

    def to_dict(self) -> dict[str, object]:
        """Plain data, as in the contract."""
        renamed = {"start": "from", "end": "to"}
        return {renamed.get(name, name): value for name, value in vars(self).items()}


def drifts(fit: Fit, notable: float) -> tuple[Drift, ...]:
    """Look for drifts of the first amplitude of every effect of a fit, the most telling per effect."""
    out = []
    for fault, at in zip(fit.faults, fit.unknowns.slices, strict=True):
        if fault.is_term:
            continue
        rows = [_over(fit, fault, at.start, row) for row in Deciding.over]
        best = max((row for row in rows if row is not None), key=lambda row: row[0], default=None)
        if best is not None and best[0] > notable:
            out.append(best[1])
    return tuple(out)


def _over(fit: Fit, fault: Fault, index: int, row: tuple[str, str, int]) -> tuple[float, Drift] | None:
    """Rise of the log evidence where an amplitude may grow over a coordinate, and how it does."""
    name, coordinate, levels = row
    elements = fit.problem.observations.elements
    places = np.array([abs(e.place(coordinate)) if e.family in {"h", "temperature"} else math.nan for e in elements])
    finite_values = sorted(set(places[np.isfinite(places)]))
    if len(finite_values) < levels:
        return None
    middle = float(np.mean(finite_values))
    slope = np.nan_to_num(places / middle - 1.0)
    linear, moved = fit.linear, float(fit.posterior.mean[index])
    # per unit of relative growth; a prior of one: up to twice, down to nothing
    column = linear.jacobian[:, index] * slope * moved
    wider = Linear(
        linear.residual, np.append(linear.theta, 0.0), np.column_stack([linear.jacobian, column]),
        np.append(linear.width, 1.0),
    )  # fmt: skip
    state = posterior(fit.problem.errors, wider)
    plain = posterior(fit.problem.errors, linear)
    growth = float(state.mean[-1])
    ends = [
        _value(fault, index, fit, moved * (1.0 + growth * (v / middle - 1.0)))
        for v in finite_values[:: len(finite_values) - 1]
    ]
    size = abs(ends[1] - ends[0]) / max(abs(ends[0]), abs(ends[1]), 1e-300)
    if size < Deciding.same:
        return None
    parameter = fault.candidate.free[0]
    words = _words(ends, finite_values, name)
    rise = state.promised - plain.promised
    return rise, Drift(fault.label, parameter.name, name, ends[0], ends[1], words)


def _value(fault: Fault, index: int, fit: Fit, amplitude: float) -> float:
    """The fault's first parameter at an amplitude counted from where nothing happens."""
    at = next(s for s in fit.unknowns.slices if s.start == index)
    amplitudes = fit.posterior.mean[at] + fault.origin
    amplitudes[0] = amplitude + fault.origin[0]
    return fault.values(amplitudes)[fault.candidate.free[0].name]


def _words(ends: list[float], known: list[float], over: str) -> str:
    spoken = over.replace("_", " ")
    if min(ends) <= 0.0 < max(ends) or ends[0] == 0.0:
        return f"changes from {ends[0]:.3g} to {ends[1]:.3g} over the {spoken}"
    power = math.log(ends[1] / ends[0]) / math.log(known[-1] / known[0])
    if 0.8 < power < 1.2:
        return f"grows in proportion to the {spoken}"
    how = "grows" if abs(ends[1]) > abs(ends[0]) else "falls"
    return f"{how} over the {spoken}, about as its power {power:.1f}"
