"""Settings of a diagnosis: every constant of the decision in one table, with what set it."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.observe import Tolerance


@dataclass(frozen=True)
class DiagnoseSettings:
    """How a diagnosis decides; the method is in `docs/diagnosis.md`, its studies in `tests/studies/diagnosis`."""

    tolerances: Tolerances = field(default_factory=Tolerances)  #: what may be off without being a finding
    skip: frozenset[str] = frozenset()  #: effects that are left out of the library
    workers: int | None = None  #: processes; default: one per core
    #: Prior of no fault, of one, two and three: with 30 names a second fault needs 3.5 nats beyond its Occam factor.
    prior: tuple[float, float, float, float] = (0.5, 0.35, 0.15, 0.064)
    #: What a generic term counts beside an effect: one with three numbers lies 1 to 2 nats behind the effect in it.
    term: float = 0.05
    #: Probability below which a tolerance is too far out for its model to stay. Clean faults that a tolerance does the
    #: work of are at 7e-8 to 6e-3, right models at 0.04 and more. The one constant that decides.
    untenable: float = 0.01
    #: Probability from which a name is listed, alone or as a family; right names reach 0.976 and more.
    included: float = 0.95
    #: Probability of no fault at all from which none is sought.
    nothing: float = 0.05
    #: Names in a family of look-alikes: a longer list says nothing.
    family: int = 3
    #: Scale of the model's error that right models reach: they need 0.10 to 0.17, wrong ones 0.56 to 13.
    right: float = 0.2
    #: Held-out gap of the baseline below which nothing is compared: nothing off gives 0.07 to 0.13.
    quiet: float = 0.2
    #: Held-out gap as stated, after over before, that a name takes; right names reach 0.01 to 0.41.
    halved: float = 0.5
    #: Squared held-out gap with tolerances free, after over before, from which effects explain the larger part.
    rest: float = 0.2
    #: Rise of the log evidence from which an effect's size drifts [nats]: odds of 150.
    drifting: float = 5.0
    #: Log evidence behind the leader at which explanations are no longer fitted [nats].
    near: float = 10.0
    #: Explanations that are fitted at the most: right ones come among the first ten.
    most_fits: int = 24
    #: Standard deviations from which a typical size would have been seen.
    visible: float = 3.0

    @property
    def tolerance(self) -> Tolerance:
        """What the model is trusted to: the stated ``model`` of `tolerances` for K and omega C, the defaults beside."""
        return Tolerance(stiffness=self.tolerances["model"])
