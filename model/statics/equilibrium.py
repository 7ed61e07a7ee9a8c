"""Static equilibrium of a bearing: where the journal stands, and what the films are then."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from model.conditions import has_answer
from model.film.oil_state import Running
from model.statics.pad_film import PadFilm
from rigdata.arrays import BoolArray, FloatArray
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
    journal_temperature: float
    grown: float  #: Temperature of a journal that grows [degC], see `SearchState.figures`.
    status: tuple[Condition, ...]
    running: Running  #: What every film runs with for itself.
    begun: Begun
    loose: tuple[bool, ...] = ()  #: Which pads idle clearly above their folds.

    @property
    def idle(self) -> BoolArray:
        """Which pads carry nothing, (n,)."""
        return np.array([film.idle for film in self.films])

    @property
    def converged(self) -> bool:
        """Whether the residuals are below the tolerances."""
        return has_answer(self.status)
