"""What one search is told, and all that it works on."""

from typing import NamedTuple

from model.compilation import inner
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import Running
from model.statics.compiled.stack import BodyStack, PadStack, SearchState, grid_of, work_of
from model.tilt_hold import HoldNumbers
from rigdata.arrays import FloatArray

#: `Case.thermal`: films as cold as their inlets, each for itself, all with pads, journal and grooves, and the same
#: with temperatures across the films, which a step in Python finds.
ISOTHERMAL, ALONE, COUPLED, ACROSS = range(4)
#: Largest change of a film temperature in one step [K]: a turbine oil (0.034 1/K) loses 40 % of its viscosity.
HEATING_STEP = 15.0
#: Weight of a temperature change against a share of the load [K]: film temperatures count as settled when one more step
#: would change them by this times `Setup.accuracy`, 3e-5 K as a rule. That is 1e-6 of the viscosity, and of that the
#: step leaves a tenth.
HEAT_PER_FORCE = 300.0


class Case(NamedTuple):
    """The numbers of one search."""

    load: FloatArray  #: (2,), N
    running: Running
    hold: HoldNumbers
    accuracy: float
    thermal: int
    rupture: int | None  #: One of `model.film.models.FILM_MODELS`; None: a search of plain films and rigid pads alone.
    supply: float  #: Temperature of fresh oil [degC].
    heat_share: float  #: Share of the dissipation that stays in the films; in `running.heat` where films are alone.
    mixing: float  #: lambda
    journal: bool  #: It takes up heat and gives it back.
    closing: float  #: What a kelvin of the journal's takes from every clearance [m/K].
    axial: bool  #: Pads tilt along the shaft.
    fresh: float  #: What a groove gives of fresh oil [kg/s/m].
    length: float  #: Of the pads [m].
    asks_laws: bool  #: Some pivots have laws that only Python knows.


class Problem(NamedTuple):
    """All that a search works on."""

    grids: FilmGrid
    bodies: BodyStack | None  #: None: rigid pads and films for themselves, a search without those loops.
    pads: PadStack
    works: FilmWork
    state: SearchState
    case: Case


@inner
def film_of(problem: Problem, m: int) -> tuple[FilmGrid, FilmWork]:
    """One pad's mesh, and its film's arrays."""
    return grid_of(problem.grids, m), work_of(problem.works, m)
