"""What the model is trusted to, stated: tolerances of single elements, and what all elements share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerance:
    """Tolerances, one standard deviation.

    The first group is the stated model tolerance of `outputs.md`, in which the gap is expressed. The ``fine_``
    group is used for inference: two independent programs with the same physics agree point by point far better
    than they agree overall, so the difference is split into a small part per element and coherent parts shared
    by all elements (`nuisance.py`).

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
    fine_stiffness, fine_position, fine_temperature, fine_dry, fine_angle : float
        Of single elements. Two programs that solve the equations of `physics.md` were found to differ by 0.05 % in
        the direct coefficients (at the most 0.2 %), 0.02 um and 0.005 K; these are about twice as much.
    idle_temperature : float
        Of the film on a pad that hardly carries [K]: two attitudes fit it, and programs choose differently.
    shape : float
        Of what an effect does, relative: two programs build the same effect a little differently. A fit is only
        refused for what it leaves beyond this.
    load_miss, direction_miss : float
        Scatter of the actual static load about its set point, relative and [rad].
    """

    stiffness: float = 0.015
    position: float = 0.5e-6
    temperature: float = 0.5
    dry: float = 0.02
    angle: float = 0.003
    fine_stiffness: float = 0.001
    fine_position: float = 0.05e-6
    fine_temperature: float = 0.03
    fine_dry: float = 0.002
    fine_angle: float = 0.0003
    idle_temperature: float = 1.0
    shape: float = 0.02
    load_miss: float = 0.003
    direction_miss: float = 0.0035

    @classmethod
    def scaled(cls, stiffness: float) -> Tolerance:
        """Return the default tolerances with another one for stiffness, its fine part in proportion."""
        return cls(stiffness=stiffness, fine_stiffness=stiffness / 15.0)
