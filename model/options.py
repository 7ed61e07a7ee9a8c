"""What the model can do beyond the paper's: switches of the film, its heat and the clearances, all off by default."""

from dataclasses import dataclass

from model.errors import OptionError, check_known
from model.growth import Growth

#: Those of `model.film.models` that are chosen by name; a turbulent film is a matter of the other option.
CAVITATION = ("swift-stieber", "jfo")
_TURBULENCE = ("none", "ng-pan")


@dataclass(frozen=True)
class Options:
    """Physics that the baseline leaves out; `predict(..., options=Options(conduction=True))`."""

    conduction: bool = False
    isothermal_journal: bool = False
    growth: Growth | None = None
    cavitation: str = "swift-stieber"
    turbulence: str = "none"
    perturbed_heat: bool = False
    perturbed_bending: bool = False
    axial_tilt: bool = False

    def __post_init__(self) -> None:
        check_known("cavitation", self.cavitation, CAVITATION)
        check_known("turbulence", self.turbulence, _TURBULENCE)
        if self.turbulence != "none" and self.cavitation != "swift-stieber":
            raise OptionError(f"a turbulent film ruptures by swift-stieber, not by {self.cavitation!r}")
        plain = (self.cavitation, self.turbulence) == ("swift-stieber", "none")
        if self.perturbed_heat and not plain:
            raise OptionError("perturbed_heat is for laminar films that rupture by swift-stieber")
        for name in ("perturbed_bending", "axial_tilt"):
            if getattr(self, name) and not (plain and not self.perturbed_heat):
                raise OptionError(f"{name} is for laminar films that rupture by swift-stieber, without perturbed_heat")
        if not isinstance(self.growth, Growth | None):
            raise OptionError(f"growth must be a Growth or None, got {self.growth!r}")
