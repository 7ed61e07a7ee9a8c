"""Unknowns: the free numbers of an explanation, and what the bearing model predicts with them.

Amplitudes of effects come first, then the sizes of all tolerances, a fault's own number among them: it differs in the
width of its prior. All are counted from their priors' means.
"""

from collections.abc import Sequence

import numpy as np

from model.effects import Effect
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.forward.nuisance import predict
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.errors import TpjbError

#: Steps of derivatives: share of a fault's prior width, stated deviations of a tolerance.
_SHARE, _DEVIATIONS = 1.0 / 30.0, 0.3
#: Where an explanation is: its faults and free numbers.
Place = tuple[tuple[Fault, ...], FloatArray]


class Unknowns:
    """The free numbers of a model with some faults beside all tolerances."""

    def __init__(self, problem: Problem, faults: Sequence[Fault]) -> None:
        self.problem, self.faults = problem, tuple(faults)
        plain = np.tile([[0.0], [1.0], [-Deciding.reach], [Deciding.reach]], len(problem.nuisances))
        priors = np.hstack([*(fault.prior for fault in faults if fault.own < 0), plain])
        #: of effects without a tolerance of their own: the first ones
        self.amplitudes = priors.shape[1] - plain.shape[1]
        self.slices: list[slice] = []  #: where every fault's amplitudes are
        start = 0
        for fault in faults:
            count = len(fault.width)
            first = start if fault.own < 0 else self.amplitudes + fault.own
            start += count if fault.own < 0 else 0
            self.slices.append(slice(first, first + count))
            priors[:, self.slices[-1]] = fault.prior
        #: where the faults' numbers are
        self.of_faults: list[int] = []
        for at in self.slices:
            self.of_faults += range(at.start, at.stop)
        self.origin, self.width, self.low, self.high = priors
        plain_rows = np.delete(np.arange(plain.shape[1]), [fault.own for fault in faults if fault.own >= 0])
        #: (t,): where tolerances with their stated prior are
        self.tolerances = self.amplitudes + plain_rows

    @property
    def is_reading(self) -> list[bool]:
        """Which numbers act on readings alone: their derivative is known without a prediction, (k,)."""
        return [False] * self.amplitudes + [nuisance.column is not None for nuisance in self.problem.nuisances]

    def effects(self, theta: FloatArray) -> tuple[Effect, ...]:
        """The faults as effects."""
        amplitudes = theta + self.origin
        pairs = zip(self.faults, self.slices, strict=True)
        return tuple(Effect(fault.name, **fault.values(amplitudes[at])) for fault, at in pairs)

    def predict(self, forward: Forward, theta: FloatArray) -> FloatArray | None:
        """Prediction in units of sigma, (n,); None where the model has no equilibrium."""
        amplitudes = theta + self.origin
        pairs = zip(self.faults, self.slices, strict=True)
        effects = [fault.candidate.effect(amplitudes[at]) for fault, at in pairs if fault.own < 0]
        problem = self.problem
        try:
            return problem.scaled(predict(forward, effects, problem.nuisances, amplitudes[self.amplitudes :]))
        except (ValueError, ArithmeticError, TpjbError):
            return None


def prediction(
    forward: Forward, problem: Problem, faults: tuple[Fault, ...], theta: FloatArray, patient: bool = False
) -> FloatArray | None:
    """Job: the prediction at a point; patient: whatever it takes to find an equilibrium."""
    forward.cache.patient = patient
    return Unknowns(problem, faults).predict(forward, theta)


def derivatives(
    forward: Forward, problem: Problem, faults: tuple[Fault, ...], theta: FloatArray, indices: Sequence[int]
) -> list[FloatArray | None]:
    """Job: derivatives of the prediction by some numbers, each from the point's own solved state, (n,) each."""
    unknowns = Unknowns(problem, faults)
    at_point = unknowns.predict(forward, theta)
    out = []
    for index in indices:
        step = _SHARE * unknowns.width[index]
        if index >= unknowns.amplitudes:  # towards zero: there the model surely has an equilibrium
            step = -max(step, _DEVIATIONS) if theta[index] > 0.0 else max(step, _DEVIATIONS)
        out.append(None if at_point is None else _difference(forward, unknowns, theta, at_point, (index, step)))
    return out


def _difference(
    forward: Forward, unknowns: Unknowns, theta: FloatArray, at_point: FloatArray, moved: tuple[int, float]
) -> FloatArray | None:
    """One difference; the other way where the first is out of bounds or has no equilibrium."""
    index, step = moved
    for signed in (step, -step):
        neighbour = theta.copy()
        neighbour[index] += signed
        if unknowns.low[index] <= neighbour[index] <= unknowns.high[index]:
            changed = unknowns.predict(forward.fresh(near=True), neighbour)
            if changed is not None:
                return np.asarray((changed - at_point) / signed)
    return None


def path_changes(
    forward: Forward, problem: Problem, place: Place, asked: Sequence[tuple[Fault, Sequence[float]]], most: int
) -> list[list[tuple[float, FloatArray]]]:
    """Job: changes of the prediction from a place along every fault's first amplitude, at `most` of its nodes."""
    (faults, theta), forward = place, forward.of_differences
    base = Unknowns(problem, faults).predict(forward, theta)
    if base is None:
        return [[] for _ in asked]
    return [
        _changes(forward, Unknowns(problem, (*faults, fault)), (theta, base), nodes, most) for fault, nodes in asked
    ]


def _changes(
    forward: Forward, unknowns: Unknowns, place: tuple[FloatArray, FloatArray], nodes: Sequence[float], most: int
) -> list[tuple[float, FloatArray]]:
    """Changes along the first amplitude of the last fault, where there is an equilibrium."""
    (theta, base), at = place, unknowns.slices[-1].start
    if len(theta) < len(unknowns.width):
        theta = np.insert(theta, at, 0.0)
    out: list[tuple[float, FloatArray]] = []
    for node in nodes:
        node_place = theta.copy()
        node_place[at] = node
        if len(out) < most and unknowns.low[at] <= node <= unknowns.high[at]:
            changed = unknowns.predict(forward.fresh(), node_place)
            if changed is not None:
                out.append((node, changed - base))
    return out
