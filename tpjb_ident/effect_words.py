"""Effects in the words and units of an engineer: what was found, the physics, how it looks on a rig, what to check."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tpjb_ident.rounding import fixed, plain, with_interval


@dataclass(frozen=True)
class Found:
    """A parameter's value with its 95 % interval, SI; "1" is the unit of a ratio, "pad" that of a pad number."""

    value: float
    lo: float
    hi: float
    unit: str = "1"


Parameters = Mapping[str, Found]
#: SI unit: what people read, and its size in SI.
UNITS = {
    "m": ("µm", 1e-6),
    "N/m": ("MN/m", 1e6),
    "m/N": ("µm/kN", 1e-9),
    "N s/m": ("kN s/m", 1e3),
    "N m/rad": ("kN m/rad", 1e3),
    "s": ("ms", 1e-3),
    "rad": ("°", math.radians(1.0)),
    "K": ("K", 1.0),
    "kg": ("kg", 1.0),
    "Pa": ("MPa", 1e6),
    "W/m^2/K": ("W/m²/K", 1.0),
    "1": ("%", 0.01),
}


def label_in_words(name: str) -> str:
    """Name of an effect, a parameter or an observable as people write it."""
    text = re.sub(r"\bpad (\d)", r"pad #\1", name.replace("_", " "))
    return re.sub(r"(?<!load )\bdirection (-?\d+\.?\d*)", lambda m: f"at {plain(math.degrees(float(m[1])), 0)}°", text)


def amount(found: Found, size: bool = False) -> str:
    """A parameter with half its interval in the units that people read."""
    unit, scale = UNITS.get(found.unit, (found.unit, 1.0))
    value, low, high = found.value, found.lo, found.hi
    if size and value < 0:
        value, low, high = -value, -high, -low
    return f"{with_interval(value, low, high, scale)} {unit}".replace(" °", "°")


def _entries(p: Parameters) -> str:
    """Entries of a 2x2 term with their directions."""
    return ", ".join(f"{entry} {amount(found)}" for entry, found in p.items())


def _away(found: Found, more: str, less: str) -> str:
    """How far a factor is from one: ``"5.0 ± 0.4 % softer"``."""
    off = Found(found.value - 1.0, found.lo - 1.0, found.hi - 1.0)
    return f"{amount(off, size=True)} {more if off.value > 0 else less}"


@dataclass(frozen=True)
class EffectWords:
    """What to say of an effect."""

    finding: Callable[[Parameters], str]
    physics: str
    on_the_rig: str
    check: str


def _pad(p: Parameters) -> str:
    return f"pad #{p['pad'].value:.0f}"


def _misalignment(p: Parameters) -> str:
    tilt = p["angle"]
    slope = with_interval(tilt.value, tilt.lo, tilt.hi, 1e-3)
    return f"the shaft is tilted by {slope} mm/m towards {plain(math.degrees(p['direction'].value), 0)}°"


WORDS: dict[str, EffectWords] = {
    "pad_offset": EffectWords(
        lambda p: (
            f"{_pad(p)} stands {amount(p['radial_offset'], size=True)} too far "
            f"{'out' if p['radial_offset'].value > 0 else 'in'}"
        ),
        "The assembled clearance of one pad differs from the drawing. Its film is thicker or thinner than the others', "
        "so the load shares itself out anew among the pads.",
        "One side of the clearance polygon stands off; kxx and kyy part when the load turns.",
        "the pad's seat and shims, and the clearance sweep",
    ),
    "pivot_flexibility": EffectWords(
        lambda p: f"all pivots have {amount(p['stiffness_factor'])} of the formula's stiffness",
        "Pivot, pad back and housing seat give more than the contact formula says. They stand in series with the film, "
        "so the stiff direction loses most.",
        "The deflection of the dry tests exceeds the formula's at every pad; K and C fall short, most at high load.",
        "the dry pivot tests, contact radii and seats",
    ),
    "soft_pivot": EffectWords(
        lambda p: f"the pivot of {_pad(p)} has {amount(p['stiffness_factor'])} of the formula's stiffness",
        "One pivot gives more, or less, than the others. It stands in series with that pad's film.",
        "One dry test is off; coefficients are off along that pad's direction.",
        "that pad's seat, pivot and fit",
    ),
    "thermal_growth": EffectWords(
        lambda p: (
            f"the running clearance is {amount(p['clearance_change'], size=True)} "
            f"{'larger' if p['clearance_change'].value > 0 else 'smaller'} than cold"
        ),
        "Housing, pads and shaft warm up unequally, and the clearance follows. A larger clearance softens the film and "
        "lets the shaft sink deeper.",
        "The cold clearance sweep agrees with the drawing, the running locus does not.",
        "temperatures of housing and shaft; a hot clearance sweep right after a run",
    ),
    "preload_error": EffectWords(
        lambda p: (
            f"the pads are bored {amount(p['pad_clearance_change'], size=True)} "
            f"{'wider' if p['pad_clearance_change'].value > 0 else 'tighter'} than drawn"
        ),
        "The pads' own radius differs from the drawing, so the preload does. The film converges more or less strongly "
        "at the same assembled clearance.",
        "The clearance polygon agrees with the drawing; stiffness is off alike in both directions, most at low load.",
        "the bore of the pads",
    ),
    "oil_viscosity": EffectWords(
        lambda p: f"the oil is {_away(p['factor'], 'thicker', 'thinner')} than stated",
        "Stiffness and damping of the film grow with the viscosity. Pad temperatures change with it.",
        "All coefficients are off alike, damping most.",
        "a sample of the oil, and its temperature at the pads",
    ),
    "supply_temperature": EffectWords(
        lambda p: (
            f"the oil arrives {amount(p['change'], size=True)} {'warmer' if p['change'].value > 0 else 'colder'} "
            "than stated"
        ),
        "A warmer supply makes a thinner film. All pad temperatures move along.",
        "All pad temperatures are off by about the same amount.",
        "where the supply sensor sits",
    ),
    "hot_oil_carryover": EffectWords(
        lambda p: f"{amount(p['fraction'])} of the hot oil of one pad enters the next",
        "Oil that leaves a pad is carried into the next film. Films run hotter and thinner than with fresh oil.",
        "Pad temperatures rise from pad to pad around the shaft.",
        "oil flow and the spray bars between the pads",
    ),
    "starvation": EffectWords(
        lambda p: f"the film is missing over the first {amount(p['arc_fraction'])} of the pads",
        "Too little oil reaches the leading edge. The film begins late, so it carries and damps less.",
        "Damping falls with speed; unloaded pads flutter.",
        "oil flow and nozzles",
    ),
    "misalignment": EffectWords(
        _misalignment,
        "The shaft axis is tilted in the bearing, so the film is thinner at one end. Stiffness rises, most across the "
        "loaded pad.",
        "Probes at the two ends read differently; the pads wear at one edge.",
        "the alignment of shaft and housing under load",
    ),
    "pad_bending": EffectWords(
        lambda p: f"the pads bend by {amount(p['compliance_factor'])} of what is computed",
        "Film pressure bends the pads open. Their clearance grows with the load, which lowers stiffness and damping.",
        "Coefficients fall short more and more as the load rises.",
        "thickness and support of the pads",
    ),
    "uneven_pads": EffectWords(
        lambda p: (
            "the pads stand unevenly: "
            + ", ".join(f"#{key.rpartition('_')[2]} {amount(one)}" for key, one in p.items())
        ),
        "Machining of pads and seats leaves each pad at its own assembled clearance. The load shares itself out anew "
        "among them.",
        "The clearance polygon is irregular; coefficients part where the load turns.",
        "the clearance sweep, pad by pad",
    ),
    "series_compliance": EffectWords(
        lambda p: "something between film and probes gives way, differently in every direction: " + _entries(p),
        "A generic term: a spring in series with the whole bearing, for what no named effect describes.",
        "Stiffness is short, most where it is high; dry tests and shaft positions show it too.",
        "the joints, caps and brackets between the pivots and the probes",
    ),
    "parallel_stiffness": EffectWords(
        lambda p: "something beside the film adds a stiffness: " + _entries(p),
        "A generic term: a constant stiffness that the records hold besides the film's, for what no named effect "
        "describes.",
        "The same amount is off at every load and frequency; shaft positions do not show it.",
        "hoses, seals and leaf springs across the film; shake the rig dry",
    ),
    "parallel_damping": EffectWords(
        lambda p: "something beside the film adds a damping: " + _entries(p),
        "A generic term: a constant damping that the records hold besides the film's, for what no named effect "
        "describes.",
        "The same damping is off at every load; stiffness agrees.",
        "hoses, seals and dampers across the film; shake the rig dry",
    ),
    "structure_compliance": EffectWords(
        lambda p: (
            f"the structure gives like a spring of {amount(p['stiffness'])} in one direction, "
            f"{plain(math.degrees(p['direction'].value), 0)}°"
        ),
        "A cap, a foot or a joint between bearing and probes bends under the dynamic load. It stands in series with "
        "the bearing in that direction only.",
        "Stiffness is short in one direction; dry tests of pads that lie there give too much.",
        "bolts, joints and feet along that direction",
    ),
    "pivot_rolling": EffectWords(
        lambda p: f"the pivots resist rolling with {amount(p['factor'])} of what their radii give",
        "A rocker rolls on its seat, so the contact walks away from the pivot line. The pad resists tilting in "
        "proportion to its load.",
        "Cross-coupled stiffness and a loss of damping that grow with the load.",
        "the radii of rocker and seat",
    ),
    "pivot_friction": EffectWords(
        lambda p: f"the pivots rub with a friction coefficient of {fixed(p['coefficient'].value, 3)}",
        "A sphere that rubs in its seat holds the pad until the moment is large enough. A pad that is held behaves "
        "like a fixed one.",
        "Coefficients depend on the amplitude; loading and unloading differ.",
        "wear and lubrication of the seats",
    ),
    "viscosity_law": EffectWords(
        lambda p: (
            f"the oil's viscosity falls {_away(p['factor'], 'faster', 'more slowly')} with temperature than stated"
        ),
        "The viscosity at film temperature differs from what two points of a data sheet give. Hot films are then "
        "thinner or thicker than computed.",
        "Coefficients agree when cool and part as the films warm up.",
        "the oil's viscosity at 40 and 100 °C",
    ),
    "heat_loss": EffectWords(
        lambda p: f"pads, shaft and drained oil take {amount(p['share'])} of the films' heat",
        "Heat that leaves the film lowers its temperature. Films are cooler and more viscous than an adiabatic one.",
        "Pad temperatures are lower than predicted, stiffness and damping higher.",
        "pad temperatures over speed and load",
    ),
    "pad_conduction": EffectWords(
        lambda p: f"the pads' backs lose heat with {fixed(p['back_convection'].value, 0)} W/m²/K",
        "Pads conduct the film's heat to the oil around them. The film's temperature evens out along the pad.",
        "Pad temperatures are lower and flatter than predicted.",
        "the oil around the pads, and sprays on their backs",
    ),
    "pivot_damping": EffectWords(
        lambda p: f"every pivot damps with {amount(p['damping'])}",
        "Friction in the pivots takes energy beside the film. It acts in series with it.",
        "The dry tests show a loop between loading and unloading; damping is too high.",
        "wear and lubrication of the pivots",
    ),
    "pivot_rotation": EffectWords(
        lambda p: f"the pivots resist tilting with {amount(p['rotational_stiffness'])}",
        "A pad that cannot tilt freely behaves like a fixed one. Cross-coupled stiffness appears.",
        "kxy and kyx of opposite sign, that no free pad gives.",
        "whether the pads tilt freely by hand",
    ),
    "housing_flexibility": EffectWords(
        lambda p: f"the housing gives like a spring of {amount(p['stiffness'])}",
        "Structure between film and probes bends under the dynamic load. It stands in series with the whole bearing.",
        "Stiffness is short in the stiff direction, most at high load; a probe elsewhere on the housing disagrees.",
        "the housing's stiffness and where the probes are fixed",
    ),
    "housing_mass": EffectWords(
        lambda p: (
            f"{amount(p['mass_error'], size=True)} {'more' if p['mass_error'].value > 0 else 'less'} move with the "
            "housing than stated"
        ),
        "The inertia of the housing is taken off the cells' force with its mass. An error in it grows with the "
        "frequency squared.",
        "Stiffness drifts with the excitation frequency like a mass does.",
        "what hangs on the housing: hoses, plates, cells",
    ),
    "fluid_inertia": EffectWords(
        lambda p: f"the oil moves along like a mass of {amount(p['added_mass'])}",
        "The film and the oil around it have inertia. The dynamic stiffness falls with the frequency squared.",
        "K falls with the excitation frequency, C does not.",
        "runs at two high frequencies",
    ),
    "probe_gain": EffectWords(
        lambda p: f"the probes read {_away(p['factor'], 'more', 'less')} than true",
        "Sensitivity of eddy-current probes depends on the target's steel. Stiffness, damping, positions and clearance "
        "are off by the same factor.",
        "The clearance polygon and all coefficients are off alike.",
        "the probes' calibration on this shaft",
    ),
    "loadcell_gain": EffectWords(
        lambda p: f"the load cells read {_away(p['factor'], 'more', 'less')} than true",
        "A wrong sensitivity, or a load path beside the cells, scales all forces. Stiffness and damping follow, "
        "positions do not.",
        "All coefficients are off alike; positions and clearance agree.",
        "the cells' calibration, and hoses or springs beside them",
    ),
    "loadcell_crosstalk": EffectWords(
        lambda p: f"the load cells hand {amount(p['fraction'])} of each force to the other axis",
        "Each cell also feels the force across it. The static load then seems to turn, and cross-coupled terms appear.",
        "The ratio of the measured load components changes with the load's direction.",
        "decoupling of the cells: load one axis and read the other",
    ),
    "probe_rotation": EffectWords(
        lambda p: f"the probes stand {amount(p['angle'])} off their stated angle",
        "Displacements are then resolved along wrong axes. Direct terms leak into the cross-coupled ones.",
        "The clearance polygon is turned against the pads.",
        "the angles of the probe holders",
    ),
    "channel_delay": EffectWords(
        lambda p: f"force comes {amount(p['delay'])} late against displacement",
        "A delay between the channels turns every phasor in proportion to the frequency. Stiffness passes into "
        "damping.",
        "Damping is off by K times the delay at all loads.",
        "filters and amplifiers of both sorts of channel",
    ),
}


def finding(name: str, parameters: Parameters) -> str:
    """Say what was found, in one clause with its size; an effect of one's own by its name."""
    words = WORDS.get(name)
    if words is not None:
        return words.finding(parameters)
    sizes = ", ".join(f"{key.replace('_', ' ')} {amount(value)}" for key, value in parameters.items())
    return f"{name.replace('_', ' ')}: {sizes}"
