"""Nuisances: what is always free within its stated tolerance, and never a finding by itself.

Each is a prior in every fit and a part of the covariance of every test, N diag(s^2) N^T with N the change of the
observation vector; so the interval of an amplitude includes them. An effect that *is* one of these (oil of another
viscosity, one pad that stands further out) counts only where it exceeds what is stated.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from model.effects import Effect, kind_of
from model.setup import Setup
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.gap import centre_shifts
from tpjb_ident.diagnosis.observations.observe import Element, named, places

#: Step of derivatives, in standard deviations: small, so that a nuisance and the effect that does the same have the
#: same derivative, and their curvature does not tell them apart.
_STEP = 0.3


@dataclass(frozen=True)
class OwnNumber:
    """A tolerance that an effect says: how its size reads as the effect's parameter, and back."""

    tolerance: str
    unit: str = "1"
    place: str = ""  #: what there are several of: a parameter of the effect
    parameter: Callable[[float], float] = lambda change: change
    change: Callable[[float], float] = lambda value: value


_ratio = functools.partial(OwnNumber, parameter=math.exp, change=lambda value: math.log(max(value, 1e-9)))
#: Everything that may be off, and the effect that says so: that tolerance has the wide prior then, and no twin beside
#: it.
OWN_NUMBERS = {
    "oil_viscosity": _ratio("viscosity"),
    "viscosity_law": _ratio("viscosity_exponent"),
    "supply_temperature": OwnNumber("supply_temperature", "K"),
    "clearance_error": OwnNumber("assembled_clearance", "m"),
    "preload_error": OwnNumber("pad_clearance", "m"),
    "pivot_offset_error": OwnNumber("pivot_offset"),
    "pad_arc_error": _ratio("pad_arc"),
    "pad_length_error": _ratio("pad_length"),
    "pivot_angle_error": OwnNumber("pivot_angle", "rad", "pad"),
    "heat_loss": OwnNumber(
        "film_heat",
        parameter=lambda change: 1.0 - math.exp(change),
        change=lambda value: math.log(max(1.0 - value, 1e-9)),
    ),
    "pad_offset": OwnNumber("clearance_scatter", "m", "pad"),
    "pad_bore": OwnNumber("bore_scatter", "m", "pad"),
    "soft_pivot": _ratio("pivot_stiffness_scatter", place="pad"),
    "one_probe_gain": _ratio("probe_gain", place="probe"),
    "one_cell_gain": _ratio("cell_gain", place="cell"),
    "thermometer_offset": OwnNumber("thermometer", "K", "pad"),
}

#: Effects that do alike what others do at one place each: their tolerances together say them.
TOGETHER = {"pivot_flexibility": "soft_pivot", "probe_gain": "one_probe_gain", "loadcell_gain": "one_cell_gain"}


@dataclass(frozen=True)
class Nuisance:
    """One thing that may be off."""

    name: str
    sigma: float
    unit: str
    place: str = ""
    #: (n,): change of the observation vector per `sigma`, for one that acts on readings
    column: FloatArray | None = field(default=None, repr=False, compare=False)
    effect: str = ""  #: label of the effect whose own number it is

    @property
    def label(self) -> str:
        """Name with its place."""
        return f"{self.name} {self.place}".strip()

    def change(self, setup: Setup, size: float) -> Setup:
        """Apply the effect of the size that this being off is."""
        effect, *place = self.effect.split()
        kind, fixed = kind_of(effect), dict(zip(place[::2], map(int, place[1::2]), strict=True))
        return kind.apply(setup, **fixed, **{kind.parameters[-1].name: OWN_NUMBERS[effect].parameter(size)})


def shifted(setup: Setup, known: Sequence[Nuisance], size: Sequence[float]) -> Setup:
    """Change a set-up by nuisances of given sizes (in standard deviations), one after the other."""
    for nuisance, s in zip(known, size, strict=True):
        if nuisance.column is None and s:
            setup = nuisance.change(setup, s * nuisance.sigma)
    return setup


def nuisances(
    elements: Sequence[Element], setup: Setup, tolerances: Tolerances, by_pad: bool = True
) -> tuple[Nuisance, ...]:
    """List what may be off for an observation vector; `by_pad`: what may be off pad by pad, too."""
    pads = np.where(named(elements, "family") == "temperature", places(elements, "pad"), math.nan)
    warm = sorted({int(pad) for pad in pads[np.isfinite(pads)]})
    listed = []
    for effect, kind in OWN_NUMBERS.items():
        reads = kind.tolerance == "thermometer"
        count = len(setup.bearing.pads) * by_pad if kind.place == "pad" else 2
        numbers = warm if reads else range(1, count + 1) if kind.place else (0,)
        for number in numbers:
            sigma, place = tolerances[kind.tolerance], f"{kind.place} {number}" if kind.place else ""
            column = np.where(pads == number, sigma, 0.0) if reads else None
            listed.append(Nuisance(kind.tolerance, sigma, kind.unit, place, column, f"{effect} {place}".strip()))
    shifts = centre_shifts(elements) * tolerances.centre
    listed += [
        Nuisance("centre", tolerances.centre, "m", letter, column=shifts[:, axis])
        for axis, letter in enumerate("xy") if np.any(shifts[:, axis])
    ]  # fmt: skip
    return tuple(nuisance for nuisance in listed if nuisance.sigma > 0.0)


def at_baseline(
    forward: Forward, effects: Sequence[Effect], setup: Setup, known: Tolerances, base: FloatArray
) -> FloatArray:
    """Columns of what may be off in a whole bearing and its instruments, for tests that are only planned, (n, m)."""
    listed, step = nuisances(forward.elements, setup, known, by_pad=False), np.array([_STEP])
    moved = [predict(forward.fresh(near=True), effects, (nuisance,), step) for nuisance in listed]
    return (np.column_stack(moved) - base[:, None]) / _STEP


def predict(forward: Forward, effects: Sequence[Effect], known: Sequence[Nuisance], size: FloatArray) -> FloatArray:
    """Predict with effects and with nuisances of given sizes (in standard deviations), (n,); `size` (m,)."""
    sizes = size.tolist()
    change = functools.partial(shifted, known=known, size=sizes) if any(sizes) else None
    readings = [nuisance.column * s for nuisance, s in zip(known, sizes, strict=True) if nuisance.column is not None]
    return forward(effects, change) + np.sum(readings, axis=0)
