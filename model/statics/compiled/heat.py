"""Where the film's heat goes besides downstream: into the pads, through the journal, on to the next pad.

The baseline is adiabatic, as the paper's model. Three options couple the films' temperatures:

- `conduction`: a pad's face has its film's temperature; what the pad conducts to its back and edges, the film loses.
- `isothermal_journal`: a turning journal has one temperature; it takes up heat where the film is hotter and gives it
  back where it is colder, and keeps none. A film with a parabolic temperature profile over its thickness, flat at the
  pad, passes q = 3 k / h (T_mean - T_journal).
- `carryover`: of the oil that leaves a pad, a share lambda enters the next one as far as that takes it in; the groove
  makes up the rest: T_in = T_supply + s (T_out before - T_supply), s = min(1, lambda Q_out before / Q_in).

For given flows all of them are linear: every film's temperature is that of fresh oil at zero, plus its answer to its
inlet, plus its answer to the journal. So the inlets and the journal follow from one small system, however much of the
heat goes round. What a pad conducts depends on all of its film; that is solved by a few Krylov steps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.edge_flows import edge_flows
from model.film.energy import between, dissipate, heat_step, march
from model.film.mesh import FilmGrid, FilmWork
from model.film.resting import resting_film
from model.film.slopes import pressure_change
from model.statics.compiled.case import BOUNDLESS, HEAT_PER_FORCE, HEATING_STEP, Case, rigid_approach
from model.statics.compiled.elimination import solve
from model.statics.compiled.stack import BACKFLOW, JOURNAL, GridStack, PadStack, PadState, grid_of, work_of
from rigdata.arrays import BoolArray, FloatArray, IntArray

#: q h / k (T_mean - T_wall) of a parabolic profile, flat at the other wall.
_NUSSELT = 3.0
#: Conduction is solved to this share in every step of the equilibrium; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.01
_KRYLOV_STEPS = 12
#: Share of the oil in the grooves that is fresh after a turn, at least.
_LEAST_FRESH = 1e-3


class Conduction(NamedTuple):
    """Heat into the pads: which of k bodies the films have, (pads,), empty without; as `PadDeformation`."""

    which: IntArray
    flux: FloatArray  #: (k, nodes, c)
    to_coarse: FloatArray  #: (k, c, nodes)


@inner
def heat_films(grids: GridStack, works: FilmWork, state: PadState, case: Case, relaxation: float) -> float:
    """Temperatures of the films that carry, each for itself; returns the largest change asked for [K]."""
    change = 0.0
    for m in range(len(state.tilt)):
        if state.solved[m]:
            asked, cut, radial, tangential = heat_step(
                grid_of(grids, m), work_of(works, m), case.running, (state.inlet[m], relaxation, HEATING_STEP),
                state.shift[m],
            )  # fmt: skip
            state.heating[m] = asked
            state.corrected[m, 0] = state.force[m, 0] + radial
            state.corrected[m, 1] = state.force[m, 1] + tangential
            state.figures[BACKFLOW] = max(state.figures[BACKFLOW], cut)
            if not change >= asked:  # a NaN is not to be lost
                change = asked
    return change


@inner
def rest_films(grids: GridStack, pads: PadStack, state: PadState, case: Case) -> None:
    """Say what the films of idle pads do."""
    for m in range(len(state.tilt)):
        if state.idle[m]:
            wedge = (pads.clearance[m], rigid_approach(pads, state, m))
            found = resting_film(grid_of(grids, m), wedge, case.running, state.inlet[m])
            for k in range(4):
                state.resting[m, k] = found[k]


@inner
def exchange_heat(
    grids: GridStack,
    bodies: Conduction,
    pads: PadStack,
    works: FilmWork,
    state: PadState,
    case: Case,
    relaxation: float,
) -> float:
    """Temperatures of all films, the inlets and the journal for their present flows; returns the largest change [K]."""
    n, fields = len(state.tilt), 3 if case.journal else 2
    answers = np.zeros((n, fields, works.temperature.shape[1], works.temperature.shape[2]))
    flows, outlets, taken = np.empty((n, 2)), np.zeros((n, 3)), np.zeros((n, 3))
    for m in range(n):
        if not state.solved[m]:
            flows[m], outlets[m, 0], outlets[m, 1] = state.resting[m, 1], state.resting[m, 2] - state.inlet[m], 1.0
            continue
        grid, work = grid_of(grids, m), work_of(works, m)
        _answer(grid, work, bodies, state, case, m, answers[m])
        entering, sides = edge_flows(grid, work, state.supplied[m])
        flows[m, 0], flows[m, 1] = entering, entering - sides
        _pass_on(work, answers[m], outlets[m], taken[m])
    change = 0.0
    for m in range(n):
        if case.fresh < math.inf and case.mixing > 0.0:  # who gets less oil has another film
            more = case.mixing * abs(flows[m, 1] - state.passed[m]) / (case.fresh * case.length)
            change = max(change, HEAT_PER_FORCE * more)
        state.passed[m] = flows[m, 1]
    inlets, journal = balance_heat(pads.order, (flows, outlets, taken), state.solved, case.supply, case.mixing)
    for m in range(n):
        state.inlet[m], state.heating[m] = inlets[m], 0.0
        if not state.solved[m]:
            continue
        asked = answers[m, 0]
        largest = 0.0
        for i in range(asked.shape[0]):
            for j in range(asked.shape[1]):
                asked[i, j] += inlets[m] * answers[m, 1, i, j] - works.temperature[m, i, j]
                if case.journal:
                    asked[i, j] += journal * answers[m, 2, i, j]
                if not largest >= abs(asked[i, j]) and largest == largest:
                    largest = abs(asked[i, j])
        share = relaxation * min(1.0, HEATING_STEP / max(largest, 1e-30))
        for i in range(asked.shape[0]):
            for j in range(asked.shape[1]):
                works.temperature[m, i, j] += share * asked[i, j]
        state.heating[m] = largest
        if not change >= largest:
            change = largest
        more = pressure_change(
            grid_of(grids, m), work_of(works, m), case.running.speed, case.running.oil, state.shift[m]
        )
        state.corrected[m, 0], state.corrected[m, 1] = state.force[m, 0] + more[0], state.force[m, 1] + more[1]
    if case.journal:
        state.figures[JOURNAL] = journal
    return change


@inner
def _answer(
    grid: FilmGrid, work: FilmWork, bodies: Conduction, state: PadState, case: Case, m: int, fields: FloatArray
) -> None:
    """Temperature of a film with all else at zero, per kelvin of its inlet, and per kelvin of the journal.

    A hotter film makes less heat: that counts as a loss, beside what the journal takes.
    """
    count, rows, columns = fields.shape
    sources, loss, less = np.zeros((count, rows, columns)), np.empty((rows, columns)), np.empty((rows, columns))
    dissipate(grid, work, case.running.speed, sources[0], less)
    for i in range(rows):
        for j in range(columns):
            station = grid.dx * grid.height[j]
            passed = _NUSSELT * case.running.heat[1] / work.thickness[i, j] * station if case.journal else 0.0
            fewer = case.kept * case.running.oil[1] * less[i, j]
            work.exchange[i, j], loss[i, j] = passed, passed + fewer
            sources[0, i, j] = case.kept * (sources[0, i, j] + work.gained[i, j]) + fewer * work.temperature[i, j]
            if count == 3:
                sources[2, i, j] = passed
    for j in range(columns):
        fields[1, 0, j] = 1.0
    conducts = len(bodies.which) > 0
    if conducts:
        # what the pad takes at the present temperature is known; its answer to the change is solved for
        rise, heat = np.empty(rows * columns), np.empty(rows * columns)
        for q in range(len(rise)):
            rise[q] = work.temperature[q // columns, q % columns] - case.supply
        _into_pad(grid, bodies, bodies.which[m], rise, heat)
        for q in range(len(rise)):
            sources[0, q // columns, q % columns] -= heat[q]
    backflow = march(grid, work, case.running, loss, fields, between(sources))
    state.figures[BACKFLOW] = max(state.figures[BACKFLOW], backflow)
    if conducts and _bounded(fields):
        _conduct(grid, work, bodies, state, case, (m, loss), fields)


@inner
def _bounded(fields: FloatArray) -> bool:
    for m in range(fields.shape[0]):
        for i in range(fields.shape[1]):
            for j in range(fields.shape[2]):
                if not abs(fields[m, i, j]) < BOUNDLESS:
                    return False
    return True


@inner
def _conduct(
    grid: FilmGrid,
    work: FilmWork,
    bodies: Conduction,
    state: PadState,
    case: Case,
    film: tuple[int, FloatArray],
    fields: FloatArray,
) -> None:
    """Give a film's answers the heat that the pad takes of them, (I + A^-1 F) T = T without it.

    The answer to its sources as a correction, which vanishes at the equilibrium, and with it what stays unsolved.
    """
    count, columns = fields.shape[0], fields.shape[2]
    journal = state.figures[JOURNAL] if math.isfinite(state.figures[JOURNAL]) else case.supply
    hot = (1.0, state.inlet[film[0]], journal)
    size = work.temperature.size
    missing, answer = np.empty(size), np.empty(size)
    for q in range(size):
        i, j = q // columns, q % columns
        missing[q] = -work.temperature[i, j]
        for k in range(count):
            missing[q] += hot[k] * fields[k, i, j]
    _krylov(grid, work, bodies, case, film, missing, answer)
    for q in range(size):
        missing[q] = work.temperature[q // columns, q % columns] + answer[q]
    right = np.empty(size)
    for k in range(1, count):
        for q in range(size):
            right[q] = fields[k, q // columns, q % columns]
        _krylov(grid, work, bodies, case, film, right, answer)
        for q in range(size):
            fields[k, q // columns, q % columns] = answer[q]
            missing[q] -= hot[k] * answer[q]
    for q in range(size):
        fields[0, q // columns, q % columns] = missing[q]


@inner
def _into_pad(grid: FilmGrid, bodies: Conduction, k: int, rise: FloatArray, heat: FloatArray) -> None:
    """What a pad takes from its film at every station, (nodes,) [W], for the rise (nodes,) of its face [K]."""
    to_coarse, flux, columns = bodies.to_coarse[k], bodies.flux[k], len(grid.height)
    coarse = np.zeros(to_coarse.shape[0])
    for c in range(len(coarse)):
        for q in range(len(rise)):
            coarse[c] += to_coarse[c, q] * rise[q]
    for q in range(len(rise)):
        heat[q] = 0.0
        for c in range(len(coarse)):
            heat[q] += flux[q, c] * coarse[c]
        heat[q] *= grid.dx * grid.height[q % columns]


@inner
def _krylov(
    grid: FilmGrid,
    work: FilmWork,
    bodies: Conduction,
    case: Case,
    film: tuple[int, FloatArray],
    right: FloatArray,
    answer: FloatArray,
) -> None:
    """Solve (I + A^-1 F) T = T_alone, (nodes,), by GMRES; NaN where it grows beyond `BOUNDLESS`."""
    m, loss = film
    nodes, columns = len(right), loss.shape[1]
    size = math.sqrt(_product(right, right))
    answer[:] = 0.0
    if not size > 0.0:
        return
    basis, images = np.zeros((_KRYLOV_STEPS, nodes)), np.zeros((_KRYLOV_STEPS, nodes))
    taken, fields = np.zeros((1, loss.shape[0], columns)), np.zeros((1, loss.shape[0], columns))
    heat, left, weights = np.empty(nodes), np.empty(nodes), np.zeros((_KRYLOV_STEPS, 1))
    for q in range(nodes):
        basis[0, q] = right[q] / size
    for k in range(_KRYLOV_STEPS):
        _into_pad(grid, bodies, bodies.which[m], basis[k], heat)
        for q in range(nodes):
            taken[0, q // columns, q % columns] = -heat[q]
        fields[0, 0] = 0.0
        march(grid, work, case.running, loss, fields, between(taken))
        for q in range(nodes):
            images[k, q] = basis[k, q] - fields[0, q // columns, q % columns]
        if not _product(images[k], images[k]) < BOUNDLESS:
            answer[:] = math.nan
            return
        _least_squares(images, k + 1, right, weights)
        for q in range(nodes):
            answer[q], left[q] = 0.0, -right[q]
            for r in range(k + 1):
                answer[q] += weights[r, 0] * basis[r, q]
                left[q] += weights[r, 0] * images[r, q]
        if k == _KRYLOV_STEPS - 1 or math.sqrt(_product(left, left)) < _CONDUCTION_TOLERANCE * size:
            return
        new = basis[k + 1]
        for q in range(nodes):
            new[q] = images[k, q]
        for r in range(k + 1):
            share = _product(basis[r], new)
            for q in range(nodes):
                new[q] -= share * basis[r, q]
        length = math.sqrt(_product(new, new))
        if not length > 1e-12 * size:
            return
        for q in range(nodes):
            new[q] /= length


@inner
def _product(one: FloatArray, other: FloatArray) -> float:
    total = 0.0
    for q in range(len(one)):
        total += one[q] * other[q]
    return total


@inner
def _least_squares(images: FloatArray, k: int, right: FloatArray, weights: FloatArray) -> None:
    """Weights (.., 1) of the first k images (.., n) that come nearest to a right-hand side (n,)."""
    gram = np.empty((k, k))
    for i in range(k):
        weights[i, 0] = _product(images[i], right)
        for j in range(k):
            gram[i, j] = _product(images[i], images[j])
        gram[i, i] *= 1.0 + 1e-13  # images that hardly differ are of no use to each other
    solve(gram, weights)


@inner
def _pass_on(work: FilmWork, fields: FloatArray, outlet: FloatArray, taken: FloatArray) -> None:
    """Set what leaves and what the journal takes up: with all else at zero, per kelvin of inlet and journal."""
    count, rows, columns = fields.shape
    flow = work.flow_x[rows - 2]
    total = 0.0
    for j in range(columns):
        total += flow[j]
        for k in range(count):
            outlet[k] += fields[k, rows - 1, j] * flow[j]
    for k in range(count):
        outlet[k] /= total
    if count < 3:
        return
    for i in range(rows):
        half = 0.5 if i == 0 or i == rows - 1 else 1.0
        for j in range(columns):
            weight = half * work.exchange[i, j]  # all of it is the journal's
            for k in range(3):
                taken[k] += weight * fields[k, i, j]
            taken[2] -= weight


@compiled
def balance_heat(
    order: IntArray,
    answers: tuple[FloatArray, FloatArray, FloatArray],
    solved: BoolArray,
    supply: float,
    mixing: float,
) -> tuple[FloatArray, float]:
    """Inlet temperature of every pad, (n,), and the journal's that keeps no heat [degC].

    Answers: flows (n, 2) over leading and trailing edge [kg/s], outlets (n, 3), heat that the journal takes up (n, 3),
    both with all else at zero, per kelvin of the inlet and of the journal.
    """
    flows, outlets, taken = answers
    n = len(order)
    shares = _mixing_shares(order, flows, mixing)
    matrix, right = np.zeros((n + 1, n + 1)), np.full((n + 1, 1), supply)
    fresh, own = 0.0, 0.0
    for k in range(n):
        m, after = order[k], order[(k + 1) % n]
        share = shares[after]
        matrix[after, after] += 1.0
        right[after, 0] = supply * (1.0 - share) + share * outlets[m, 0]
        matrix[after, m] -= share * outlets[m, 1]
        matrix[after, n] -= share * outlets[m, 2]
        if solved[m]:
            fresh, own = fresh + taken[m, 0], own + taken[m, 2]
    matrix[n, n] = 1.0
    if own != 0.0:
        right[n, 0] = -fresh / own
        for m in range(n):
            matrix[n, m] = taken[m, 1] / own if solved[m] else 0.0
    solve(matrix, right)
    return right[:n, 0].copy(), right[n, 0]


@inner
def _mixing_shares(order: IntArray, flows: FloatArray, mixing: float) -> FloatArray:
    """Share s of what a pad drinks that comes from the pad before it, (n,)."""
    n = len(order)
    shares, product = np.zeros(n), 1.0
    if mixing == 0.0:
        return shares
    for k in range(n):
        entering, hot = flows[order[k], 0], mixing * flows[order[k - 1], 1]
        shares[order[k]] = 1.0 if not hot < entering else max(0.0, hot / entering)
        product *= shares[order[k]]
    if product > 1.0 - _LEAST_FRESH:
        # where nothing leaks (all pads idle, on the way) heat would go round for ever
        most = (1.0 - _LEAST_FRESH) ** (1.0 / n)
        for m in range(n):
            shares[m] = min(shares[m], most)
    return shares
