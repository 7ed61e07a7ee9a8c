"""Nuisances: what is always free within its stated tolerance, and never a finding by itself.

Each is a prior in every fit and a part of the covariance of every test, N diag(s^2) N^T with N the change of the
observation vector; so the interval of an amplitude includes them. An effect that *is* one of these (oil of another
viscosity, one pad that stands further out) counts only where it exceeds what is stated.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from model.effects import Effect, kind_of
from model.setup import Setup
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import ForwardModel
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.gap import centre_shifts
from tpjb_ident.diagnosis.observations.observe import Element

#: Step of derivatives, in standard deviations: small, so that a nuisance and the effect that does the same have the
#: same derivative, and their curvature does not tell them apart.
_STEP = 0.3


@dataclass(frozen=True)
class Nuisance:
    """One thing that may be off."""

    name: str
    sigma: float
    unit: str
    place: str = ""
    change: Callable[[Setup, float], Setup] | None = None
    #: (n,): change of the observation vector per `sigma`
    column: FloatArray | None = field(default=None, repr=False, compare=False)
    aliases: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Shift:
    """A change of a `Setup` by nuisances of given sizes, for `Forward`."""

    nuisances: tuple[Nuisance, ...]
    size: tuple[float, ...]

    def __call__(self, setup: Setup) -> Setup:
        """Apply them one after the other."""
        for nuisance, size in zip(self.nuisances, self.size, strict=True):
            if nuisance.change is not None and size:
                setup = nuisance.change(setup, size * nuisance.sigma)
        return setup

    @property
    def readings(self) -> FloatArray | float:
        """Change of the observation vector by those that act on readings."""
        parts = [
            nuisance.column * s
            for nuisance, s in zip(self.nuisances, self.size, strict=True)
            if nuisance.column is not None
        ]
        return np.sum(parts, axis=0) if parts else 0.0


def nuisances(
    elements: Sequence[Element], setup: Setup, tolerances: Tolerances, by_pad: bool = True
) -> tuple[Nuisance, ...]:
    """List what may be off for an observation vector."""
    pads = range(1, len(setup.bearing.pads) + 1) if by_pad else ()
    listed = [
        _whole("viscosity", "1", _viscosity, tolerances, "oil_viscosity"),
        _whole("viscosity_exponent", "1", _exponent, tolerances, "viscosity_law"),
        _whole("supply_temperature", "K", _supply, tolerances, "supply_temperature"),
        _whole("assembled_clearance", "m", _assembled, tolerances),
        _whole("pad_clearance", "m", _pad_clearance, tolerances, "preload_error"),
        _whole("film_heat", "1", _film_heat, tolerances, "heat_loss"),
    ]
    for pad in pads:
        offset = functools.partial(_offset, pad=pad)
        scatter = tolerances["clearance_scatter"], "m", f"pad {pad}", offset
        listed.append(
            Nuisance("clearance_scatter", *scatter, aliases=frozenset({f"pad_offset pad {pad}", "uneven_pads"}))
        )
        softer = functools.partial(_softer, pad=pad)
        alias = frozenset({f"soft_pivot pad {pad}"})
        listed.append(
            Nuisance(
                "pivot_stiffness_scatter",
                tolerances["pivot_stiffness_scatter"],
                "1",
                f"pad {pad}",
                softer,
                aliases=alias,
            )
        )
    for i in range(2):
        gain = functools.partial(_probe, axes=tolerances.probe_axes, index=i)
        listed.append(Nuisance("probe_gain", tolerances["probe_gain"], "1", f"probe {i + 1}", gain,
                              aliases=frozenset({"probe_gain"})))  # fmt: skip
        cell = functools.partial(_cell, index=i)
        listed.append(Nuisance("cell_gain", tolerances.cell_gain.value, "1", f"cell {'xy'[i]}", cell,
                              aliases=frozenset({"loadcell_gain"})))  # fmt: skip
    listed += _readings(elements, tolerances)
    return tuple(nuisance for nuisance in listed if nuisance.sigma > 0.0)


def _whole(
    name: str, unit: str, change: Callable[[Setup, float], Setup], known: Tolerances, *aliases: str
) -> Nuisance:  # fmt: skip
    return Nuisance(name, known[name], unit, "", change, aliases=frozenset(aliases))


def _readings(elements: Sequence[Element], tolerances: Tolerances) -> list[Nuisance]:
    shifts = centre_shifts(elements) * tolerances.centre
    out = [
        Nuisance("centre", tolerances.centre, "m", letter, column=shifts[:, axis])
        for axis, letter in enumerate("xy") if np.any(shifts[:, axis])
    ]  # fmt: skip
    pads = np.array([e.place("pad") for e in elements])
    warm = np.array([e.observable == "pad_temperature" for e in elements], dtype=bool)
    for pad in sorted(set(pads[warm])):
        column = np.where(warm & (pads == pad), tolerances["thermometer"], 0.0)
        out.append(Nuisance("thermometer", tolerances["thermometer"], "K", f"pad {pad:.0f}", column=column))
    return out


def at_baseline(
    forward: ForwardModel, effects: Sequence[Effect], setup: Setup, known: Tolerances, base: FloatArray
) -> FloatArray:
    """Columns of what may be off in a whole bearing and its instruments, for tests that are only planned, (n, m)."""
    bearing_nuisances = nuisances(forward.elements, setup, known, by_pad=False)
    at = np.zeros(len(bearing_nuisances))
    columns = [column_of(forward, effects, bearing_nuisances, at, base, i) for i in range(len(at))]
    return np.column_stack(columns)


def column_of(
    forward: ForwardModel, effects: Sequence[Effect], unknowns: Sequence[Nuisance], at: FloatArray, base: FloatArray,
    index: int,
) -> FloatArray:  # fmt: skip
    """Change of the observation vector per standard deviation of one nuisance, (n,); `at` (m,), `base` (n,)."""
    if unknowns[index].column is not None:
        return np.asarray(unknowns[index].column)
    # towards zero: there the model surely has an equilibrium
    step = -_STEP if at[index] > 0.0 else _STEP
    moved = at.copy()
    moved[index] += step
    return (predict(forward, effects, unknowns, moved) - base) / step


def predict(
    forward: ForwardModel, effects: Sequence[Effect], known: Sequence[Nuisance], size: FloatArray
) -> FloatArray:
    """Predict with effects and with nuisances of given sizes (in standard deviations), (n,); `size` (m,)."""
    shift = Shift(tuple(known), tuple(map(float, size)))
    return forward(effects, shift if np.any(size) else None) + shift.readings


def _viscosity(setup: Setup, change: float) -> Setup:
    return _oil(setup, viscosity_40=setup.bearing.oil.viscosity_40 * math.exp(change))


def _exponent(setup: Setup, change: float) -> Setup:
    return _oil(setup, viscosity_exponent=setup.bearing.oil.viscosity_exponent * math.exp(change))


def _film_heat(setup: Setup, change: float) -> Setup:
    # all heat goes into the oil: less of it is more capacity
    return _oil(setup, specific_heat=setup.bearing.oil.specific_heat * math.exp(-change))


def _oil(setup: Setup, **values: Any) -> Setup:
    oil = replace(setup.bearing.oil, **values)
    return setup.change(bearing=replace(setup.bearing, oil=oil))


def _supply(setup: Setup, change: float) -> Setup:
    return setup.change(supply_change=setup.supply_change + change)


def _assembled(setup: Setup, change: float) -> Setup:
    return setup.change_pads(lambda k, p: replace(p, assembled_clearance=p.assembled_clearance + change))


def _pad_clearance(setup: Setup, change: float) -> Setup:
    return setup.change_pads(lambda k, p: replace(p, pad_clearance=p.pad_clearance + change))


def _offset(setup: Setup, change: float, pad: int) -> Setup:
    return kind_of("pad_offset").apply(setup, pad=pad, radial_offset=change)


def _softer(setup: Setup, change: float, pad: int) -> Setup:
    return kind_of("soft_pivot").apply(setup, pad=pad, stiffness_factor=math.exp(change))


def _probe(setup: Setup, change: float, axes: tuple[float, float], index: int) -> Setup:
    rows = np.array([[math.cos(a), math.sin(a)] for a in axes])
    scale = np.eye(2)
    scale[index, index] += change
    turned = np.linalg.solve(rows, scale @ rows)
    return setup.change(instruments=setup.instruments.read_displacement(lambda omega: turned))


def _cell(setup: Setup, change: float, index: int) -> Setup:
    scale = np.eye(2)
    scale[index, index] += change
    return setup.change(instruments=setup.instruments.read_cells(scale))
