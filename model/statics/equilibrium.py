"""Static equilibrium of a bearing: where the journal stands, and what the films are then."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from model.conditions import has_answer
from model.film.oil_state import Running
from model.statics.pad_film import PadFilm
from rigdata.arrays import FloatArray
from rigdata.problem import Condition


class Begun(NamedTuple):
    """Where the curves of its pads put a bearing: neighbours differ by nearly what they differ in here."""

    position: FloatArray  #: (2,): NaN where some pad has no curve.
    tilt: FloatArray  #: (n,): As of the equilibrium; of pads that carry nothing there NaN.
    deflection: FloatArray  #: (n,)
    temperature: FloatArray  #: (n, nt + 1, nz + 1)


@dataclass(frozen=True)
class Equilibrium:
    """A static solution."""

    position: FloatArray  #: (2,): Journal centre from the bearing centre [m].
    films: tuple[PadFilm, ...]
    iterations: int
    force_residual: float
    temperature_residual: float
    journal_temperature: float
    status: tuple[Condition, ...]
    running: Running  #: What every film runs with for itself.
    begun: Begun

    @property
    def converged(self) -> bool:
        """Whether the residuals are below the tolerances."""
        return has_answer(self.status)

    @property
    def mean_journal_temperature(self) -> float:
        """The journal's temperature, or where it takes no heat that of the films that carry, by area [degC].

        The oil's where it enters if none does.
        """
        if math.isfinite(self.journal_temperature):
            return self.journal_temperature
        carrying = [f for f in self.films if not f.idle]
        if not carrying:
            return self.films[0].inlet
        area = sum(float(f.grid.area.sum()) for f in carrying)
        return sum(float((f.grid.area * f.work.temperature).sum()) for f in carrying) / area
