"""What the model can do beyond the paper's: switches of the film, its heat and the clearances, all off by default."""

from __future__ import annotations

from dataclasses import dataclass

from model.errors import OptionError
from model.film.models import FILM_MODELS
from model.growth import Growth
from model.nearest import check_known

#: Names of the models of a rupturing film.
CAVITATION = tuple(FILM_MODELS)
TURBULENCE = ("none", "ng-pan")


@dataclass(frozen=True)
class Options:
    """Physics that the baseline leaves out; `predict(..., options=Options(conduction=True))`.

    Attributes
    ----------
    conduction : bool
        The pads conduct the film's heat to their backs and edges; see `model.statics.heat_paths`.
    isothermal_journal : bool
        The journal passes heat from hot films to cold ones and keeps none.
    growth : Growth, optional
        Clearances change with the temperatures of journal, housing and pads; see `model.growth`.
    cavitation : {"swift-stieber", "jfo"}
        What happens where the film ruptures: p = 0 and dp/dn = 0 alone, or with the oil conserved (Jakobsson, Floberg
        and Olsson), see `model.film.cavitation`.
    turbulence : {"none", "ng-pan"}
        Resistance and shear of the film: laminar at every Reynolds number, or Ng and Pan's linearised theory, see
        `model.film.turbulence`. Films of idle pads stay laminar.
    perturbed_heat : bool
        In the dynamics the films' temperature and viscosity follow the motion (`adiabatic`, `tehd`) instead of staying
        what they are at rest; see `model.film.following_heat`. What enters a pad keeps its temperature.
    perturbed_bending : bool
        In the dynamics pads that deform (`tehd`, `thd`) bend with the motion, instead of moving as rigid bodies; see
        `model.dynamics.flexing_pads`.
    axial_tilt : bool
        Pads on spheres follow a shaft that leans (effect `misalignment`), as far as their pivots let them; see
        `model.statics.axial_tilt`.
    """

    conduction: bool = False
    isothermal_journal: bool = False
    growth: Growth | None = None
    cavitation: str = "swift-stieber"
    turbulence: str = "none"
    perturbed_heat: bool = False
    perturbed_bending: bool = False
    axial_tilt: bool = False

    def __post_init__(self) -> None:
        check_known("cavitation", self.cavitation, FILM_MODELS)
        check_known("turbulence", self.turbulence, TURBULENCE)
        if self.turbulence != "none" and self.cavitation != "swift-stieber":
            raise OptionError(f"a turbulent film ruptures by swift-stieber, not by {self.cavitation!r}")
        if self.perturbed_heat and (self.cavitation, self.turbulence) != ("swift-stieber", "none"):
            raise OptionError("perturbed_heat is for laminar films that rupture by swift-stieber")
        plain = (self.cavitation, self.turbulence, self.perturbed_heat) == ("swift-stieber", "none", False)
        if self.perturbed_bending and not plain:
            raise OptionError("perturbed_bending is for laminar films that rupture by swift-stieber, their heat frozen")
        if self.axial_tilt and not plain:
            raise OptionError("axial_tilt is for laminar films that rupture by swift-stieber, without perturbed_heat")
        if not (self.growth is None or isinstance(self.growth, Growth)):
            raise OptionError(f"growth must be a Growth or None, got {self.growth!r}")
