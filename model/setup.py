"""Everything the solver is told about a bearing: the drawing, the pivots, and the switches that effects set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from model.bearing import Bearing, BearingError, Pad
from model.errors import OptionError, check_known
from model.growth import Growth
from model.instruments import Instruments
from model.options import Options
from model.pivots import PivotLaw
from rigdata.arrays import FloatArray

_THERMAL = ("isothermal", "adiabatic", "tehd", "thd")
#: Those with pads that deform.
_BENDING = ("tehd", "thd")


@dataclass(frozen=True)
class Mesh:
    """Film mesh: intervals along the arc and across half the width; both even."""

    along: int = 80
    across: int = 6
    fine_solid: bool = True  #: whether pads that bend are meshed as finely as films: else K and C are 0.1 % off

    def coarser(self) -> Mesh:
        """Half as many intervals each way (for the two-mesh error), even and no less than 8 x 4."""
        return Mesh(max(8, 2 * (self.along // 4)), max(4, 2 * (self.across // 4)), fine_solid=False)


@dataclass(frozen=True)
class Setup:
    """A bearing, its pivots and every switch of the model; effects return changed copies.

    Attributes
    ----------
    bearing : Bearing
    pivots : tuple of PivotLaw
        One per pad.
    thermal : {"isothermal", "adiabatic", "tehd", "thd"}
        "tehd": pads deform. "thd": temperatures across the films, pads that conduct and deform, a journal that passes
        heat on, grooves, clearances that grow with their temperatures; see `model.statics.compiled.cross_heat`.
    mesh : Mesh
    supply_change : float
        The oil enters this much hotter than the bearing file says [K].
    carryover : float
        Fraction lambda of the oil leaving a pad that enters the next, as far as that takes it in.
    options : Options
        Physics beyond the paper's model.
    bending : float
        Factor on the computed pad deformation; 0: rigid pads.
    rotational_stiffness : float
        k_theta of Eq. (12) [N m/rad], also in statics.
    pivot_damping : float
        c_eta of Eq. (12) [N s/m].
    misalignment : tuple of float
        Angle of the shaft axis and the direction towards which it leans [rad].
    starvation : float
        Every film starts after this fraction of the arc.
    rolling : float
        Factor on the rotational stiffness of pivots that roll, see `model.tilt_hold`.
    friction : float
        Coefficient of friction of pivots that slide.
    vibration : float
        Amplitude of the journal's vibration [m]: tells whether it breaks sliding pivots loose.
    heat_loss : float
        Share of the dissipation that leaves the films at once.
    series_compliance : tuple of float
        xx, xy and yy of the compliance in series with the whole bearing [m/N].
    added_mass : float
        [kg]
    parallel_stiffness, parallel_damping : tuple of float
        xx, xy, yx and yy of what stands beside bearing and structure in dynamic tests [N/m], [N s/m].
    instruments : Instruments
        What stands between this bearing and the records; the solver does not look at it.
    accuracy : float
        Unbalanced share of the load at which an equilibrium counts as found; 1e-5 is plenty where many models are
        compared.
    clearance_change : float
        Change of Cb in running conditions only [m]: dry tests are cold.
    grown : bool
        The bearing's clearances are the running ones, and grow no more.
    mirrored : bool
        All that the solver sees is a mirror image of the rig, see `model.mirror`.
    """

    bearing: Bearing
    pivots: tuple[PivotLaw, ...]
    thermal: str = "adiabatic"
    mesh: Mesh = field(default_factory=Mesh)
    supply_change: float = 0.0
    carryover: float = 0.0
    options: Options = field(default_factory=Options)
    bending: float = 0.0
    rotational_stiffness: float = 0.0
    pivot_damping: float = 0.0
    misalignment: tuple[float, float] = (0.0, 0.0)
    starvation: float = 0.0
    rolling: float = 0.0
    friction: float = 0.0
    vibration: float = 2e-6
    heat_loss: float = 0.0
    series_compliance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    added_mass: float = 0.0
    parallel_stiffness: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    parallel_damping: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    instruments: Instruments = field(default_factory=Instruments)
    clearance_change: float = 0.0
    accuracy: float = 1e-7
    grown: bool = False
    mirrored: bool = False

    def __post_init__(self) -> None:
        check_known("thermal", self.thermal, _THERMAL)
        if self.thermal == "thd" and self.options.cavitation != "swift-stieber":
            raise OptionError('thermal "thd" is for films that rupture by swift-stieber; take "adiabatic"')
        if self.thermal == "thd" and self.options.perturbed_heat:
            raise OptionError('perturbed_heat is for films of one temperature across; take "adiabatic" or "tehd"')
        if self.options.axial_tilt and self.bearing.pivot.kind != "spherical":
            raise OptionError(
                f"axial_tilt is for pads on spheres, not on {self.bearing.pivot.kind} pivots; leave it out"
            )
        if not self.bearing.pads:
            raise BearingError("a bearing needs at least one pad")
        if len(self.pivots) != len(self.bearing.pads):
            raise BearingError(f"need one pivot law per pad ({len(self.bearing.pads)}), got {len(self.pivots)}")

    def change(self, **changes: Any) -> Setup:
        """Return a copy with other values."""
        return replace(self, **changes)

    def change_oil(self, **changes: Any) -> Setup:
        """Return a copy whose oil has other values."""
        return replace(self, bearing=replace(self.bearing, oil=replace(self.bearing.oil, **changes)))

    def change_pads(self, change: Callable[[int, Pad], Pad]) -> Setup:
        """Return a copy with every pad replaced by ``change(number, pad)``; numbers from 1.

        Parameters
        ----------
        change : callable
            ``change(number, pad)`` returns a pad; numbers from 1.

        Returns
        -------
        Setup
        """
        pads = tuple(change(k, pad) for k, pad in enumerate(self.bearing.pads, start=1))
        return replace(self, bearing=self.bearing.with_pads(pads))

    @property
    def inlet_temperature(self) -> float:
        """Temperature at which fresh oil enters [degC]."""
        return self.bearing.oil.supply_temperature + self.supply_change

    @property
    def mixing(self) -> float:
        """Share lambda of the oil leaving a pad that is there for the next: `carryover`, or all of it (`thd`).

        All of it is the groove's flow balance alone: the supply makes up for the rest.
        """
        return self.carryover or float(self.thermal == "thd")

    @property
    def structure(self) -> FloatArray:
        """Compliance in series with the whole bearing, (2, 2) [m/N]."""
        xx, xy, yy = self.series_compliance
        return np.array([[xx, xy], [xy, yy]])

    @property
    def flexible_pads(self) -> bool:
        """Whether pads deform."""
        return self.bending_factor != 0.0

    @property
    def pads_follow(self) -> bool:
        """Whether pads follow a shaft that leans."""
        return self.options.axial_tilt and self.misalignment[0] != 0.0

    @property
    def bending_factor(self) -> float:
        """Factor on the computed deformation (1 for ``tehd`` and ``thd`` with nothing else said)."""
        return self.bending or float(self.thermal in _BENDING)

    @property
    def growth(self) -> Growth | None:
        """What sets the running clearances: the option, or with ``thd`` its defaults."""
        if self.grown:
            return None
        return self.options.growth or (Growth() if self.thermal == "thd" else None)
