"""Pivots that give way, damp, roll or slide otherwise than their laws say."""

from collections.abc import Callable

from model.bearing import Bearing
from model.effects.kind import PAD, Parameter, effect_on
from model.pivots import ScaledPivot
from model.setup import Setup

#: How many times as stiff as its law says a pivot is.
_FACTOR = Parameter("stiffness_factor", "1", "ratio", 1.0, 0.05, 5.0, 0.5, "inverse")


def _only_on(*kinds: str, otherwise: str) -> Callable[[Bearing], str]:
    """Which pivots have what an effect acts on: rockers roll, spheres slide, knife edges only tilt."""

    def obstacle(bearing: Bearing) -> str:
        if not bearing.like_pivots:
            return "its pivots differ from pad to pad, and the model holds the tilt of all pads alike."
        return "" if bearing.pivot.kind in kinds else otherwise

    return obstacle


@effect_on(
    "bearing",
    _FACTOR,
    source="Measured pivots are 2-3 times softer than the formula (Lubricants 2019, 7, 61, Fig. 12)",
    finding="all pivots have {stiffness_factor} of the formula's stiffness",
    physics=(
        "Pivot, pad back and housing seat give more than the contact formula says. They stand in series with the "
        "film, so the stiff direction loses most."
    ),
    on_the_rig=(
        "The deflection of the dry tests exceeds the formula's at every pad; K and C fall short, most at high load."
    ),
    check="the dry pivot tests, contact radii and seats",
)
def pivot_flexibility(setup: Setup, stiffness_factor: float) -> Setup:
    """Every pivot deflects delta(W) / stiffness_factor."""
    return setup.change(pivots=tuple(ScaledPivot(law, stiffness_factor) for law in setup.pivots))


@effect_on(
    "bearing",
    PAD,
    _FACTOR,
    source="Pad #5 of the paper is the softest of five (Lubricants 2019, 7, 61, Fig. 12)",
    finding="the pivot of {pad} has {stiffness_factor} of the others' stiffness",
    physics="One pivot gives more, or less, than the others. It stands in series with that pad's film.",
    on_the_rig="One dry test is off; coefficients are off along that pad's direction.",
    check="that pad's seat, pivot and fit",
)
def soft_pivot(setup: Setup, pad: int, stiffness_factor: float) -> Setup:
    """The pivot of one pad deflects delta(W) / stiffness_factor."""
    pivots = list(setup.pivots)
    pivots[pad - 1] = ScaledPivot(pivots[pad - 1], stiffness_factor)
    return setup.change(pivots=tuple(pivots))


@effect_on(
    "bearing",
    Parameter("damping", "N s/m", "damping", 0.0, 0.0, 100000000.0, 300000.0),
    source="Loss factor 0.05 to 0.2 of the pivot stiffness at 25 Hz",
    finding="every pivot damps with {damping}",
    physics="Friction in the pivots takes energy beside the film. It acts in series with it.",
    on_the_rig="The dry tests show a loop between loading and unloading; damping is too high.",
    check="wear and lubrication of the pivots",
)
def pivot_damping(setup: Setup, damping: float) -> Setup:
    """c_eta of Eq. (12)."""
    return setup.change(pivot_damping=setup.pivot_damping + damping)


@effect_on(
    "bearing",
    Parameter("rotational_stiffness", "N m/rad", "rotational stiffness", 0.0, 0.0, 1000000.0, 1000.0),
    source="Flexure pivots: 1e3 to 1e5 N m/rad; a stuck rocker more",
    finding="the pivots resist tilting with {rotational_stiffness}",
    physics="A pad that cannot tilt freely behaves like a fixed one. Cross-coupled stiffness appears.",
    on_the_rig="kxy and kyx of opposite sign, that no free pad gives.",
    check="whether the pads tilt freely by hand",
)
def pivot_rotation(setup: Setup, rotational_stiffness: float) -> Setup:
    """Tilting is held back by this about each pivot, from the concentric attitude (k_theta of Eq. 12)."""
    return setup.change(rotational_stiffness=setup.rotational_stiffness + rotational_stiffness)


@effect_on(
    "bearing",
    Parameter("factor", "1", "ratio", 0.0, 0.0, 5.0, 1.0),
    source="The radii of the drawing; 1 is as computed",
    obstacle=_only_on("rocker", "spherical", otherwise="the bearing's pivots have no radii to roll on."),
    finding="the pivots resist rolling with {factor} of what their radii give",
    physics=(
        "A rocker rolls on its seat, so the contact walks away from the pivot line. The pad resists tilting in "
        "proportion to its load."
    ),
    on_the_rig="Cross-coupled stiffness and a loss of damping that grow with the load.",
    check="the radii of rocker and seat",
)
def pivot_rolling(setup: Setup, factor: float) -> Setup:
    """Tilting is held back by k_theta = factor * W_pad * R_H R_b / (R_H - R_b)."""
    return setup.change(rolling=setup.rolling + factor)


@effect_on(
    "bearing",
    Parameter("coefficient", "1", "ratio", 0.0, 0.0, 0.6, 0.05),
    source="Steel on steel in oil: 0.05 to 0.15; dry up to 0.5",
    obstacle=_only_on("spherical", otherwise="only a spherical pivot slides; a rocker rolls (pivot_rolling)."),
    finding="the pivots rub with a friction coefficient of {coefficient:3}",
    physics=(
        "A sphere that rubs in its seat holds the pad until the moment is large enough. A pad that is held "
        "behaves like a fixed one."
    ),
    on_the_rig="Coefficients depend on the amplitude; loading and unloading differ.",
    check="wear and lubrication of the seats",
)
def pivot_friction(setup: Setup, coefficient: float) -> Setup:
    """Tilting is held by friction up to coefficient * W_pad * sphere radius."""
    return setup.change(friction=setup.friction + coefficient)
