"""Oil that is another, is hotter or is short; heat that goes elsewhere; pads that it bends."""

import math
from dataclasses import replace

from model.effects.kind import Parameter, effect_on
from model.setup import Setup


@effect_on(
    "bearing",
    Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.1),
    source="ISO 3448: +-10 % within a viscosity grade",
    finding="the oil is {factor:size} {factor:thicker|thinner} than stated",
    physics="Stiffness and damping of the film grow with the viscosity. Pad temperatures change with it.",
    on_the_rig="All coefficients are off alike, damping most.",
    check="a sample of the oil, and its temperature at the pads",
)
def oil_viscosity(setup: Setup, factor: float) -> Setup:
    """mu_40 times factor."""
    return setup.change_oil(viscosity_40=setup.bearing.oil.viscosity_40 * factor)


@effect_on(
    "bearing",
    Parameter("factor", "1", "ratio", 1.0, 0.2, 3.0, 0.1),
    source="An exponential through two points of a data sheet: 5 to 15 % by the points chosen and the viscosity index",
    finding="the oil's viscosity falls {factor:size} {factor:faster|more slowly} with temperature than stated",
    physics=(
        "The viscosity at film temperature differs from what two points of a data sheet give. Hot films are then "
        "thinner or thicker than computed."
    ),
    on_the_rig="Coefficients agree when cool and part as the films warm up.",
    check="the oil's viscosity at 40 and 100 °C",
)
def viscosity_law(setup: Setup, factor: float) -> Setup:
    """The exponent kappa of mu(T) times factor; mu at the stated supply temperature stays."""
    oil = setup.bearing.oil
    exponent = oil.viscosity_exponent * factor
    viscosity = oil.viscosity_40 * math.exp((oil.viscosity_exponent - exponent) * (40.0 - oil.supply_temperature))
    return setup.change_oil(viscosity_40=viscosity, viscosity_exponent=exponent)


@effect_on(
    "bearing",
    Parameter("change", "K", "temperature difference", 0.0, -30.0, 60.0, 3.0),
    source="A sensor in the pipe, not at the pads",
    finding="the oil arrives {change:size} {change:warmer|colder} than stated",
    physics="A warmer supply makes a thinner film. All pad temperatures move along.",
    on_the_rig="All pad temperatures are off by about the same amount.",
    check="where the supply sensor sits",
)
def supply_temperature(setup: Setup, change: float) -> Setup:
    """Supply temperature plus change."""
    return setup.change(supply_change=setup.supply_change + change)


@effect_on(
    "bearing",
    Parameter("arc_fraction", "1", "ratio", 0.0, 0.0, 0.6, 0.1),
    source="He, Allaire 2002: leading-edge starvation of 10 to 40 % at low flow",
    finding="the film is missing over the first {arc_fraction} of the pads",
    physics="Too little oil reaches the leading edge. The film begins late, so it carries and damps less.",
    on_the_rig="Damping falls with speed; unloaded pads flutter.",
    check="oil flow and nozzles",
)
def starvation(setup: Setup, arc_fraction: float) -> Setup:
    """Every film starts after this fraction of the arc from the leading edge."""
    return setup.change(starvation=arc_fraction)


@effect_on(
    "structure",
    Parameter("added_mass", "kg", "mass", 0.0, 0.0, 300.0, 15.0),
    source="K-C-M fits of tilting-pad bearings: 0 to 60 kg at 100 mm",
    finding="the oil moves along like a mass of {added_mass}",
    physics="The film and the oil around it have inertia. The dynamic stiffness falls with the frequency squared.",
    on_the_rig="K falls with the excitation frequency, C does not.",
    check="runs at two high frequencies",
)
def fluid_inertia(setup: Setup, added_mass: float) -> Setup:
    """H gets -omega^2 * added_mass * I."""
    return setup.change(added_mass=setup.added_mass + added_mass)


@effect_on(
    "bearing",
    Parameter("fraction", "1", "ratio", 0.0, 0.0, 0.98, 0.4),
    source="Ettles 1992; groove mixing 0.4 to 0.95 in flooded bearings",
    finding="{fraction} of the hot oil of one pad enters the next",
    physics=("Oil that leaves a pad is carried into the next film. Films run hotter and thinner than with fresh oil."),
    on_the_rig="Pad temperatures rise from pad to pad around the shaft.",
    check="oil flow and the spray bars between the pads",
)
def hot_oil_carryover(setup: Setup, fraction: float) -> Setup:
    """A share lambda of the oil that leaves a pad enters the next one, as far as that takes it in.

    T_in = T_supply + s (T_out before - T_supply) with s = min(1, lambda Q_out before / Q_in), see
    `model.statics.compiled.heat`.
    """
    return setup.change(carryover=fraction)


@effect_on(
    "bearing",
    Parameter("share", "1", "ratio", 0.0, 0.0, 0.95, 0.1),
    source="What pads, shaft and drained oil take of a film's heat: 5 to 25 %",
    finding="pads, shaft and drained oil take {share} of the films' heat",
    physics=(
        "Heat that leaves the film lowers its temperature. Films are cooler and more viscous than an adiabatic one."
    ),
    on_the_rig="Pad temperatures are lower than predicted, stiffness and damping higher.",
    check="pad temperatures over speed and load",
)
def heat_loss(setup: Setup, share: float) -> Setup:
    """A share of the dissipation leaves the film at once, into shaft, pads, churned oil."""
    return setup.change(heat_loss=1.0 - (1.0 - setup.heat_loss) * (1.0 - share))


@effect_on(
    "bearing",
    Parameter("back_convection", "W/m^2/K", "heat transfer", 0.0, 0.0, 10000.0, 100.0),
    source="Pad backs in oil: 25 to 500 W/m^2/K, more where they are sprayed",
    finding="the pads' backs lose heat with {back_convection:0} W/m²/K",
    physics="Pads conduct the film's heat to the oil around them. The film's temperature evens out along the pad.",
    on_the_rig="Pad temperatures are lower and flatter than predicted.",
    check="the oil around the pads, and sprays on their backs",
)
def pad_conduction(setup: Setup, back_convection: float) -> Setup:
    """Switch on the heat paths into pads and journal, the pads' free faces with this film coefficient.

    Zero is the baseline: adiabatic. The journal, and pads that pass heat from hot places of the film to cold ones,
    come with the first watt, so that the effect starts with a small step.
    """
    if back_convection == 0.0:
        return setup
    options = replace(setup.options, conduction=True, isothermal_journal=True)
    return setup.change_pads(lambda number, pad: replace(pad, back_convection=back_convection)).change(options=options)


@effect_on(
    "bearing",
    Parameter("compliance_factor", "1", "ratio", 0.0, 0.0, 10.0, 1.0),
    source="Eq. (6)-(8) of Lubricants 2019, 7, 61; 1 is as computed",
    finding="the pads bend by {compliance_factor} of what is computed",
    physics=(
        "Film pressure bends the pads open. Their clearance grows with the load, which lowers stiffness and damping."
    ),
    on_the_rig="Coefficients fall short more and more as the load rises.",
    check="thickness and support of the pads",
)
def pad_bending(setup: Setup, compliance_factor: float) -> Setup:
    """Switch on the pads' computed deformation, times compliance_factor."""
    return setup.change(bending=compliance_factor)
