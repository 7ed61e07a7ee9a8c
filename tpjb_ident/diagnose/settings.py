"""Settings of a diagnosis: thresholds with what they mean, in one place."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.diagnose.nuisance import Certificates
from tpjb_ident.diagnose.tolerance import Tolerance


@dataclass(frozen=True)
class DiagnoseSettings:
    """How a diagnosis decides.

    Attributes
    ----------
    tolerance : Tolerance
    certificates : Certificates
    detect : float
        Drop of chi-square below which no effect is added (32 candidates are tried: 20 is far out on their maximum).
    further : float
        Share of the chi-square that is left which every effect after the first must take away.
    rivals : float
        Rescaled difference of chi-square below which two explanations count as alike.
    tried : int
        Candidates that are fitted per round, the best by score.
    most_effects : int
    closed : float
        Root mean square of whitened residuals above which a model does not describe the data.
    visible : float
        Whitened size of a typical effect below which a campaign could not have seen it.
    skip : frozenset of str
        Effects to leave out of the library.
    workers : int or None
    """

    tolerance: Tolerance = field(default_factory=Tolerance)
    certificates: Certificates = field(default_factory=Certificates)
    detect: float = 20.0
    further: float = 0.3
    rivals: float = 12.0
    tried: int = 8
    most_effects: int = 3
    closed: float = 1.0
    visible: float = 3.0
    skip: frozenset[str] = frozenset()
    workers: int | None = None
