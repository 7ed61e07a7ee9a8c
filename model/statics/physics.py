"""Which physics a set-up asks for, as compiled searches take it: the case's numbers, bodies that bend and conduct."""

import math
from collections.abc import Sequence

import numpy as np

from model.film.models import FILM_MODELS, SWIFT_STIEBER
from model.film.oil_state import Running
from model.pad.pivot import OTHER
from model.pivots import encoded
from model.setup import Setup
from model.statics.compiled.bending import stacked_bodies
from model.statics.compiled.case import ACROSS, ALONE, COUPLED, ISOTHERMAL, Case
from model.statics.compiled.stack import BodyStack
from model.statics.pad_film import PadFilm, oil_constants, rupture_of
from model.tilt_hold import hold_numbers
from rigdata.arrays import FloatArray


def couples_heat(setup: Setup) -> bool:
    """Whether the films' temperatures depend on more than their own inlets."""
    return setup.thermal != "isothermal" and bool(
        setup.mixing or setup.options.conduction or setup.options.isothermal_journal
    )


def running_of(setup: Setup, surface_speed: float, heat: float) -> Running:
    """What every film runs with for itself; `heat` is the share of the heat that the films keep.

    What a share of the heat does, all of it does to oil that takes up more per kelvin.
    """
    oil, heat_share = setup.bearing.oil, (1.0 - setup.heat_loss) * heat
    specific = math.inf if setup.thermal == "isothermal" else oil.specific_heat / heat_share
    return Running(float(surface_speed), oil_constants(oil), (specific, oil.conductivity / heat_share))


def case_of(setup: Setup, load: FloatArray, running: Running, heat: float) -> Case:
    """The numbers of a search; `running` and `heat` as of `running_of`."""
    oil, growth, length = setup.bearing.oil, setup.growth, setup.bearing.length
    heat_share, supply = (1.0 - setup.heat_loss) * heat, float(setup.inlet_temperature)
    thermal = ISOTHERMAL if setup.thermal == "isothermal" else ALONE
    if couples_heat(setup):
        thermal = ACROSS if setup.thermal == "thd" else COUPLED
        running = running._replace(heat=(oil.specific_heat, oil.conductivity))
    model, bends = FILM_MODELS[rupture_of(setup)], setup.flexible_pads or setup.pads_follow
    plain = model == SWIFT_STIEBER and thermal in (ISOTHERMAL, ALONE) and not bends
    return Case(
        load=np.array(load, dtype=float),
        running=running,
        hold=hold_numbers(setup),
        accuracy=float(setup.accuracy),
        thermal=thermal,
        rupture=None if plain else model,
        supply=supply,
        heat_share=heat_share,
        mixing=float(setup.mixing),
        journal=bool(setup.options.isothermal_journal),
        closing=0.0 if growth is None else float(growth.closing(setup.bearing)),
        axial=setup.pads_follow,
        fresh=oil.supply_flow * float(oil.density(supply)) / len(setup.bearing.pads) / length,
        length=length,
        asks_laws=bool((encoded(setup.pivots)[0][:, 0] == OTHER).any()),
    )


def bodies_of(setup: Setup, case: Case, films: Sequence[PadFilm]) -> BodyStack | None:
    """The bodies of pads that bend or conduct; None for rigid pads whose plain films are for themselves."""
    if case.rupture is None:
        return None
    bodies = tuple(f.deformation for f in films if f.deformation is not None)
    factor = setup.bending_factor if setup.flexible_pads else 0.0
    conducting = case.thermal == ACROSS or (case.thermal == COUPLED and setup.options.conduction)
    return stacked_bodies(bodies, factor, conducting)
