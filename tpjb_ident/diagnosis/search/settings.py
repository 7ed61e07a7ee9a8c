"""Settings of a diagnosis: every constant of the decision path, with what set it, in one place."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.observe import Tolerance


@dataclass(frozen=True)
class DiagnoseSettings:
    """How a diagnosis decides; studies in `tests/studies/diagnosis`, tables in `tests/studies/RESULTS.md`."""

    tolerances: Tolerances = field(default_factory=Tolerances)
    wanted: float = 5.0
    exceeds: float = 1.6
    alike: float = 3.0
    most: float = 0.8
    spare: float = 0.1
    alarm: float = 0.005
    tried: int = 5
    most_effects: int = 3
    visible: float = 3.0
    skip: frozenset[str] = frozenset()
    workers: int | None = None

    @property
    def tolerance(self) -> Tolerance:
        """What the model is trusted to: the stated ``model`` of `tolerances` for K and omega C, the defaults beside."""
        return Tolerance(stiffness=self.tolerances["model"])
