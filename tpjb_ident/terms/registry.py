"""All terms of the measurement equation, in the order of the budget: a new term is one file and its name here."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.arrowhead import Shape
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.solve import Solution, Solver
from tpjb_ident.estimate.term import Term
from tpjb_ident.terms.amplitude import Amplitude
from tpjb_ident.terms.axis import Axis
from tpjb_ident.terms.baseline import Baseline
from tpjb_ident.terms.clock import Clock
from tpjb_ident.terms.corner import Corner
from tpjb_ident.terms.delay import Delay
from tpjb_ident.terms.distortion import Distortion
from tpjb_ident.terms.drift import Drift
from tpjb_ident.terms.film_temperature import FilmTemperature
from tpjb_ident.terms.gain import Gain
from tpjb_ident.terms.housing import STIFFEST, Housing
from tpjb_ident.terms.load import Load
from tpjb_ident.terms.load_turn import LoadTurn
from tpjb_ident.terms.mass import Mass
from tpjb_ident.terms.run_gain import RunGain
from tpjb_ident.terms.shaft import Shaft
from tpjb_ident.terms.temperature import Temperature
from tpjb_ident.terms.tilt import Tilt

TERMS: tuple[type[Term], ...] = (
    Gain,
    RunGain,
    Temperature,
    Drift,
    Axis,
    Delay,
    Corner,
    Clock,
    Mass,
    Housing,
    Baseline,
    Shaft,
    Tilt,
    LoadTurn,
    Load,
    FilmTemperature,
    Amplitude,
    Distortion,
)


def solve(rig: Rig, blocks: Blocks, start: ComplexArray, shape: Shape | None = None) -> Solution:
    """Solve with all terms, from a start of H (P, 2, 2)."""
    return Solver(rig, blocks, [term(rig, blocks) for term in TERMS], start, shape).run()


def learnt_rig(rig: Rig, solution: Solution) -> Rig:
    """The rig as uncertain as a solve shows it where that contradicts what is stated; itself where it does not."""
    for term in solution.all_terms:
        rig = term.learnt(rig, solution)
    return replace(rig, widened=rig.widened | solution.contradicted) if solution.contradicted else rig


def solved_as_learnt(rig: Rig, solve: Callable[[Rig], Solution]) -> Solution:
    """Solve, and once more with the rig as the records show it, where they contradict what is stated of it.

    Where they only may, that is supposed, and the solve with it tells.
    """
    solution = solve(rig)
    learnt = learnt_rig(rig, solution)
    if learnt is rig and solution.supposed:
        supposed = solve(replace(rig, widened=solution.supposed))
        learnt = learnt_rig(rig, supposed) if supposed.contradicted else rig
    return solution if learnt is rig else solve(learnt)


def cell_stiffness(solution: Solution) -> tuple[float, float] | None:
    """Stiffness of what the housing stands on along X and Y [N/m]; None where no accelerometer shows it."""
    if solution.springs is None:
        return None
    x, y = 1 / np.maximum(solution.springs.real.diagonal(), STIFFEST)
    return float(x), float(y)
