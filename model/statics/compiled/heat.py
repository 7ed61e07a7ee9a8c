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

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.dense import BOUNDLESS, gmres, product, solve, times
from model.film.energy import between, heat_sources, heat_step, march, warm
from model.film.mesh import FilmGrid
from model.film.oil_state import edge_flows
from model.film.resting import resting_film
from model.interpolation import largest
from model.statics.compiled.case import HEAT_PER_FORCE, HEATING_STEP, Problem, film_of
from model.statics.compiled.stack import BACKFLOW, JOURNAL, BodyStack, grid_of, rigid_approach
from rigdata.arrays import BoolArray, FloatArray, IntArray

#: q h / k (T_mean - T_wall) of a parabolic profile, flat at the other wall.
_NUSSELT = 3.0
#: Conduction is solved to this share in every step of the equilibrium; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.01
#: Share of the oil in the grooves that is fresh after a turn, at least.
_LEAST_FRESH = 1e-3


@inner
def heat_films(problem: Problem, relaxation: float) -> float:
    """Temperatures of the films that carry, each for itself; returns the largest change asked for [K]."""
    state, change = problem.state, 0.0
    for m in range(len(problem.pads.table)):
        pad = problem.pads.table[m]
        if pad.solved:
            grid, work = film_of(problem, m)
            thermal = (pad.inlet, relaxation, HEATING_STEP)
            result = heat_step(grid, work, problem.case.running, thermal, state.shift[m])
            state.figures[BACKFLOW] = max(state.figures[BACKFLOW], result[1])
            change = note_heat(pad, result[0], result[2:], change)
    return change


@inner
def note_heat(pad: np.record, heating: float, force_change: tuple[float, float], change: float) -> float:
    """Note which change of temperature [K] a film asks for, and its force then [N]; the largest change so far."""
    pad.heating = heating
    pad.corrected[0] = pad.force[0] + force_change[0]
    pad.corrected[1] = pad.force[1] + force_change[1]
    return np.maximum(change, heating)  # a NaN is not to be lost


@inner
def rest_films(problem: Problem) -> None:
    """Say what the films of idle pads do."""
    for m in range(len(problem.pads.table)):
        pad = problem.pads.table[m]
        if pad.idle:
            wedge = (pad.clearance, rigid_approach(pad, problem.state.position))
            result = resting_film(grid_of(problem.grids, m), wedge, problem.case.running, pad.inlet)
            for k in range(4):
                pad.resting[k] = result[k]


@inner
def exchange_heat(bodies: BodyStack, problem: Problem, relaxation: float) -> float:
    """Temperatures of all films, the inlets and the journal for their present flows; returns the largest change [K]."""
    pads, works, state, case = problem.pads, problem.works, problem.state, problem.case
    n, fields = len(pads.table), 3 if case.journal else 2
    answers = np.zeros((n, fields, *works.temperature.shape[1:]))
    flows = np.empty((n, 2))
    outlets = np.zeros((n, 3))
    uptake = np.zeros((n, 3))
    change = 0.0
    for m in range(n):
        pad = pads.table[m]
        note_flows(problem, m, pad.supplied, flows[m], outlets[m])
        if pad.solved:
            _answer(bodies, problem, m, answers[m], outlets[m], uptake[m])
        if case.fresh < math.inf and case.mixing > 0.0:  # who gets less oil has another film
            excess = case.mixing * abs(flows[m, 1] - pad.passed) / (case.fresh * case.length)
            change = max(change, HEAT_PER_FORCE * excess)
        pad.passed = flows[m, 1]
    inlets, journal = balance_heat(pads.order, (flows, outlets, uptake), pads.table["solved"], case.supply, case.mixing)
    for m in range(n):
        pad = pads.table[m]
        pad.inlet, pad.heating = inlets[m], 0.0
        if not pad.solved:
            continue
        increment = answers[m, 0] + inlets[m] * answers[m, 1] - works.temperature[m]
        if case.journal:
            increment += journal * answers[m, 2]
        (grid, work), limits = film_of(problem, m), (relaxation, HEATING_STEP)
        result = warm(grid, work, case.running, increment, limits, state.shift[m])
        change = note_heat(pad, result[0], result[1:], change)
    if case.journal:
        state.figures[JOURNAL] = journal
    return change


@inner
def note_flows(problem: Problem, m: int, supplied: float, flows: FloatArray, outlet: FloatArray) -> None:
    """Set a pad's flows over its leading and trailing edge [kg/s]; an idle one passes its inlet on, somewhat warmer."""
    pad = problem.pads.table[m]
    if pad.solved:
        grid, work = film_of(problem, m)
        entering, sides = edge_flows(grid, work, supplied)
        flows[0], flows[1] = entering, entering - sides
    else:
        flows[:] = pad.resting[1]
        outlet[0], outlet[1] = pad.resting[2] - pad.inlet, 1.0


@inner
def _answer(
    bodies: BodyStack, problem: Problem, m: int, fields: FloatArray, outlet: FloatArray, uptake: FloatArray
) -> None:
    """Temperature of a film, of what leaves it, and what the journal takes up [W].

    With all else at zero, per kelvin of its inlet, and per kelvin of the journal.

    A hotter film makes less heat: that counts as a loss, beside what the journal takes.
    """
    grid, work = film_of(problem, m)
    case = problem.case
    figures = problem.state.figures
    sources = np.zeros(fields.shape)
    if case.journal:
        work.exchange[:] = _NUSSELT * case.running.heat[1] / work.thickness * (grid.dx * grid.height)
        sources[2] = work.exchange
    sources[0], loss = heat_sources(grid, work, case.running, case.heat_share)
    fields[1, 0] = 1.0
    conducts = len(bodies.flux) > 0
    if conducts:
        # what the pad takes at the present temperature is known; its answer to the change is solved for
        sources[0] -= _into_pad(grid, bodies, m, work.temperature.reshape(-1) - case.supply)
    backflow = march(grid, work, case.running, loss, fields, between(sources))
    figures[BACKFLOW] = max(figures[BACKFLOW], backflow)
    if conducts and largest(fields.reshape(-1)) < BOUNDLESS:
        _conduct(bodies, problem, m, loss, fields)
    flow = work.flow[0].reshape(loss.shape)[-2]  # numpy's sums, means and outer products would load scipy, 15 MB
    weight = work.exchange.copy()  # all of it is the journal's
    weight[0] *= 0.5
    weight[-1] *= 0.5
    for k in range(len(fields)):
        outlet[k] = product(fields[k, -1], flow) / product(np.ones(len(flow)), flow)
        uptake[k] = product(weight.reshape(-1), fields[k].reshape(-1))
    uptake[2] -= product(np.ones(weight.size), weight.reshape(-1))


@inner
def _conduct(bodies: BodyStack, problem: Problem, m: int, loss: FloatArray, fields: FloatArray) -> None:
    """Give a film's answers the heat that the pad takes of them, (I + A^-1 F) T = T without it.

    The answer to its sources as a correction, which vanishes at the equilibrium, and with it what stays unsolved.
    """
    state = problem.state
    journal = state.figures[JOURNAL] if math.isfinite(state.figures[JOURNAL]) else problem.case.supply
    hot = (1.0, problem.pads.table[m].inlet, journal)
    temperature = problem.works.temperature[m].reshape(-1)
    answers = fields.reshape((len(fields), len(temperature)))
    missing = -temperature
    for k in range(len(answers)):
        missing += hot[k] * answers[k]
    held = (bodies, problem, m, loss)
    missing = temperature + gmres(_cooled, held, missing, _CONDUCTION_TOLERANCE)
    for k in range(1, len(answers)):
        answers[k] = gmres(_cooled, held, answers[k], _CONDUCTION_TOLERANCE)
        missing -= hot[k] * answers[k]
    answers[0] = missing


@inner
def _into_pad(grid: FilmGrid, bodies: BodyStack, m: int, rise: FloatArray) -> FloatArray:
    """What a pad takes from its film at every station, (nt + 1, nz + 1) [W], for the rise (nodes,) of its face [K]."""
    to_coarse, flux = bodies.to_coarse[bodies.kind[m]], bodies.flux[bodies.kind[m]]
    heat = times(flux, times(to_coarse, rise)).reshape((len(grid.angle), len(grid.height)))
    return heat * (grid.dx * grid.height)


@inner
def _cooled(held: tuple[BodyStack, Problem, int, FloatArray], change: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A change of a film's temperature (nodes,), and A^-1 F added to it: what it would be if the pad took nothing."""
    bodies, problem, m, loss = held
    grid, work = film_of(problem, m)
    sources, fields = np.empty((1, *loss.shape)), np.zeros((1, *loss.shape))
    sources[0] = -_into_pad(grid, bodies, m, change)
    march(grid, work, problem.case.running, loss, fields, between(sources))
    return change, change - fields[0].reshape(-1)


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
    flows, outlets, uptake = answers
    n = len(order)
    shares = _mixing_shares(order, flows, mixing)
    matrix = np.zeros((n + 1, n + 1))
    constants = np.full((n + 1, 1), supply)
    fresh, conductance = 0.0, 0.0
    for k in range(n):
        m, after = order[k], order[(k + 1) % n]
        share = shares[after]
        matrix[after, after] += 1.0
        constants[after, 0] = supply * (1.0 - share) + share * outlets[m, 0]
        matrix[after, m] -= share * outlets[m, 1]
        matrix[after, n] -= share * outlets[m, 2]
        if solved[m]:
            fresh, conductance = fresh + uptake[m, 0], conductance + uptake[m, 2]
    matrix[n, n] = 1.0
    if conductance != 0.0:
        constants[n, 0] = -fresh / conductance
        for m in range(n):
            matrix[n, m] = uptake[m, 1] / conductance if solved[m] else 0.0
    solve(matrix, constants)
    return constants[:n, 0].copy(), constants[n, 0]


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
