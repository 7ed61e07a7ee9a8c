"""One solve for all blocks of a campaign: H of every point together with what its sensors share, by Gauss-Newton.

Columns are taken at the fitted true motion (variable projection), which is what keeps noise of the displacements from
pulling H towards zero: there is no separate step of errors in variables.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.arrowhead import NUMBERS, Prior, Shape, Step, Sums, are_told, step
from tpjb_ident.estimate.equation import (
    HOUSING_ROWS,
    UNKNOWNS,
    Blocks,
    Rig,
    State,
    adjoint,
    film_columns,
    film_force_rows,
    motion_matrix,
    totals,
    vector,
    with_factor,
)
from tpjb_ident.estimate.noise import HOUSING_NOISE, covariance, housing_noise, scatter_patterns, slopes_over_load
from tpjb_ident.estimate.scatter import PHASES, AlongForce, ForceScatter, Residuals, Scatter, mixed_dof
from tpjb_ident.estimate.score import LIKELY, Distances, Score, clear_limit
from tpjb_ident.estimate.term import Additive, FilmTerm, Fitted, Term

#: Standard deviation that a parameter has at least, in its unit.
_LEAST = 1e-9


class Table:
    """Parameters of some terms; where a row has none of a term, its place stays as it is.

    `row` (P,): row of every point, None where all points share one. What another solve made of terms (`held`, by
    name) stays as it is, with its error.
    """

    def __init__(
        self, terms: Sequence[Term], rows: int, row: IntArray | None = None, held: Mapping[str, Fitted] | None = None
    ) -> None:
        self.terms, self._shared = list(terms), row is None
        ends = np.cumsum([0] + [term.width for term in terms]).tolist()
        self.mean, begin, deviation = (np.full((rows, ends[-1]), usual) for usual in (0.0, 0.0, 1.0))
        self.always, self.never = np.zeros((2, rows, ends[-1]), dtype=bool)
        self._place: dict[str, tuple[IntArray, slice]] = {}
        for term, first, last in zip(terms, ends, ends[1:]):
            mine = np.zeros(1, dtype=np.intp) if row is None else row[list(term.points)]
            assert len(np.unique(mine)) == len(mine), f"{term.name}: points of one group have nothing of their own"
            place = self._place[term.name] = (mine, slice(first, last))
            known = (held or {}).get(term.name)
            mean = [p.mean for p in term.parameters] if known is None else known.value
            spread = [p.deviation for p in term.parameters] if known is None else known.deviation
            self.mean[place] = np.reshape(mean, (-1, term.width))
            begin[place] = np.reshape(term.start or mean, (-1, term.width)) if known is None else self.mean[place]
            deviation[place] = np.maximum(np.reshape(spread, (-1, term.width)), _LEAST)
            self.always[place] = term.always_estimated and known is None
            self.never[place] = True if known is not None else term.never_estimated
        self.precision = 1 / deviation**2
        self.value = begin

    def of(self, term: Term, values: FloatArray | BoolArray) -> FloatArray:
        """A term's part of values (rows, columns), in the order of its parameters."""
        return np.asarray(values[self._place[term.name]].ravel())

    def chosen(self, term: Term) -> BoolArray:
        """Places of a term's parameters, (rows, columns)."""
        mask = np.zeros(self.mean.shape, dtype=bool)
        mask[self._place[term.name]] = True
        return mask

    def prior(self) -> Prior:
        """What is known beforehand, as far as the values are from their means; without rows where all share one."""
        parts = (self.mean - self.value, self.precision, self.always, self.never)
        return Prior(*(part[0] for part in parts)) if self._shared else Prior(*parts)


#: Steps of Gauss-Newton, at most, and the relative change of H at which it ends.
_STEPS, _CONVERGED = 18, 1e-9
#: Steps in which weights and scatter follow.
_SCATTER_STEPS = 12
#: Steps after which the noise of the housing is found: at first, and where what turns with the shaft has settled.
_HOUSING_STEPS = (3, 7)
#: Change of H in one step, of its size, at most: a line next to noise could run away.
_LARGEST_STEP = 1.0
#: Weight of an unknown beside a block's best told one below which nothing is told of it.
_UNTOLD = 1e-14
#: Blocks whose arrays are held at a time.
_CHUNK = 4096


@dataclass(frozen=True, repr=False)
class Solution:
    """H of every point with its covariance by source; points of a shape are its groups, each with its k numbers."""

    h: ComplexArray  #: (P, 2, 2), N/m: at the frequency found; NaN where the runs do not tell it
    records: FloatArray  #: (P, 8, 8), (N/m)^2
    shares: dict[str, FloatArray]  #: (P, 8, 8) by term, (N/m)^2
    factors: FloatArray  #: (q, P, 8), N/m: a standard deviation of every shared parameter
    fitted: dict[str, Fitted]
    terms: tuple[Term, ...]  #: those with parameters
    all_terms: tuple[Term, ...]
    rig: Rig
    blocks: Blocks
    group: IntArray  #: of every point
    scatter: Scatter
    chi_square: FloatArray  #: (P,): of the blocks' equations, reduced
    spare: FloatArray  #: (P,): real equations beyond the unknowns
    scatter_share: FloatArray  #: (n, 4): of the components' variance that is the runs' scatter
    factor: ComplexArray  #: (n, m): what multiplies the readings of every block
    shift: ComplexArray  #: (n, m), SI: what is in the readings beside the motion's part
    run_change: ComplexArray  #: (n, 2, 2), N/m: H of a run beside that of its point
    contradicted: Distances  #: parameters that contradict what is stated of them
    supposed: Distances  #: those of one term that may
    ran_away: bool = False  #: no point has an answer

    def blocks_of(self, group: int) -> BoolArray:
        """Blocks of a group, (n,)."""
        return self.group[self.blocks.point] == group

    def noise_freedom(self, group: int) -> float:
        """Real degrees of freedom of the noise of a group's records."""
        return 2 * float(np.median(self.blocks.dof[self.blocks_of(group)]))

    def freedom(self, group: int) -> FloatArray:
        """Degrees of freedom of a group's random part (k,): its records' noise and its runs' scatter."""
        total, chosen = np.diag(self.records[group]), self.blocks_of(group)
        share = np.average(self.scatter_share[chosen], axis=0, weights=np.maximum(self.scatter.weights[chosen], 1e-9))
        phase = (np.arange(len(total)) // 4) % 2  # stiffness, damping, mass: four numbers each
        repeat = np.array([1 - share[components].mean() for components in PHASES])[phase] * total
        between = np.array([self.scatter.freedom(group, components) for components in PHASES])[phase]
        return mixed_dof(total, repeat, self.noise_freedom(group), between)

    @property
    def springs(self) -> ComplexArray | None:
        """Compliance of what the housing stands on (2, 2) [m/N]; None where no accelerometer shows it."""
        compliances = (term.standing_on(self.fitted[term.name]) for term in self.terms)
        return next((compliance for compliance in compliances if compliance is not None), None)

    def conditions(self) -> Conditions:
        """What the terms' tests say of the rig: it touches every point."""
        conditions: Conditions = ()
        for term in self.terms:
            conditions += term.conditions(self.fitted[term.name])
        text = "the runs together give no H, as where they are driven below their noise: it is the windows' alone"
        # where a gain explains what an axis does as well, the gain is told
        return tuple(dict.fromkeys((*conditions, *holding((self.ran_away, "iteration-limit", text)))))


class Solver:
    """Gauss-Newton over all blocks, from a start of H; points share its numbers as the shape says."""

    def __init__(
        self, rig: Rig, blocks: Blocks, terms: Sequence[Term], start: ComplexArray, shape: Shape | None = None
    ) -> None:
        self.rig, self.blocks = rig, blocks
        self.shape = shape or Shape(np.arange(len(blocks.points)))
        self.group = self.shape.group[blocks.point]
        self.all_terms = tuple(terms)
        self.random = tuple(term for term in terms if type(term).random_effects is not Term.random_effects)
        self.terms = tuple(term for term in terms if term.parameters)
        self.shared = Table([term for term in self.terms if not term.points], 1, held=self.shape.held)
        self.by_point = Table([term for term in self.terms if term.points], self.shape.groups, self.shape.group)
        runs = totals(blocks.point, np.asarray(blocks.present.any(axis=1)), len(blocks.points))
        enough = 4 * runs >= min(self.shape.numbers, NUMBERS)  # a run has four equations of the film
        self.solvable = np.isfinite(start).all(axis=(1, 2)) & enough
        self.answered = totals(self.shape.group, self.solvable, self.shape.groups) > 0
        self.unit = float(np.median(np.abs(start[self.solvable]))) if self.solvable.any() else 1.0
        self.h = np.where(self.solvable[:, None, None], start, self.unit * np.eye(2))
        self.u = np.zeros((len(blocks), UNKNOWNS), complex)
        self.scatter = self.shape.scatter or Scatter.none(self.shape.groups, len(blocks))
        self.moved = False
        self.housing_noise = HOUSING_NOISE[rig.mount]

    def run(self) -> Solution:
        """Steps until H rests; where it runs away, once more without it: no point has an answer then."""
        try:
            return self._settled()
        except np.linalg.LinAlgError:
            none = np.full_like(self.h, np.nan)
            nothing = Solver(self.rig, self.blocks, self.all_terms, none, self.shape)
            return replace(nothing._settled(), ran_away=True)

    def _settled(self) -> Solution:
        # runs that stand apart are told at the robust start, before one of them pulls the others away
        fit = self._sums(first=True)[1]
        self.scatter = self.scatter.updated(self.group, fit, self.answered, 0)
        for count in range(1, _STEPS + 1):
            sums, fit = self._sums()
            last = step(sums, self.shared.prior(), self.by_point.prior())
            change = self._move(last)
            if count in _HOUSING_STEPS:
                m = self.blocks.z.shape[1]
                misfit = [state.reading(self.rig, blocks)[:, m:] for _, blocks, state in self._states()]
                self.housing_noise = housing_noise(self.rig, self.blocks, self.u, np.concatenate(misfit))
            if self.scatter.follows and count < _SCATTER_STEPS:
                self.scatter = self.scatter.updated(self.group, fit, self.answered, count)
            elif count > 3 and change < _CONVERGED:
                break
        sums, fit = self._sums()
        last = step(sums, self.shared.prior(), self.by_point.prior())
        return self._solution(last, fit)

    def _value(self, term: Term) -> FloatArray:
        """Values of a term's parameters."""
        table = self.by_point if term.points else self.shared
        return table.of(term, table.value)

    def _states(self) -> Iterator[tuple[slice, Blocks, State]]:
        """Places of some blocks at a time, the blocks, and the last iterate for them."""
        h = np.where(self.solvable[:, None, None], self.h, np.nan)
        slope, with_slope = slopes_over_load(self.blocks.points, h)
        for first in range(0, max(len(self.blocks), 1), _CHUNK):
            places = slice(first, first + _CHUNK)
            blocks = self.blocks.part(places)
            yield places, blocks, self._state(blocks, places, slope, with_slope & self.rig.to_set_point)

    def _sums(self, first: bool = False) -> tuple[Sums, Residuals]:
        k = self.shape.numbers
        sums = Sums.empty(self.shape.groups, self.shared.value.size, k + self.by_point.value.shape[1])
        fits = []
        for places, blocks, state in self._states():
            group = self.group[places]
            rows = self._rows(blocks, state, self.scatter.variance[group])
            self.u[places] = state.u
            weight = np.sqrt(self.scatter.weights[places] * self.solvable[blocks.point])
            sums.add(group, weight, rows.r, rows.J, rows.J_t)
            self._add_slopes(sums, group, weight, blocks, state)
            fits.append((group, rows, weight**2))
        if first:  # a point whose readings leave a number untold has no answer
            self.answered &= are_told(sums.A[:, :k, :k])
            self.solvable &= self.answered[self.shape.group]
        sums.drop(~self.answered | ~sums.A.any(axis=(1, 2)), k)  # none of its blocks counts
        conditional = np.asarray(np.linalg.inv(sums.A[:, :k, :k]), dtype=float)
        parts = [rows.residuals(weight, conditional[group]) for group, rows, weight in fits]
        joined = []
        for name in Residuals.__dataclass_fields__:
            joined.append(np.concatenate([getattr(part, name) for part in parts]))
        return sums, Residuals(*joined)

    def _state(self, blocks: Blocks, places: slice, slope: ComplexArray, with_slope: BoolArray) -> State:
        n, m = blocks.z.shape
        state = State(
            self.h,
            slope,
            with_slope,
            np.zeros((2, 2), complex),
            np.eye(2, dtype=complex) * (self.rig.mount == "floating"),
            np.ones((n, m), complex),
            np.zeros((n, m + HOUSING_ROWS), complex),
            self.u[places],
            self.rig.bare.at(blocks.omega),
            {term.name: self._value(term) for term in self.terms},
        )
        self._apply(blocks, state, additive=False)
        if not self.moved:
            d, a = (vector(self.rig, blocks, quantity) for quantity in ("displacement", "acceleration"))
            state.u = np.nan_to_num(np.concatenate([d, a], axis=1))
        self._apply(blocks, state, additive=True)
        return state

    def _apply(self, blocks: Blocks, state: State, additive: bool) -> None:
        for term in self.terms:
            if isinstance(term, Additive) == additive:
                term.apply(blocks, state, state.parameters[term.name])

    def _rows(self, blocks: Blocks, state: State, scatter: FloatArray) -> _Rows:
        """Equations of blocks without their motion, real and of unit variance; the state's motion is renewed."""
        rig = self.rig
        N = covariance(rig, blocks, state, scatter.mean(axis=1), self.housing_noise)
        # of the same motion as N, which holds their mean
        motion, sizes = state.u[:, :2], scatter_patterns(blocks, state, np.ones(len(blocks)))
        forces = film_force_rows(rig, blocks, state, np.stack(sizes, axis=2))
        for term in self.random:
            effects = term.random_effects(blocks, state)
            if effects is not None:
                N = N + effects @ adjoint(effects)
        L = np.linalg.cholesky(N)
        TB = with_factor(state.factor, motion_matrix(rig, blocks, state))
        Q, R = np.linalg.qr(np.linalg.solve(L, TB), mode="complete")
        Q1, Q2 = (adjoint(part) for part in (Q[:, :, :UNKNOWNS], Q[:, :, UNKNOWNS:]))
        z = np.concatenate([blocks.z, np.zeros((len(blocks), HOUSING_ROWS))], axis=1) - state.shift
        z[:, : blocks.z.shape[1]] *= blocks.present
        white = np.linalg.solve(L, z[:, :, None])
        # ones on the diagonal where a block's readings tell nothing of an unknown
        size = np.abs(np.einsum("nii->ni", R[:, :UNKNOWNS]))
        untold = size <= _UNTOLD * size.max(axis=1, keepdims=True)
        regular = R[:, :UNKNOWNS] + untold[:, :, None] * np.eye(UNKNOWNS)
        state.u = np.linalg.solve(regular, Q1 @ white)[:, :, 0]
        film = film_columns(rig, blocks, state) * self.unit
        by_point = [term.columns(blocks, state) for term in self.by_point.terms]
        shared = [term.columns(blocks, state) for term in self.shared.terms]
        columns = np.concatenate([film, 1j * film, *by_point, *shared], axis=2)
        patterns = Q2 @ np.linalg.solve(L, forces)
        components = ForceScatter.of(patterns, motion, state.at_run(blocks), scatter)
        projected = components.white(_real(Q2 @ np.linalg.solve(L, columns)))
        r = components.white(_real(Q2 @ white))[:, :, 0]
        J_film, J_own, J_t = np.split(projected, [NUMBERS, NUMBERS + self.by_point.value.shape[1]], axis=2)
        J_h = self.shape.mapped(J_film, blocks.point)
        counted = 2.0 * (blocks.present.sum(axis=1) + HOUSING_ROWS - UNKNOWNS)
        return _Rows(r, np.concatenate([J_h, J_own], axis=2), J_t, components.along(r, J_h), counted)

    def _add_slopes(self, sums: Sums, group: IntArray, weight: FloatArray, blocks: Blocks, state: State) -> None:
        """How readings turn within a record: c z_j - i omega rate z_j, the drive's own change c eliminated."""
        if all(type(term).slope_columns is Term.slope_columns for term in self.shared.terms):
            return
        m = blocks.z.shape[1]
        usable = (blocks.windows > 3) & blocks.present.all(axis=1)
        reading = state.reading(self.rig, blocks)[:, :m]
        columns = np.concatenate([t.slope_columns(blocks, reading) for t in self.shared.terms], axis=2)
        L = np.linalg.cholesky(np.where(usable[:, None, None], blocks.slope_noise, np.eye(m)))
        Q = np.linalg.qr(np.linalg.solve(L, blocks.z[:, :, None]), mode="complete")[0]
        Q2 = adjoint(Q[:, :, 1:])
        J = _real(Q2 @ np.linalg.solve(L, columns))
        r = _real(Q2 @ np.linalg.solve(L, blocks.slope[:, :, None]))[:, :, 0] - J @ self.shared.value[0]
        sums.add(group, weight * usable, r, np.zeros((*r.shape, sums.A.shape[1])), J)

    def _move(self, last: Step) -> float:
        x = last.h * self.unit
        relative = np.abs(self.shape.change(x)).max(axis=(1, 2)) / np.abs(self.h).max(axis=(1, 2))
        largest = np.zeros(self.shape.groups)
        np.maximum.at(largest, self.shape.group, np.where(self.solvable, relative, 0.0))
        damped = np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, _LARGEST_STEP))
        change = self.shape.change(x * damped[:, None]) * self.solvable[:, None, None]
        self.h = self.h + change
        self.shared.value = self.shared.value + last.theta
        self.by_point.value = self.by_point.value + last.by_point.change
        self.moved = True
        size = np.abs(self.h).max(axis=(1, 2))
        return float((np.abs(change).max(axis=(1, 2)) / size).max(initial=0.0))

    def _solution(self, last: Step, fit: Residuals) -> Solution:
        groups = self.shape.groups
        factors = last.factors()
        fitted, shares = {}, {}
        for term in self.terms:
            if term.points:
                table, deviation, estimated = self.by_point, last.by_point.deviation, last.by_point.estimated
            else:
                table, deviation, estimated = self.shared, last.deviation[None], last.estimated[None]
            posterior = table.of(term, deviation), table.of(term, estimated)
            fitted[term.name] = Fitted(self._value(term), *posterior, self.housing_noise)
        for term in self.terms:
            if term.points:
                share = last.point_share(self.by_point.chosen(term))
            else:
                chosen = self.shared.chosen(term)[0]
                factors[chosen] *= term.learnt_share(fitted)[:, None, None]
                share = np.einsum("qpa,qpb->pab", factors[chosen], factors[chosen])
            shares[term.name] = share * self.unit**2
        weight = self.scatter.weights
        chi_square = totals(self.group, weight * fit.chi_square, groups)
        counted = totals(self.group, fit.rows * (weight > 0.05), groups)
        spare = counted - self.shape.numbers
        return Solution(
            np.where(self.solvable[:, None, None], self.h, np.nan),
            last.records * self.unit**2,
            shares,
            factors * self.unit,
            fitted,
            self.terms,
            self.all_terms,
            self.rig,
            self.blocks,
            self.shape.group,
            self.scatter,
            chi_square / np.maximum(spare, 1.0),
            spare,
            np.clip(self.scatter.variance[self.group] * fit.information, 0.0, 1.0),
            *self._apart(),
            *self._contradictions(last),
        )

    def _contradictions(self, last: Step) -> tuple[Distances, Distances]:
        """How far off parameters are that contradict what is stated; and those of the likeliest term, if any may."""
        tested = [term for term in self.shared.terms if term.contradiction and self.answered.any()]
        scores = [Score.of(term, self.shared.chosen(term)[0], last) for term in tested]
        if not scores:
            return {}, {}
        clear: Distances = {}
        limit = clear_limit(self.scatter, self.blocks, len(self.rig.widened))
        for score in scores:
            clear |= score.off(limit)
        return clear, max(scores, key=lambda score: score.clearest).off(LIKELY)

    def _apart(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Factor and shift of the blocks' readings (n, m), and how their H differs from their point's (n, 2, 2)."""
        factors, shifts, changes = [], [], []
        for _, blocks, state in self._states():
            change = state.at_run(blocks) - self.h[blocks.point]
            shift = np.zeros_like(blocks.z)
            for term in self.terms:
                value = state.parameters[term.name]
                if isinstance(term, FilmTerm):
                    change = change + term.film_change(blocks, state, value)
                elif isinstance(term, Additive):
                    shift = shift + term.shift(blocks, state, value)[:, : shift.shape[1]]
            factors.append(state.factor)
            shifts.append(shift)
            changes.append(change)
        return np.concatenate(factors), np.concatenate(shifts), np.concatenate(changes)


@dataclass(frozen=True)
class _Rows:
    r: FloatArray  #: (n, k)
    J: FloatArray  #: (n, k, numbers): of the points' numbers of H and of their own parameters
    J_t: FloatArray  #: (n, k, q)
    along: AlongForce
    counted: FloatArray  #: (n,): equations that say something

    def residuals(self, weight: FloatArray, conditional: FloatArray) -> Residuals:
        """What is left of blocks of a weight (n,), and what the numbers of their points take; `given` (n, a, a)."""
        J_h, conditional = self.J[:, :, : conditional.shape[1]], weight[:, None, None] * conditional
        leverage = np.einsum("nka,nka->n", J_h @ conditional, J_h) / np.maximum(self.counted, 1.0)
        along = self.along
        spent = np.einsum("nca,nca->nc", along.J_h @ conditional, along.J_h)
        chi_square = np.einsum("nk,nk->n", self.r, self.r)
        return Residuals(chi_square, self.counted, leverage, along.chi_square, along.information, spent)


def _real(rows: ComplexArray) -> FloatArray:
    """Complex rows (n, k, ..) of unit variance as real ones, (n, 2 k, ..)."""
    return np.sqrt(2.0) * np.concatenate([rows.real, rows.imag], axis=1)
