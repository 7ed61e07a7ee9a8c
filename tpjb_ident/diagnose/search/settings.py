"""Settings of a diagnosis: thresholds with what they mean, in one place."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.diagnose.forward.nuisance import Certificates
from tpjb_ident.diagnose.observations.tolerance import Tolerance


@dataclass(frozen=True)
class DiagnoseSettings:
    """How a diagnosis decides.

    Attributes
    ----------
    tolerance : Tolerance
    certificates : Certificates
    alarm : float
        p-value of the baseline's residual, all tests considered, below which something is the matter.
    adequate : float
        p-value below which what a model leaves is still structured.
    cancelling : float
        Whitened size of one effect, in units of what all together do, above which effects merely cancel each other.
    held : float
        p-value below which held-out points contradict a model.
    detect, further : float
        Drop of chi-square, in units of the residual's own variance, which the first effect and every one after it
        must bring: combinations imitate far more than single effects do.
    rivals : float
        Difference of chi-square, in the same units, below which two explanations count as alike.
    closed : float
        Share of the squared gap that a model may leave however structured: it closes all that matters.
    tried : int
        Candidates that are fitted per round, the best by score.
    most_effects : int
    visible : float
        Whitened size of a typical effect below which a campaign could not have seen it.
    skip : frozenset of str
        Effects to leave out of the library.
    workers : int or None
    """

    tolerance: Tolerance = field(default_factory=Tolerance)
    certificates: Certificates = field(default_factory=Certificates)
    alarm: float = 0.01
    adequate: float = 0.005
    cancelling: float = 2.5
    held: float = 0.001
    detect: float = 12.0
    further: float = 25.0
    rivals: float = 9.0
    closed: float = 0.01
    tried: int = 8
    most_effects: int = 3
    visible: float = 3.0
    skip: frozenset[str] = frozenset()
    workers: int | None = None
