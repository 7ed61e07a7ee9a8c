"""`housing_mass`: the housing weighs more than stated."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, mass_error: float) -> Setup:
    """True housing mass = stated mass + mass_error."""
    return setup.change(instruments=setup.instruments.weigh_housing(mass_error))


KIND = EffectKind(
    name="housing_mass",
    side="measurement",
    parameters=(Parameter("mass_error", "kg", "mass", 0.0, -500.0, 1000.0, 5.0),),
    apply=apply,
    source="Hoses, plates and cells move along",
    words=EffectWords(
        finding="{mass_error:size} {mass_error:more|less} move with the housing than stated",
        physics=(
            "The inertia of the housing is taken off the cells' force with its mass. An error in it grows with the "
            "frequency squared."
        ),
        on_the_rig="Stiffness drifts with the excitation frequency like a mass does.",
        check="what hangs on the housing: hoses, plates, cells",
    ),
)
