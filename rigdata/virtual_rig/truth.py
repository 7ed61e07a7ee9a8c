"""What the rig really does: the physics that goes into a virtual campaign, as plain numbers and callables.

The generator never asks a bearing model (`rigdata` may not import one): whoever calls it hands in the dynamic
stiffness, the mean position, the temperatures and the pivot law, from a model or from thin air.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, Self

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigError, tables_beside
from rigdata.vector import directions

PointLaw = Callable[[OperatingPoint], Any]

_FIVE_PADS = tuple(np.radians([-90.0, -18.0, 54.0, 126.0, 198.0]).tolist())


class VirtualRigError(RigError):
    """The virtual rig was asked for something it cannot do; says what and what to do."""


def _with_tuples(entry: Any) -> Any:
    """Lists become tuples, as fields of frozen classes are."""
    if isinstance(entry, dict):
        return {key: _with_tuples(value) for key, value in entry.items()}
    return tuple(entry) if isinstance(entry, list) else entry


#: Tables of `paper_rig.toml`.
PAPER_RIG: dict[str, dict[str, Any]] = _with_tuples(tables_beside(__file__, "paper_rig.toml"))


@dataclass(frozen=True, repr=False)
class RigTruth:
    """The physics of one virtual test bearing."""

    stiffness: PointLaw
    position: PointLaw
    temperature: PointLaw
    pivot_deflection: Callable[[int, FloatArray], Any]
    pivot_angles: tuple[float, ...] = _FIVE_PADS
    clearance: tuple[float, ...] = (80e-6,) * 5
    bearing_name: str = "bearing.toml"
    bearing_text: str = ""
    cold_temperature: float = 24.0

    @classmethod
    def constant(cls, k: Any, c: Any, pivot_stiffness: float | Sequence[float] = 6e8, **fields: Any) -> Self:
        """Make a truth with one K and C at all points: a linear bearing."""
        stiffness = np.array(k, dtype=float)
        damping = np.array(c, dtype=float)
        angles = fields.get("pivot_angles", _FIVE_PADS)
        pivots = np.broadcast_to(np.asarray(pivot_stiffness, dtype=float), (len(angles),))
        linear: dict[str, Any] = {
            "stiffness": lambda point: stiffness + 1j * point.excitation * damping,
            "position": lambda point: np.linalg.solve(stiffness, load_vector(point)),
            "temperature": lambda point: np.full(len(angles), 45.0 + point.static_load / 2e3),
            "pivot_deflection": lambda pad, load: load / pivots[pad - 1],
            "clearance": (80e-6,) * len(angles),
            "bearing_text": 'schema = "tpjb-bearing/1"\nname = "linear test bearing"\n',
        }
        return cls(**linear | fields)

    @property
    def cold_temperatures(self) -> FloatArray:
        """Of all pads at rest, (n_pads,) [degC]."""
        return np.full(len(self.pivot_angles), self.cold_temperature)

    def deflection(self, pad: int, load: FloatArray) -> FloatArray:
        """Pivot deflection of `pad` (1 is pad #1) under `load` (n,) [N] -> (n,) [m]; 0 where it lifts off."""
        return np.asarray(self.pivot_deflection(pad, np.maximum(load, 0.0)))


def load_vector(point: OperatingPoint) -> FloatArray:
    """Static load of a point as (2,) [N]: what pushes the shaft, and what the film puts on the housing."""
    return point.static_load * directions(point.static_load_direction)


def hz(frequency: float) -> float:
    """Frequency in Hz as rad/s."""
    return 2 * pi * frequency


def point_facts(point: OperatingPoint, position: FloatArray) -> dict[str, object]:
    """A point and the shaft's mean position there, as the truth files write them."""
    x, y = position.tolist()
    return {
        "static_load_N": point.static_load,
        "static_load_direction_deg": point.static_load_direction_deg,
        "shaft_speed_Hz": point.shaft_speed_hz,
        "x_m": x,
        "y_m": y,
    }
