"""`fluid_inertia`: the oil has mass."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, added_mass: float) -> Setup:
    """H gets -omega^2 * added_mass * I."""
    return setup.change(added_mass=setup.added_mass + added_mass)


KIND = EffectKind(
    name="fluid_inertia",
    side="structure",
    parameters=(Parameter("added_mass", "kg", "mass", 0.0, 0.0, 300.0, 15.0),),
    apply=apply,
    source="K-C-M fits of tilting-pad bearings: 0 to 60 kg at 100 mm",
    words=EffectWords(
        finding="the oil moves along like a mass of {added_mass}",
        physics="The film and the oil around it have inertia. The dynamic stiffness falls with the frequency squared.",
        on_the_rig="K falls with the excitation frequency, C does not.",
        check="runs at two high frequencies",
    ),
)
