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
class OwnNumber:
    """How the size of a tolerance reads as the parameter of an effect, and back."""

    parameter: Callable[[float], float]
    change: Callable[[float], float]


_SAME = OwnNumber(lambda change: change, lambda value: value)
_RATIO = OwnNumber(math.exp, lambda value: math.log(max(value, 1e-9)))
_LOST = OwnNumber(lambda change: 1.0 - math.exp(change), lambda value: math.log(max(1.0 - value, 1e-9)))
#: Effects that are a tolerance's own number: that tolerance has the wide prior then, and no twin beside it.
OWN_NUMBERS = {
    "oil_viscosity": _RATIO, "viscosity_law": _RATIO, "supply_temperature": _SAME, "preload_error": _SAME,
    "heat_loss": _LOST, "pad_offset": _SAME, "soft_pivot": _RATIO,
}  # fmt: skip


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
    effect: str = ""  #: label of the effect whose own number it is


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
    own = functools.partial(_own, tolerances)
    clearance = tolerances["assembled_clearance"]
    listed = [
        own("viscosity", "1", "oil_viscosity"),
        own("viscosity_exponent", "1", "viscosity_law"),
        own("supply_temperature", "K", "supply_temperature"),
        Nuisance("assembled_clearance", clearance, "m", change=_assembled),
        own("pad_clearance", "m", "preload_error"),
        own("film_heat", "1", "heat_loss"),
    ]
    for pad in range(1, len(setup.bearing.pads) + 1) if by_pad else ():
        listed.append(own("clearance_scatter", "m", "pad_offset", pad))
        listed.append(own("pivot_stiffness_scatter", "1", "soft_pivot", pad))
    for i in range(2):
        gain = functools.partial(_probe, axes=tolerances.probe_axes, index=i)
        listed.append(Nuisance("probe_gain", tolerances["probe_gain"], "1", f"probe {i + 1}", gain))
        cell = functools.partial(_cell, index=i)
        listed.append(Nuisance("cell_gain", tolerances.cell_gain.value, "1", f"cell {'xy'[i]}", cell))
    listed += _readings(elements, tolerances)
    return tuple(nuisance for nuisance in listed if nuisance.sigma > 0.0)


def _own(known: Tolerances, name: str, unit: str, effect: str, pad: int = 0) -> Nuisance:
    """A tolerance that an effect of the library says, of a pad or of the whole bearing."""
    place = f"pad {pad}" if pad else ""
    change = functools.partial(_changed, effect=effect, pad=pad)
    return Nuisance(name, known[name], unit, place, change, effect=f"{effect} {place}".strip())


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


def _changed(setup: Setup, change: float, effect: str, pad: int) -> Setup:
    """Apply an effect of the size that a tolerance's change is."""
    kind = kind_of(effect)
    place = {"pad": pad} if pad else {}
    return kind.apply(setup, **place, **{kind.parameters[-1].name: OWN_NUMBERS[effect].parameter(change)})


def _assembled(setup: Setup, change: float) -> Setup:
    return setup.change_pads(lambda k, p: replace(p, assembled_clearance=p.assembled_clearance + change))


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
