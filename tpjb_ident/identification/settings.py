"""What a user may choose when records become coefficients."""

from dataclasses import dataclass, field

from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.presentation import changed

#: Methods of ``estimators.csv``; ``"rlm:tukey"`` names a norm.
_TABLED = ("ols", "rlm:huber", "rlm:tukey", "mm", "mm-eiv", "iv")


@dataclass(frozen=True)
class IdentifySettings:
    """Choices of a campaign's identification.

    Attributes
    ----------
    method : str
        Default method, the one in ``coefficients.csv``.
    methods : tuple of str
        All that are run; ``"rlm:tukey"`` names a norm. ``"iv"`` takes the excitation directions of the manifest
        for instruments and is left out where they cannot serve.
    phasors : PhasorSettings
    clearance : float or None
        Assembled clearance [m], for the amplitude check; None leaves it out.
    correct : bool
        Bring every run to its set-point load (measured miss, slope over the campaign's loads) and take
        mains off the excitation line where its size is known.
    keep_weights : bool
        Keep the weight of every window and method; without, only whether the window counted (nearly no memory).

    Examples
    --------
    >>> result = ti.identify(demo, ti.IdentifySettings(method="rlm:tukey", clearance=80e-6))
    >>> result.method
    'rlm:tukey'
    """

    method: str = "mm-eiv"
    methods: tuple[str, ...] = _TABLED
    phasors: PhasorSettings = field(default_factory=PhasorSettings)
    clearance: float | None = None
    correct: bool = True
    keep_weights: bool = True

    def __repr__(self) -> str:
        return changed(self)
