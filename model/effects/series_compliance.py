"""`series_compliance`: a structure that gives way in series with the bearing, differently in every direction."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.effects.series import add_compliance
from model.setup import Setup


def apply(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """inv(H_meas) = inv(H) + [[xx, xy], [xy, yy]]; static positions move too, in all kinds of run."""
    return add_compliance(setup, xx, xy, yy)


KIND = EffectKind(
    name="series_compliance",
    side="structure",
    parameters=tuple(Parameter(entry, "m/N", "compliance", 0.0, -2e-8, 2e-8, 5e-10) for entry in ("xx", "xy", "yy")),
    apply=apply,
    source="Generic: springs between bearing and probes of 1e9 to 5e9 N/m, as in rig housings",
    words=EffectWords(
        finding=(
            "something between film and probes gives way, differently in every direction: xx {xx}, xy {xy}, yy {yy}"
        ),
        physics="A generic term: a spring in series with the whole bearing, for what no named effect describes.",
        on_the_rig="Stiffness is short, most where it is high; dry tests and shaft positions show it too.",
        check="the joints, caps and brackets between the pivots and the probes",
    ),
)
