"""What is kept of a run once its record has been read."""

from __future__ import annotations

from dataclasses import dataclass, field

from tpjb_ident.check.observation import Observation
from tpjb_ident.dynamic.records.run_data import RunPhasors


@dataclass(frozen=True)
class RunResult:
    """Phasors and temperatures of a run.

    Attributes
    ----------
    phasors : RunPhasors
    temperatures : dict of int to float
        Mean per pad [K].
    seen : tuple of Observation
        What the checks need of it, one for every excitation; none of what is not read from a file.
    """

    phasors: RunPhasors
    temperatures: dict[int, float]
    seen: tuple[Observation, ...] = field(default=(), repr=False)
