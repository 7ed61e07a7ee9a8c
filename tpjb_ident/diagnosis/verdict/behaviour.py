"""Behaviour: what lies beyond the library, in few numbers, and what of the library drifts.

A spring in series, a parallel stiffness or damping; a pad whose clearance, bore or pivot is further off than stated;
an amplitude that is not the same at every load, speed and frequency.
"""

import math
from dataclasses import dataclass

import numpy as np

from model.effects import kind_of
from rigdata.arrays import FloatArray
from tpjb_ident.compare.effect_words import Estimate, finding, shown_unit
from tpjb_ident.diagnosis.comparison.evidence import Linear, posterior
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Fault
from tpjb_ident.diagnosis.forward.nuisance import OWN_NUMBERS
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import named, places
from tpjb_ident.schema import HALF_INTERVAL

#: What a pad by itself may be off by: the effect that says it, and the kind of behaviour.
_PADS = {"pad_offset": "clearance by pad", "pad_bore": "bore of a pad", "soft_pivot": "pivot law of a pad"}
#: What a generic term is: noun, unit and place.
_TERMS = {
    "series_compliance": ("a spring", "N/m", "between bearing and probes"),
    "parallel_stiffness": ("a stiffness", "N/m", "beside the bearing"),
    "parallel_damping": ("a damping", "N s/m", "beside the bearing"),
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
    """Pads of which a number is off by more than `visible` standard deviations of what is stated."""
    nuisances = {n.label: n for n in fit.problem.nuisances if n.effect.partition(" ")[0] in _PADS}
    out = []
    for deviation in fit.tolerances:
        nuisance = nuisances.get(deviation.name)
        if nuisance is None or abs(deviation.significance) < Deciding.visible:
            continue
        effect, _, number = nuisance.effect.split()
        number_kind, pad = OWN_NUMBERS[effect], float(number)
        error = math.sqrt(max(1.0 - deviation.heard, 0.0))
        half = HALF_INTERVAL * error
        size, low, high = (number_kind.parameter((deviation.size + off) * nuisance.sigma) for off in (0.0, -half, half))
        parameter = kind_of(effect).parameters[-1]
        estimate = Estimate(size, low, high, parameter.unit)
        words = finding(effect, {"pad": Estimate(pad, pad, pad), parameter.name: estimate})
        spread, parameters = error / abs(deviation.size), {"pad": pad, parameter.name: size}
        out.append(Behaviour(_PADS[effect], size, parameter.unit, None, spread, words, effect, parameters))
    return out


def _described(name: str, form: str, matrix: FloatArray, spread: float, values: dict[str, float]) -> Behaviour:
    noun, unit, place = _TERMS[name]
    direction: float | None = None
    if form == "cross-coupled":
        size, how = float(matrix[0, 1]), "cross-coupled"
    elif form == "isotropic":
        size, how = float(matrix[0, 0]), "equal in all directions"
    else:
        sizes, axes = np.linalg.eigh(0.5 * (matrix + matrix.T))
        first = int(np.argmax(np.abs(sizes)))
        size, second = float(sizes[first]), float(sizes[1 - first])
        direction = (math.degrees(math.atan2(axes[1, first], axes[0, first])) + 90.0) % 180.0 - 90.0
        how = f"in one direction, {direction:.0f} deg"
        if abs(second) > Deciding.one_way * abs(size):
            how = f"unequal: {direction:.0f} deg and, {second / size:.2f} times as much, across"
    if name == "series_compliance":
        size = 1.0 / size if size else math.inf
    words = f"{noun} of {size:.3g} {unit} {how}, {place}"
    return Behaviour(name.replace("_", " "), size, unit, direction, spread, words, name, values)


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


def drifts(fit: Fit) -> tuple[Drift, ...]:
    """Look for drifts of the first amplitude of every effect of a fit, the most telling per effect."""
    out = []
    for fault, at in zip(fit.faults, fit.unknowns.slices, strict=True):
        if fault.is_term:
            continue
        rows = [_over(fit, fault, at, row) for row in Deciding.over]
        best = max((row for row in rows if row is not None), key=lambda row: row[0], default=None)
        if best is not None and best[0] > Deciding.drifting:
            out.append(best[1])
    return tuple(out)


def _over(fit: Fit, fault: Fault, at: slice, row: tuple[str, str, int]) -> tuple[float, Drift] | None:
    """Rise of the log evidence where an amplitude may grow over a coordinate, and how it does."""
    name, coordinate, levels = row
    elements = fit.problem.observations.elements
    moving = np.isin(named(elements, "family"), ["h", "temperature"])
    coordinates = np.where(moving, np.abs(places(elements, coordinate)), math.nan)
    finite_values = np.unique(coordinates[np.isfinite(coordinates)]).tolist()
    if len(finite_values) < levels:
        return None
    middle = float(np.mean(finite_values))
    slope = np.nan_to_num(coordinates / middle - 1.0)
    linear, moved, errors = fit.linear, float(fit.posterior.mean[at.start]), fit.problem.errors
    # per unit of relative growth; a prior of one: up to twice, down to nothing
    wider = Linear(
        linear.residual, np.append(linear.theta, 0.0),
        np.column_stack([linear.jacobian, linear.jacobian[:, at.start] * slope * moved]), np.append(linear.width, 1.0),
    )  # fmt: skip
    state = posterior(errors, wider)
    parameter, ends = fault.candidate.parameter, []
    for level in (finite_values[0], finite_values[-1]):
        amplitudes = fit.posterior.mean[at].copy()
        amplitudes[0] = moved * (1.0 + float(state.mean[-1]) * (level / middle - 1.0))
        ends.append(fault.values(amplitudes + fit.unknowns.origin[at])[parameter.name])
    if abs(ends[1] - ends[0]) < Deciding.same * max(*map(abs, ends), 1e-300):
        return None
    rise = state.promised - posterior(errors, linear).promised
    words = _words(ends, finite_values, name, parameter.unit)
    return rise, Drift(fault.label, parameter.name, name, ends[0], ends[1], words)


def _words(ends: list[float], levels: list[float], over: str, unit: str) -> str:
    spoken, (unit, scale) = over.replace("_", " "), shown_unit(unit)
    if not 0.0 < ends[0] * ends[1] < math.inf:
        return f"changes from {ends[0] / scale:.3g} to {ends[1] / scale:.3g} {unit} over the {spoken}"
    power = math.log(ends[1] / ends[0]) / math.log(levels[-1] / levels[0])
    if 0.8 < power < 1.2:
        return f"grows in proportion to the {spoken}"
    how = "grows" if power > 0.0 else "falls"
    return f"{how} over the {spoken}, about as its power {power:.1f}"
