"""The bearing as a drawing gives it: journal, pads, pivots, oil. `model.bearing_file` reads one."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass, field, replace
from typing import Any

from model.errors import ModelError


class BearingError(ModelError):
    """A bearing file or definition that cannot be used; says file, key, what and cure."""


@dataclass(frozen=True)
class Material:
    """Isotropic pad material (paper, Table 1)."""

    youngs_modulus: float
    poissons_ratio: float
    thermal_expansion: float
    conductivity: float


#: Senses in which a shaft turns, with X to the right and Y up; the first is the default.
ROTATIONS = ("counter-clockwise", "clockwise")
STEEL = Material(206e9, 0.3, 12e-6, 54.0)
BABBITT = Material(40e9, 0.3, 24e-6, 26.0)


@dataclass(frozen=True)
class Oil:
    """Lubricant, Eq. (4) and (5).

    Attributes
    ----------
    viscosity_40 : float
        Dynamic viscosity at 40 degC [Pa s].
    viscosity_exponent : float
        kappa in mu(T) = mu_40 exp(kappa (40 - T)) [1/K].
    density_40 : float
        [kg/m^3]
    thermal_expansion : float
        alpha_v in rho(T) = rho_40 (1 + alpha_v (40 - T)) [1/K].
    specific_heat : float
        [J/kg/K]
    conductivity : float
        [W/m/K]
    supply_temperature : float
        [degC]
    grade : str
    supply_flow : float
        To the whole bearing, a share alike to every groove [m^3/s]; infinite: as much as the films take.
    """

    viscosity_40: float
    viscosity_exponent: float
    density_40: float
    thermal_expansion: float
    specific_heat: float
    conductivity: float
    supply_temperature: float
    grade: str = ""
    supply_flow: float = math.inf

    def viscosity(self, temperature: Any) -> Any:
        """mu(T) [Pa s], Eq. (4); temperature in degC, scalar or array.

        Parameters
        ----------
        temperature : float or ndarray
            [degC]

        Returns
        -------
        float or ndarray
        """
        import numpy as np

        return self.viscosity_40 * np.exp(self.viscosity_exponent * (40.0 - temperature))

    def density(self, temperature: Any) -> Any:
        """rho(T) [kg/m^3], Eq. (5); temperature in degC, scalar or array.

        Parameters
        ----------
        temperature : float or ndarray
            [degC]

        Returns
        -------
        float or ndarray
        """
        return self.density_40 * (1.0 + self.thermal_expansion * (40.0 - temperature))


@dataclass(frozen=True)
class Pad:
    """One pad.

    Attributes
    ----------
    pivot_angle : float
        [rad], counter-clockwise from +X.
    arc : float
        Angular amplitude [rad].
    pivot_offset : float
        Pivot position / arc, from the leading edge (0.5: centrally pivoted).
    pad_clearance : float
        Cp, radial machined clearance: pad radius - journal radius [m].
    assembled_clearance : float
        Cb, radial assembled clearance of this pad [m].
    thickness : float
        Radial, backing and babbitt (and pivot, if the drawing says so) [m].
    babbitt_thickness : float
        [m]
    elastic_thickness : float
        The part of `thickness` that bends [m].
    mass : float
        [kg]
    moment_of_inertia : float
        About the pivot [kg m^2].
    back_convection : float
        Film coefficient on the pad's free surfaces [W/m^2/K].
    leading_edge_pressure : float
        Of the oil in the groove at the leading edge [Pa].
    backing, babbitt : Material
    pivot : Pivot, optional
        Where the bearing's pivots differ.
    """

    pivot_angle: float
    arc: float
    pivot_offset: float
    pad_clearance: float
    assembled_clearance: float
    thickness: float
    babbitt_thickness: float
    elastic_thickness: float
    mass: float
    moment_of_inertia: float
    back_convection: float = 50.0
    leading_edge_pressure: float = 0.0
    backing: Material = STEEL
    babbitt: Material = BABBITT
    pivot: Pivot | None = None

    def __str__(self) -> str:
        return (
            f"pad at {math.degrees(self.pivot_angle):.4g} deg, {math.degrees(self.arc):.4g} deg of arc, "
            f"Cb {1e6 * self.assembled_clearance:.4g} um, preload {self.preload:.3g}"
        )

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self}>"

    @property
    def normal(self) -> tuple[float, float]:
        """Unit vector from the bearing centre to the pivot."""
        return math.cos(self.pivot_angle), math.sin(self.pivot_angle)

    @property
    def leading_edge(self) -> float:
        """Angle of the leading edge from the pivot [rad], negative: the film enters there."""
        return -self.pivot_offset * self.arc

    @property
    def preload(self) -> float:
        """M = 1 - Cb / Cp."""
        return 1.0 - self.assembled_clearance / self.pad_clearance


@dataclass(frozen=True)
class Pivot:
    """Contact geometry of the pivots (paper, Table 3), for the printed formulas."""

    kind: str = "rigid"
    youngs_modulus: float = 206e9
    poissons_ratio: float = 0.3
    contact_length: float = math.nan
    housing_diameter: float = math.nan
    pivot_diameter: float = math.nan
    sphere_diameter: float = math.nan


@dataclass(frozen=True)
class Bearing:
    """A tilting-pad journal bearing.

    Attributes
    ----------
    name : str
    journal_diameter : float
        [m]
    length : float
        Axial pad length [m].
    pads : tuple of Pad
        Pad #1 first.
    pivot : Pivot
    oil : Oil
    rotation : str
        Sense of turning that the drawing states, ``"counter-clockwise"`` or ``"clockwise"``: a pad's leading edge is
        where that shaft comes from. Empty: either, the edge is where the shaft comes from.
    tolerances : tuple of (str, float)
        Name and value of every line of ``[tolerances]``: how well the drawing is known, one standard deviation, SI.

    Examples
    --------
    >>> bearing = ti.load_bearing(rocker)
    >>> bearing.name, len(bearing.pads), f"{bearing.pads[0].preload:.2f}"
    ('Rocker-backed five-pad bearing', 5, '0.38')
    """

    name: str
    journal_diameter: float
    length: float
    pads: tuple[Pad, ...]
    pivot: Pivot
    oil: Oil
    rotation: str = ""
    source: str = field(default="", compare=False)
    tolerances: tuple[tuple[str, float], ...] = field(default=(), compare=False)

    @property
    def journal_radius(self) -> float:
        """R [m]."""
        return 0.5 * self.journal_diameter

    def pivot_of(self, pad: Pad) -> Pivot:
        """Return the pivot of a pad: its own, or the one that all have.

        Parameters
        ----------
        pad : Pad

        Returns
        -------
        Pivot
        """
        return pad.pivot or self.pivot

    @property
    def like_pivots(self) -> bool:
        """Whether all pads have one kind and size of pivot."""
        return all(pad.pivot in (None, self.pivot) for pad in self.pads)

    @property
    def pivot_angles(self) -> tuple[float, ...]:
        """Direction of every pad's pivot [rad]."""
        return tuple(pad.pivot_angle for pad in self.pads)

    @property
    def clearances(self) -> tuple[float, ...]:
        """Assembled clearance Cb of every pad [m]."""
        return tuple(pad.assembled_clearance for pad in self.pads)

    def pivot_radius(self, pad: Pad) -> float:
        """R_P = journal radius + Cp + pad thickness [m] (docs/theory.md).

        Parameters
        ----------
        pad : Pad

        Returns
        -------
        float
        """
        return self.journal_radius + pad.pad_clearance + pad.thickness

    def __str__(self) -> str:
        first = self.pads[0] if self.pads else None
        sizes = f", Cb {1e6 * first.assembled_clearance:.4g} um, preload {first.preload:.3g} (pad #1)" if first else ""
        return (
            f"{self.name}: {len(self.pads)} pads, {1e3 * self.journal_diameter:.6g} x {1e3 * self.length:.6g} mm{sizes}"
            f", {self.pivot.kind} pivots, oil {self.oil.grade or 'unnamed'} at {self.oil.supply_temperature:g} degC"
        )

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self}>"

    def _repr_html_(self) -> str:
        """In a notebook: what it is, and its pads by number."""
        pads = "".join(f"<li>{html.escape(str(pad))}</li>" for pad in self.pads)
        return f"<p>{html.escape(str(self))}</p><ol>{pads}</ol>"

    def with_pads(self, pads: tuple[Pad, ...]) -> Bearing:
        """Return a copy with other pads.

        Parameters
        ----------
        pads : tuple of Pad
            Pad #1 first.

        Returns
        -------
        Bearing
        """
        return replace(self, pads=pads)


def pad_rooms(bearing: Bearing) -> list[tuple[int, int, float]]:
    """Every pad, the next one counter-clockwise (numbers from 1), and the angle from its edge to the other's [rad]."""
    edges = []
    for number, pad in enumerate(bearing.pads, start=1):
        share = 1.0 - pad.pivot_offset if bearing.rotation == ROTATIONS[1] else pad.pivot_offset
        edges.append(((pad.pivot_angle - share * pad.arc) % math.tau, number))
    edges.sort()
    rooms = []
    for (start, number), (following, neighbour) in zip(edges, edges[1:] + edges[:1], strict=True):
        rooms.append((number, neighbour, (following - start) % math.tau if neighbour != number else math.tau))
    return rooms
