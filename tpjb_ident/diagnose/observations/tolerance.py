"""What the model is trusted to, stated: one standard deviation of every kind of number a model predicts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerance:
    """Stated model tolerances of `outputs.md`, one standard deviation: the sigma in which the gap is told.

    How much of it a campaign really needs is learnt (`search.assessment`); what is needed beyond it is a remainder.

    Attributes
    ----------
    stiffness : float
        Share of a point's mean direct coefficient, for k and omega c.
    position : float
        [m]
    temperature : float
        [K]
    dry : float
        Of a dry compliance, relative.
    angle : float
        Of a polygon side [rad].
    load : float
        Of the cells' mean reading against the set point, relative and [rad].
    idle_temperature : float
        Of the film on a pad that hardly carries [K]: two attitudes fit it, and programs choose differently.
    load_miss, direction_miss : float
        Scatter of the actual static load about its set point, relative and [rad].
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
