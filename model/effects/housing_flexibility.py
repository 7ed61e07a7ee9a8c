"""`housing_flexibility`: the structure between pivots and probes gives way."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords
from model.effects.series import SPRING, add_compliance
from model.setup import Setup


def apply(setup: Setup, stiffness: float) -> Setup:
    """A spring, equal in x and y, in series with the whole bearing."""
    return add_compliance(setup, 1.0 / stiffness, 0.0, 1.0 / stiffness)


KIND = EffectKind(
    name="housing_flexibility",
    side="structure",
    parameters=(SPRING,),
    apply=apply,
    source="The paper names it as a likely cause (Sec. 6): 1e9 to 5e9 N/m in rig housings",
    words=EffectWords(
        finding="the housing gives like a spring of {stiffness}",
        physics=(
            "Structure between film and probes bends under the dynamic load. It stands in series with the whole "
            "bearing."
        ),
        on_the_rig=(
            "Stiffness is short in the stiff direction, most at high load; a probe elsewhere on the housing disagrees."
        ),
        check="the housing's stiffness and where the probes are fixed",
    ),
)
