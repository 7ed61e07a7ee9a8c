"""Settings of a diagnosis: what may be off, and what is tried."""

from dataclasses import dataclass, field

from tpjb_ident.diagnosis.forward.tolerances import Tolerances


@dataclass(frozen=True)
class DiagnoseSettings:
    """What may be off, and what is tried; the decision's constants are the same for all (`Deciding`)."""

    tolerances: Tolerances = field(default_factory=Tolerances)  #: what may be off without being a finding
    skip: frozenset[str] = frozenset()  #: effects that are left out of the library
    workers: int | None = None  #: processes; default: one per core
