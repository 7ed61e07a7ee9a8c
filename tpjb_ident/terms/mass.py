"""The housing's mass, as far as the manifest states its uncertainty: it weighs the inertia in the cells' force.

An error of it goes into H. On springs it changes H by -omega^2 C (1 - omega^2 m C)^-1 H per kilogram, in Re h and Im h
alike, as no film near K-C-M does: there several frequencies tell it, as a doubt. Of a floating housing it is an added
mass of the film.
"""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.blocks import Blocks, Rig, totals
from tpjb_ident.estimate.equation import State, film_force_rows, force_rows, with_factor
from tpjb_ident.estimate.shape import over_frequency, real_numbers
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION, Additive, Fitted, Parameter

#: Frequencies of a load from which they tell the mass.
_FREQUENCIES = 4
#: Chi-square that a mass must make go, over what is left per equation; what may be left of it, and per equation.
_CLEARLY, _LEFT, _NOISE = 50.0, 0.02, 1.5
#: Largest ratio of the true mass and the stated one, or the other way round.
_PLAUSIBLE = 3.0


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
        inertia = -self.rig.mass * state.u[:, 2:, None]
        if self.rig.mount == "cells":
            return film_force_rows(self.rig, blocks, state, inertia)
        return with_factor(state.factor, force_rows(self.rig, blocks, inertia))

    def conditions(self, fitted: Fitted) -> tuple[Condition, ...]:
        """What the frequencies said of it."""
        return self.rig.contradicted.get(self.name, ())


def with_doubted_mass(rig: Rig, blocks: Blocks, group: IntArray, solution: Solution, compliance: ComplexArray) -> Rig:
    """The rig, its mass as uncertain as the frequencies of a load contradict it; itself where they do not.

    `group` (P,) of every point in the solution, `compliance` (2, 2) of the springs under the housing [m/N].
    """
    groups, first = np.unique(group, return_index=True)
    runs = np.maximum(totals(blocks.point, np.ones(len(blocks)), len(group)), 1.0)
    omega = (totals(blocks.point, blocks.omega, len(group)) / runs)[first]
    h = solution.h[first] + rig.bare.at(omega)
    flexible = (omega**2)[:, None, None] * compliance
    change = -flexible @ np.linalg.inv(np.eye(2) - rig.mass * flexible) @ h
    loads: dict[tuple[object, ...], list[int]] = {}
    for k, p in enumerate(first):
        if np.isfinite(h[k]).all():
            loads.setdefault(blocks.points[p].static_key, []).append(k)
    products, spare = np.zeros((2, 2)), 0
    for places in loads.values():
        if len(np.unique(np.round(omega[places], 6))) >= _FREQUENCIES:
            rows = _beyond_model(omega[places], h[places], change[places], solution.records[groups[places]])
            products, spare = products + rows.T @ rows, spare + len(rows) - 12
    chi_square, along, size = products[0, 0], products[0, 1], products[1, 1]
    if not size > 0:
        return rig
    heavier, error, gone = along / size, size**-0.5, along**2 / size
    left = chi_square - gone
    is_clear = gone > _CLEARLY * max(left / spare, 1.0) and left < _LEFT * chi_square + _NOISE * spare
    ratio = (rig.mass - heavier) / max(rig.mass, 1e-9)
    if not (is_clear and 1 / _PLAUSIBLE < ratio < _PLAUSIBLE and abs(heavier) > 3 * rig.mass_uncertainty):
        return rig
    text = f"over frequency the cells show the inertia of {rig.mass - heavier:.3g} kg (standard error {error:.2g} kg)"
    condition = Condition("housing-mass-doubtful", f"{text}, not of {rig.mass:.3g} kg")
    doubt = float(CHANGE_AS_DEVIATION * (abs(heavier) + 2 * error))
    return replace(rig, mass_uncertainty=doubt, contradicted={**rig.contradicted, Mass.name: (condition,)})


def _beyond_model(omega: FloatArray, h: ComplexArray, change: ComplexArray, covariance: FloatArray) -> FloatArray:
    """What K-C-M leaves of h and of a change of it (n, 2, 2), of unit variance, (8 n, 2)."""
    shape = over_frequency(
        "K-C-M", np.zeros(len(h), dtype=np.intp), omega, np.array([np.sqrt(omega.min() * omega.max())])
    )
    numbers = np.stack([real_numbers(h), real_numbers(change)], axis=2)
    white = np.linalg.solve(np.linalg.cholesky(covariance), np.concatenate([shape.columns, numbers], axis=2))
    basis = np.linalg.qr(white[:, :, :-2].reshape(-1, shape.numbers))[0]
    rows = white[:, :, -2:].reshape(-1, 2)
    return np.asarray(rows - basis @ (basis.T @ rows))
