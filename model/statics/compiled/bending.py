"""Pads that give way, on the arrays of a compiled search: what `model.pad.bending` does, pad by pad in one call."""

from functools import lru_cache

import numpy as np

from model.compilation import inner
from model.film.dense import product, solve, times
from model.film.faces import conductances
from model.film.mesh import FilmGrid, FilmWork
from model.film.slopes import force_of, shape_slopes
from model.interpolation import largest
from model.pad.bending import PadDeformation
from model.statics.compiled.case import Problem, film_of
from model.statics.compiled.stack import BodyStack
from model.tilt_hold import held_moment
from rigdata.arrays import FloatArray


@inner
def axial_shape(grid: FilmGrid) -> FloatArray:
    """What a unit of axial tilt adds to the film thickness, (nt + 1, nz + 1) [m/rad].

    A ball in its socket turns about any axis. Turned by psi (the pad's end at positive z outward) it adds psi z
    cos(alpha); a shaft that leans by its slope towards a pad takes just as much away there, so that a pad which
    nothing holds lies as along an aligned shaft. What is left, slope z sin(alpha), the pad would have to follow by
    turning about the line of its load: the stops that keep it in its place hold that. Its axial tilt is where the
    film's moment about the pivot, the integral of p z cos(alpha) dA, is what flexure, rolling or friction of the
    pivot hold.
    """
    return grid.cos.reshape((-1, 1)) * grid.z


@inner
def axial_levers(grid: FilmGrid, arm: float) -> FloatArray:
    """Moment along the shaft by the pressure at every node, less what grows with the load by an arm [m], (nodes,)."""
    return (grid.area * grid.cos.reshape((-1, 1)) * (grid.z - arm)).reshape(-1)


@lru_cache(maxsize=8)
def stacked_bodies(bodies: tuple[PadDeformation, ...], factor: float, conducting: bool) -> BodyStack:
    """Matrices of the pads side by side: of their deformation times a factor, of what they conduct."""
    kinds = list(dict.fromkeys(bodies))
    stacks = []
    for name in BodyStack._fields[1:]:
        needed = conducting if name in ("flux", "to_coarse") else factor != 0.0
        matrices = [getattr(body, name) for body in kinds if needed]
        if name in ("answer", "response"):
            matrices = [factor * matrix for matrix in matrices]
        if len(matrices) == 1:  # it is not copied
            stacks.append(np.ascontiguousarray(matrices[0])[None])
        else:
            stacks.append(np.array(matrices) if matrices else np.zeros((0,) * (4 if name == "shapes" else 3)))
    return BodyStack(np.array([kinds.index(b) for b in bodies], dtype=np.int64), *stacks)


@inner
def bend_pads(bodies: BodyStack | None, problem: Problem) -> float:
    """Close the loop of pressure, deformation and tilt along the shaft for every pad that carries.

    Returns the largest change asked for, as a share of the thinnest film.
    """
    state, pads = problem.state, problem.pads.table
    if bodies is None or state.bent.size == 0:
        return 0.0
    deformation = np.zeros((len(pads), state.bent[0].size))
    if len(bodies.shapes) > 0:
        _ask_bodies(bodies, problem, deformation)
    share = 0.0
    for m in range(len(pads)):
        if pads[m].solved:
            change = deformation[m] - state.bent[m].reshape(-1)
            tilted = _close_loop(bodies, problem, m, change)
            share = max(share, max(largest(change), tilted) / pads[m].least)
    return share


@inner
def _ask_bodies(bodies: BodyStack, problem: Problem, deformation: FloatArray) -> None:
    """Deformation (pads, nodes) that pressure and temperature ask for; pads of one shape in one product [m]."""
    pads, works, state, supply = problem.pads.table, problem.works, problem.state, problem.case.supply
    lines = bodies.gather.shape[1]
    stations, columns = works.pressure.shape[1], works.pressure.shape[2]
    inputs = np.zeros((len(pads), bodies.answer.shape[2]))
    moved = np.zeros((len(pads), columns * lines))
    loaded = works.unknown.shape[1] // (stations - 2) * lines
    members = np.empty(len(pads), dtype=np.int64)
    for k in range(bodies.answer.shape[0]):
        count = 0
        for m in range(len(pads)):
            if pads[m].solved and bodies.kind[m] == k:
                pressure = (works.unknown[m] + state.shift[m]).reshape((stations - 2, loaded // lines))
                _columns(bodies.gather[k], pressure, inputs[m, :loaded])
                _columns(bodies.corners[k], state.faces[m] - supply, inputs[m, loaded:])
                members[count] = m
                count += 1
        for i in range(bodies.answer.shape[1]):  # every row is read once
            for m in members[:count]:
                moved[m, i] = product(bodies.answer[k, i], inputs[m])
        for m in members[:count]:
            by_column = moved[m].reshape((columns, lines))
            for i in range(stations):
                for j in range(columns):
                    deformation[m, i * columns + j] = product(by_column[j], bodies.spread[k, i])


@inner
def _columns(matrix: FloatArray, field: FloatArray, out: FloatArray) -> None:
    """Product of a matrix with every column of a field, one behind the other."""
    count = len(matrix)
    for j in range(field.shape[1]):
        out[j * count : (j + 1) * count] = times(matrix, field[:, j].copy())


@inner
def _close_loop(bodies: BodyStack, problem: Problem, m: int, change: FloatArray) -> float:
    """One pad's part of a Newton step, see `model.pad.bending`; how far a tilt along the shaft moves the ends [m]."""
    grid, work = film_of(problem, m)
    pad, state, case = problem.pads.table[m], problem.state, problem.case
    bends = len(bodies.shapes) > 0
    body, bending = (bodies.kind[m], bodies.shapes.shape[3]) if bends else (0, 0)
    count = bending + (1 if case.axial else 0)
    unknowns = len(work.unknown)
    rows, columns = work.pressure.shape
    shapes, response = np.empty((rows, columns, count)), np.empty((count, unknowns))
    if bends and not case.axial:
        shapes, response = bodies.shapes[body], bodies.response[body]
    elif bends:
        shapes[:, :, :bending], response[:bending] = bodies.shapes[body], bodies.response[body]
    matrix, constants = np.zeros((count, count)), np.zeros((count, 3))
    for r in range(bending):
        matrix[r, r], constants[r, 0] = 1.0, product(bodies.amplitudes[body, r], change)
    if case.axial:
        constants[bending, 0], matrix[bending, bending] = _axial_moment(grid, work, problem, m, response[bending])
        shapes[:, :, bending] = axial_shape(grid)
    amplitudes = constants[:, 0].copy()
    wedge = (pad.clearance, pad.wedge[0], pad.wedge[1])
    slopes = shape_slopes(grid, work, conductances(grid, work, wedge), shapes)
    _answer(response, slopes, matrix, -1.0, 0)
    _answer(response, work.slopes[:, :2], constants, 1.0, 1)
    felt = force_of(grid, grid.area, slopes)
    solve(matrix, constants)
    for r in range(count):
        pad.felt[:] += felt[:, r] * constants[r, 0]
        pad.felt_stiffness[:] += felt[:, r : r + 1] * constants[r, 1:]
    pad.amplitude[:bending] = constants[:bending]
    flat = shapes.reshape((len(change), count))[:, :bending]
    state.mismatch[m].reshape(-1)[:] = change - times(flat, amplitudes)
    if not case.axial:
        return 0.0
    pad.axial_step[:] = constants[bending]
    return abs(constants[bending, 0]) * largest(shapes[:, :, bending].copy().reshape(-1))


@inner
def _answer(response: FloatArray, slopes: FloatArray, matrix: FloatArray, factor: float, first: int) -> None:
    """Add what shapes answer to pressures (unknowns, m), by a factor, to a matrix from one of its columns on."""
    for s in range(slopes.shape[1]):
        column = slopes[:, s].copy()  # side by side for the products
        for r in range(len(response)):
            matrix[r, first + s] += factor * product(response[r], column)


@inner
def _axial_moment(grid: FilmGrid, work: FilmWork, problem: Problem, m: int, lever: FloatArray) -> tuple[float, float]:
    """Moment along the shaft that nothing balances, what holds that tilt, and the moment by the unknown pressures.

    `lever` (unknowns,) [m^3] is less what grows with the pad's load.
    """
    pad, shift = problem.pads.table[m], problem.state.shift[m]
    moment, stiffness, arm = held_moment(problem.case.hold, pad.axial, pad.corrected[0])
    levers = axial_levers(grid, 0.0)
    lever[:] = axial_levers(grid, arm)[grid.node]
    total = product(levers, work.pressure.reshape(-1)) + product(levers[grid.node], shift)
    return total - moment, stiffness


@inner
def change_shape(bodies: BodyStack | None, problem: Problem, m: int, da: float, db: float) -> float:
    """Add to the change of a pad's deformation, `SearchState.mismatch`, what belongs to a move of its film.

    Returns the change of its tilt along the shaft [rad].
    """
    if bodies is None:
        return 0.0
    pad, state, case = problem.pads.table[m], problem.state, problem.case
    out = state.mismatch[m]
    if len(bodies.shapes) > 0:
        shapes = bodies.shapes[bodies.kind[m]]
        for r in range(shapes.shape[2]):
            amount = pad.amplitude[r, 0] + pad.amplitude[r, 1] * da + pad.amplitude[r, 2] * db
            out += amount * shapes[:, :, r]
    if not case.axial:
        return 0.0
    axial = pad.axial_step[0] + pad.axial_step[1] * da + pad.axial_step[2] * db
    if case.hold.slip > 0.0 and pad.axial * (pad.axial + axial) < 0.0:
        return -pad.axial  # friction turns round there
    return axial
