"""What the model is trusted to, stated: one standard deviation of every kind of number a model predicts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerance:
    """Stated model tolerances of `outputs.md`, one standard deviation: the sigma in which the gap is told.

    How much of it a campaign really needs is learnt (`search.assessment`); what is needed beyond it is a remainder.
    """

    stiffness: float = 0.015
    position: float = 0.5e-6
    temperature: float = 0.5
    dry: float = 0.02
    angle: float = 0.003
    load: float = 0.003
    idle_temperature: float = 1.0
    load_miss: float = 0.003
    direction_miss: float = 0.0035
