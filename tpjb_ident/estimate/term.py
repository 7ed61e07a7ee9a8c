"""What a term of the measurement equation is: parameters with priors, and what they do to the readings.

A term speaks of readings. It knows nothing of residuals, weights or points, nor of the solve: that makes it one file.
A user's own term is a subclass handed to `tpjb_ident.estimate.solve`; docs/design.md has a worked example.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.equation import HOUSING_ROWS, Blocks, Rig, State, film_change_rows

if TYPE_CHECKING:
    from tpjb_ident.estimate.solve import Solution

#: Largest logarithm of a factor.
_LARGEST = 5.0
#: Of a change of H that a film's lines show so much is allowed for: they are right within a fifth.
ALLOWED_CHANGE = 1.3
#: Change of H over the share of the force at f - 2X that goes with the motion at f.
CHANGE_BY_ORBIT = 2.0
#: A change is no larger than what is allowed for; as a standard deviation it is this part of it.
CHANGE_AS_DEVIATION = 1 / 1.6
#: Changes below this share are not worth telling [share of H].
_LEAST_CHANGE = 2e-4
#: Difference of sensors beyond any calibration: an axis, a sign or a cable is wrong.
NO_GAIN = 0.2
#: Condition of accelerometers that lead the cells: the housing's test finds it, the delay tells whether it stays.
OUT_OF_STEP = "cells-and-accelerometers-out-of-phase"


def worth_stating(share: float) -> float:
    """A share by which H may change, none where it is too small to tell."""
    return share if share > _LEAST_CHANGE else 0.0


@dataclass(frozen=True)
class Parameter:
    """One number of a term, with what is stated of it beforehand."""

    name: str
    unit: str
    deviation: float  #: prior standard deviation, in `unit`
    mean: float = 0.0
    harmless: float = 0.0  #: deviation below which none is worth contradicting, in `unit`; infinite: no record does

    def at_least(self, deviation: float) -> Parameter:
        """The parameter, known no better than this."""
        return replace(self, deviation=max(self.deviation, deviation))


@dataclass(frozen=True)
class Fitted:
    """What the records made of a term's parameters, (q,) each."""

    value: FloatArray
    deviation: FloatArray
    estimated: np.ndarray  #: bool: else the records tell too little, and the prior stands
    unexplained: float = 0.0  #: scatter of the housing's equations over its acceleration


class Term:
    """A source of systematic error.

    Attributes
    ----------
    name : str
        As in the budget.
    parameters : tuple of Parameter
        None: the term does not apply to the campaign.
    points : tuple of int
        Points that each have as many of the parameters for their own, in this order; none where all points share them.
    start : tuple of float
        Where steps to the parameters begin; none: at their means.
    always_estimated : bool
        Whether its parameters are estimated however little the records tell; else only where they tell clearly more
        than the prior.
    never_estimated : bool or array
        Whether no record can tell them, or which of them: their priors pass into the covariance, whatever the equations
        seem to say.
    contradiction, gross : str, float
        Condition of a parameter whose prior the records contradict, as stated or usual of sound instruments: they are
        held against it. How far off it is, in its unit, that no calibration has.
    stated : tuple of Parameter
        What may be contradicted: the parameters as stated, or what is harmless.
    sentence, scale : str, float
        Said of every parameter `p` that the records tell, with its `value` and its `error` times the scale.

    Examples
    --------
    >>> from tpjb_ident.terms.registry import TERMS
    >>> [term.name for term in TERMS][:3]
    ['calibration', 'run gain', 'temperature']
    """

    name = ""
    always_estimated = False
    never_estimated: bool | BoolArray = False
    parameters: tuple[Parameter, ...] = ()
    points: tuple[int, ...] = ()
    start: tuple[float, ...] = ()
    contradiction = ""
    gross = np.inf
    sentence = ""
    scale = 1.0

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        self.rig = rig
        self.prepare(rig, blocks)
        self.stated = tuple(p.at_least(p.harmless) for p in self.parameters)
        wide = [rig.widened.get((self.name, p.name), 0.0) for p in self.parameters]
        self.parameters = tuple(p.at_least(size) for p, size in zip(self.parameters, wide))

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Take from rig and blocks what the term needs: its parameters, where it applies."""

    @property
    def width(self) -> int:
        """Number of columns: of the parameters, or of those of one point."""
        return len(self.parameters) // max(len(self.points), 1)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """Change of the readings per unit of every parameter at the true motion, (n, m + 2, q).

        Of a term whose parameters are the points' own: those of the block's point.
        """
        raise NotImplementedError

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """Bring the parameters' values (q,) into the state."""
        raise NotImplementedError

    def random_effects(self, blocks: Blocks, state: State) -> ComplexArray | None:
        """Patterns of the readings whose size is another one in every block, of one deviation, (n, m + 2, k)."""
        return None

    def slope_columns(self, blocks: Blocks, reading: ComplexArray) -> ComplexArray:
        """Change of the readings' slope over time [1/s] per unit of every parameter, (n, m, q); `reading` (n, m)."""
        return np.zeros((*reading.shape, len(self.parameters)), complex)

    def learnt_share(self, fitted: Mapping[str, Fitted]) -> FloatArray:
        """What is left of the priors by what other terms have `fitted`, (q,): of parameters that no record tells."""
        return np.ones(len(self.parameters))

    def learnt(self, rig: Rig, solution: Solution) -> Rig:
        """The rig as uncertain as a solve shows it, by a test of the term's own; itself where that says nothing."""
        return rig

    def standing_on(self, fitted: Fitted) -> ComplexArray | None:
        """Compliance of the springs under the housing (2, 2) [m/N], of the term that knows it."""
        return None

    def conditions(self, fitted: Fitted) -> Conditions:
        """What to say where the records contradict what was stated."""
        off = {p: self.rig.widened.get((self.name, p.name), 0.0) for p in self.stated}
        times = [f"{p.name} ({size / p.deviation:.0f} times)" for p, size in off.items() if size]
        if not times:
            return ()
        text = f"{'; '.join(self.words(fitted))}: beyond the uncertainty stated of {', '.join(times)}"
        name = "records-contradicted" if max(off.values()) > self.gross else self.contradiction
        return (Condition(name, text.lstrip(": ")),)

    def point_conditions(self, point: int, fitted: Fitted, h: ComplexArray) -> Conditions:
        """What to say of one point (its number), `h` (2, 2) [N/m]."""
        return ()

    def words(self, fitted: Fitted) -> tuple[str, ...]:
        """One sentence a parameter that the records tell."""
        figures = zip(self.parameters, self.scale * fitted.value, self.scale * fitted.deviation, fitted.estimated)
        said = [self.sentence.format(p=p, value=value, error=error) for p, value, error, told in figures if told]
        return tuple(sentence for sentence in said if sentence)

    def no_columns(self, blocks: Blocks) -> ComplexArray:
        """Zeros to be filled in, (n, m + 2, q)."""
        n, m = blocks.z.shape
        return np.zeros((n, m + HOUSING_ROWS, self.width), complex)


class Factor(Term):
    """A term that multiplies readings: exp(sum of parameter times exponent); `sensors` (m, q) that each has part in."""

    sensors: FloatArray

    def rate(self, blocks: Blocks) -> ComplexArray | FloatArray:
        """Change of the logarithm of a sensor's readings per unit of a parameter that it has part in, (n,)."""
        raise NotImplementedError

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """Change of the readings' logarithm per unit of every parameter, (n, m, q)."""
        return np.asarray(self.rate(blocks)[:, None, None] * self.sensors, complex)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """Exponent times reading."""
        columns = self.no_columns(blocks)
        m = blocks.z.shape[1]
        columns[:, :m] = self.exponent(blocks) * state.reading(self.rig, blocks)[:, :m, None]
        return columns

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """Multiply the state's factor."""
        logarithm = self.exponent(blocks) @ value
        # a start far off may ask for anything; a gain beyond e^5 is no reading any more
        state.factor *= np.exp(np.clip(logarithm.real, -_LARGEST, _LARGEST) + 1j * logarithm.imag)


class Additive(Term):
    """A term that adds to readings."""

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """Add to the state's shift."""
        state.shift += self.shift(blocks, state, value)

    def shift(self, blocks: Blocks, state: State, value: FloatArray) -> ComplexArray:
        """What the parameters' values (q,) add to the readings, (n, m + 2)."""
        columns = self.columns(blocks, state)
        if not self.points:
            return columns @ value
        table = np.zeros((len(blocks.points), self.width))
        table[list(self.points)] = value.reshape(-1, self.width)
        return np.einsum("nrl,nl->nr", columns, table[blocks.point])


class FilmTerm(Additive):
    """A term that changes H of the runs: points of one group by the same numbers, `group` (P,), -1 by none."""

    group: IntArray

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """Change of a block's H per unit of every number of its group, (n, k, 2, 2) [N/m]."""
        raise NotImplementedError

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """The changes' forces in the readings, those of a block's own group; points' own numbers are one group each."""
        rows = film_change_rows(self.rig, blocks, state, self.changes(blocks, state))
        if self.points:
            return rows
        n, m, k = rows.shape
        group = self.group[blocks.point]
        columns = np.zeros((n, m, self.width // k, k), complex)
        mine = np.flatnonzero(group >= 0)
        columns[mine, :, group[mine]] = rows[mine]
        return columns.reshape(n, m, self.width)

    def film_change(self, blocks: Blocks, state: State, value: FloatArray) -> ComplexArray:
        """By how much H of a run differs from its point's, (n, 2, 2) [N/m]."""
        changes, group = self.changes(blocks, state), self.group[blocks.point]
        numbers = value.reshape(-1, changes.shape[1])[group] * (group >= 0)[:, None]
        return np.einsum("nk,nkij->nij", numbers, changes)


def numbered(name: str, unit: str, deviations: Sequence[float]) -> tuple[Parameter, ...]:
    """Parameters that differ by a number after their name."""
    return tuple(Parameter(f"{name}, {i}", unit, deviation) for i, deviation in enumerate(deviations))
