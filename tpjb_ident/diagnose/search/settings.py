"""Settings of a diagnosis: every constant of the decision path, with what set it, in one place."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.diagnose.forward.tolerances import Tolerances
from tpjb_ident.diagnose.observations.tolerance import Tolerance


@dataclass(frozen=True)
class DiagnoseSettings:
    """How a diagnosis decides; studies in `tests/studies/diagnosis`, tables in `docs/diagnosis.md`.

    Attributes
    ----------
    tolerances : Tolerances
        What may be off in drawing, data sheet, instruments and in the model itself.
    wanted : float
        Held-out log score (nats, summed over the folds) that an effect must be worth to unseen points.
    exceeds : float
        Log evidence that it must be worth beside the stated tolerances: for an effect that is itself a tolerance, 1.6
        is two and a half standard deviations of it.
    alike : float
        Log evidence below which another explanation counts as one that these data cannot tell apart: 3 is odds of 20.
    most : float
        Share of the squared gap on unseen points that effects must close to be named at all.
    spare : float
        Share of the log evidence of a generic term that an effect of the library may lack to be taken before it: a
        second effect, of which three free numbers take up a part, costs the right one that much.
    alarm : float
        p-value, all patterns considered, below which a residual is more than noise and stated tolerances.
    tried : int
        Candidates that are fitted per round, the best to first order.
    most_effects : int
    visible : float
        Size of a typical effect, in standard deviations of everything else, below which a campaign cannot see it.
    skip : frozenset of str
        Effects to leave out of the library.
    workers : int or None
    """

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
