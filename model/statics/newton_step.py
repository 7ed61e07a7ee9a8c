"""One Newton step of the equilibrium: the equations of the pads that carry, gathered for their elimination."""

from __future__ import annotations

import numpy as np

from model.setup import Setup
from model.statics.compiled.elimination import PadEquations, eliminate
from model.statics.pad_film import PadFilm
from model.statics.tilt_hold import tilt_hold
from rigdata.arrays import FloatArray


def newton_step(setup: Setup, load: FloatArray, films: list[PadFilm]) -> tuple[float, FloatArray, FloatArray]:
    """Solve the linearised equilibrium once: `load` (2,) [N]; gives shift (2,) [m], moves (n_pads, 2) [rad]."""
    carrying = [f for f in films if f.forces is not None]
    residual, shift, moves = eliminate(load, _pad_equations(setup, carrying))
    if setup.friction:
        _stop_at_untilted(carrying, moves)
    every = np.zeros((len(films), 2))
    every[[f.number - 1 for f in carrying]] = moves
    return residual, shift, every


def _stop_at_untilted(carrying: list[PadFilm], moves: FloatArray) -> None:
    """Let no pad tilt past the untilted attitude in one step: the friction turns round there."""
    for film, move in zip(carrying, moves, strict=True):
        if film.tilt * (film.tilt + move[0]) < 0.0:
            move[0] = -film.tilt


def _pad_equations(setup: Setup, carrying: list[PadFilm]) -> PadEquations:
    """Gather the equations of the pads that carry."""
    n = len(carrying)
    rows = PadEquations(
        frame=np.empty((n, 2, 2)),
        force=np.empty((n, 2)),
        stiffness=np.empty((n, 2, 2)),
        pivot_radius=np.empty(n),
        holding_force=np.empty(n),
        holding_slopes=np.empty((n, 2)),
        missing_deflection=np.empty(n),
        pivot_compliance=np.empty(n),
    )
    for m, film in enumerate(carrying):
        forces = film.corrected if film.step is None else film.step.forces
        assert forces is not None
        law, radial = setup.pivots[film.number - 1], float(forces.force[0])
        rows.frame[m] = film.normal, film.tangent
        # a journal that grows comes nearer, all but at the pads' ends as if it were pushed
        rows.force[m], rows.stiffness[m] = forces.force + film.closing * forces.stiffness[:, 0], forces.stiffness
        rows.pivot_radius[m] = film.pivot_radius
        hold = tilt_hold(setup, film.tilt, radial)
        rows.holding_force[m] = hold.moment / film.pivot_radius
        rows.holding_slopes[m] = hold.stiffness / film.pivot_radius, hold.arm / film.pivot_radius
        rows.missing_deflection[m] = law.deflection(max(radial, 0.0)) - film.deflection
        rows.pivot_compliance[m] = 1.0 / law.stiffness(max(radial, 1e-6))  # a Hertzian pivot has no stiffness at zero
    return rows
