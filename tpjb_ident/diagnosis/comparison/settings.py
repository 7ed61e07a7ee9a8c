"""Settings of a diagnosis: what may be off, what is tried, and the constants of the decision."""

from dataclasses import dataclass, field

from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.constants import Deciding, Tolerance


@dataclass(frozen=True)
class DiagnoseSettings(Deciding):
    """How a diagnosis decides; the method is in `docs/diagnosis.md`, its studies in `tests/studies/diagnosis`."""

    tolerances: Tolerances = field(default_factory=Tolerances)  #: what may be off without being a finding
    skip: frozenset[str] = frozenset()  #: effects that are left out of the library
    workers: int | None = None  #: processes; default: one per core

    @property
    def tolerance(self) -> Tolerance:
        """What the model is trusted to: the stated ``model`` of `tolerances` for K and omega C, the defaults beside."""
        return Tolerance(stiffness=self.tolerances["model"])
