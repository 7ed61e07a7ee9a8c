"""What is kept of a run once its record has been read."""

from __future__ import annotations

from dataclasses import dataclass

from tpjb_ident.dynamic.records.run_data import RunPhasors


@dataclass(frozen=True)
class RunResult:
    """Phasors and temperatures of a run.

    Attributes
    ----------
    phasors : RunPhasors
    temperatures : dict of int to float
        Mean per pad [K].
    """

    phasors: RunPhasors
    temperatures: dict[int, float]
