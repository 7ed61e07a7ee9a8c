"""All terms of the measurement equation, in the order of the budget: a new term is one file and its name here."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, IntArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.term import Term
from tpjb_ident.terms.amplitude import Amplitude
from tpjb_ident.terms.axis import Axis
from tpjb_ident.terms.baseline import Baseline
from tpjb_ident.terms.clock import Clock
from tpjb_ident.terms.corner import Corner
from tpjb_ident.terms.delay import Delay
from tpjb_ident.terms.distortion import Distortion
from tpjb_ident.terms.gain import Gain
from tpjb_ident.terms.housing import STIFFEST, Housing
from tpjb_ident.terms.load import Load
from tpjb_ident.terms.load_turn import LoadTurn
from tpjb_ident.terms.mass import Mass, with_doubted_mass
from tpjb_ident.terms.run_gain import RunGain
from tpjb_ident.terms.shaft import Shaft
from tpjb_ident.terms.temperature import Temperature
from tpjb_ident.terms.tilt import Tilt

TERMS: tuple[type[Term], ...] = (
    Gain,
    RunGain,
    Temperature,
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
    Amplitude,
    Distortion,
)


def campaign_terms(rig: Rig, blocks: Blocks, correct: bool, prepared: Sequence[Term]) -> list[Term]:
    """All terms of a campaign, those that are `made` of more than rig and blocks as they are.

    Without corrections a load's direction is not asked for.
    """
    by_type = {type(term): term for term in prepared}
    used = [term for term in TERMS if correct or term is not LoadTurn]
    return [by_type.get(term) or term(rig, blocks) for term in used]


def learnt_rig(rig: Rig, solution: Solution) -> Rig:
    """The rig, its sensors as uncertain as a solve shows them where that contradicts what is stated; itself where not.

    What the term's test says of them stays said.
    """
    for term in solution.terms:
        fitted = solution.fitted[term.name]
        sensors = term.widened(rig.sensors, fitted)
        if sensors is not None:
            contradicted = {**rig.contradicted, term.name: term.conditions(fitted)}
            rig = replace(rig, sensors=sensors, contradicted=contradicted)
    return rig


def learnt_mass(rig: Rig, blocks: Blocks, group: IntArray, solution: Solution) -> Rig:
    """The rig, its mass as uncertain as frequencies contradict it; `group` (P,) of every point in the solution."""
    compliance = _springs(solution)
    return rig if compliance is None else with_doubted_mass(rig, blocks, group, solution, compliance)


def cell_stiffness(solution: Solution) -> tuple[float, float] | None:
    """Stiffness of what the housing stands on along X and Y [N/m]; None where no accelerometer shows it."""
    compliance = _springs(solution)
    if compliance is None:
        return None
    x, y = 1 / np.maximum(compliance.real.diagonal(), STIFFEST)
    return float(x), float(y)


def _springs(solution: Solution) -> ComplexArray | None:
    housing = next((term for term in solution.terms if isinstance(term, Housing)), None)
    return None if housing is None else housing.standing_on(solution.fitted[housing.name])
