"""The housing's mass, as far as the manifest states its uncertainty: it weighs the inertia in the cells' force.

On springs an error of it changes H by -omega^2 C (1 - omega^2 m C)^-1 H per kilogram, Re h and Im h alike, as no film
near K-C-M does: several frequencies contradict it there. Of a floating housing it is an added mass of the film, which
none has that is negative and alike in all directions and at all loads.
"""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.arrowhead import MODELS, NUMBERS, power_columns, real_numbers, remainder
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION, Additive, Fitted, Parameter

#: Model of the film beside which frequencies of a load tell the mass, and how many, by mount.
_BESIDE = {"cells": ("K-C-M", 4), "floating": ("K-C", 3)}
#: Chi-square that a mass must make go, over what is left per equation; what may be left of it, and per equation.
_CLEARLY, _LEFT, _NOISE = 50.0, 0.02, 1.5
#: Largest ratio of the true mass and the stated one, or the other way round.
_PLAUSIBLE = 3.0
#: Variance that every number has at least, of all: keeps computed records solvable.
_RIDGE = 1e-9


class Mass(Additive):
    """Relative error of the housing's mass."""

    name = "mass"
    never_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        if rig.mass_uncertainty and rig.mass:
            self.parameters = (Parameter("housing", "1", rig.mass_uncertainty / rig.mass),)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """-m a in the cells, and in what springs under the housing make of their force."""
        heavier = replace(self.rig, mass=2 * self.rig.mass)
        return (state.reading(heavier, blocks) - state.reading(self.rig, blocks))[:, :, None]

    def conditions(self, fitted: Fitted) -> Conditions:
        """What the frequencies said of it."""
        return self.rig.contradicted.get(self.name, ())

    def learnt(self, rig: Rig, solution: Solution) -> Rig:
        """The rig, its mass as uncertain as the frequencies of a load contradict it; itself where they do not."""
        compliance, numbers = solution.springs, solution.records.shape[1]
        is_told = compliance is not None or (rig.mount == "floating" and rig.has_acceleration)
        # a film that is left free tells no mass
        return _doubted(rig, solution, compliance) if is_told and numbers == NUMBERS else rig


def _doubted(rig: Rig, solution: Solution, compliance: ComplexArray | None) -> Rig:
    """The rig as the frequencies show its mass; `compliance` (2, 2) of the springs under the housing [m/N], if any."""
    blocks = solution.blocks
    groups, first = np.unique(solution.group[blocks.point], return_index=True)
    omega, point = blocks.omega[first], blocks.point[first]
    (model, enough), square = _BESIDE[rig.mount], (omega**2)[:, None, None]
    h = solution.h[point] + rig.bare.at(omega)
    if compliance is None:
        change = np.asarray(square * np.eye(2), complex)
    else:
        change = -square * compliance @ np.linalg.inv(np.eye(2) - rig.mass * square * compliance) @ h
    values = np.stack([real_numbers(h), real_numbers(change)], axis=2)
    keys = [blocks.points[p].static_key if np.isfinite(solution.h[p]).all() else None for p in point]
    products, spare = np.zeros((2, 2)), 0
    for load in dict.fromkeys(keys):
        places = [k for k, key in enumerate(keys) if load and key == load]
        if len(np.unique(np.round(omega[places], 6))) >= enough:
            columns = power_columns(omega[places] / omega[places].max(), MODELS[model])
            covariance = solution.records[groups[places]]
            ridge = _RIDGE * np.trace(covariance, axis1=1, axis2=2)[:, None, None] * np.eye(NUMBERS)
            root = np.linalg.inv(np.linalg.cholesky(covariance + ridge))
            rows = remainder(columns, values[places], root, slice(None)).reshape(-1, 2)
            products, spare = products + rows.T @ rows, spare + len(rows) - columns.shape[2]
    (chi_square, along), (_, size) = products
    if not size > 0:
        return rig
    lighter, error, left = along / size, size**-0.5, chi_square - along**2 / size
    is_clear = chi_square - left > _CLEARLY * max(left / spare, 1.0) and left < _LEFT * chi_square + _NOISE * spare
    mass = rig.mass - lighter
    is_plausible = rig.mass / _PLAUSIBLE < mass < rig.mass * (_PLAUSIBLE if compliance is not None else 1.0)
    # what the gains of accelerometers and cells are off by looks like it
    gain = np.linalg.norm([s.uncertainty or 0.0 for s in rig.channels if s.quantity != "displacement"])
    if not (is_clear and is_plausible and abs(lighter) > 3 * np.hypot(rig.mass_uncertainty, gain * rig.mass)):
        return rig
    text = f"over frequency the cells show the inertia of {mass:.3g} kg (standard error {error:.2g} kg)"
    condition = Condition("housing-mass-doubtful", f"{text}, not of {rig.mass:.3g} kg")
    doubt = float(CHANGE_AS_DEVIATION * (abs(lighter) + 2 * error))
    return replace(rig, mass_uncertainty=doubt, contradicted={**rig.contradicted, Mass.name: (condition,)})
