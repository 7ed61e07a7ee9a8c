"""What a prediction holds: coefficients, position, fields, flows, and how far it can be trusted."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from model.bearing import ROTATIONS
from model.dynamics import PadMatrices, pad_matrices
from model.setup import Setup
from model.statics.conditions import largest_reynolds
from model.statics.equilibrium import Equilibrium
from model.statics.pad_film import PadFilm
from model.statics.pad_flow import PadFlow, pad_flow, power_loss
from rigdata.arrays import ComplexArray, FloatArray
from rigdata.problem import Condition

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Prediction:
    """What the model says about one operating point, as the records would show it.

    Measurement-side effects are in `h`, `position` and `load_reading`; `bearing_h` and `bearing_position` are
    free of them.

    Attributes
    ----------
    load, load_direction : float
        Static load [N] and where it pushes the shaft [rad].
    speed : float
        [rad/s]
    rotation : {"counter-clockwise", "clockwise"}
        Which way the shaft turns.
    excitation : float or (n,) ndarray
        [rad/s]
    h : (2, 2) or (n, 2, 2) complex ndarray
        Dynamic stiffness k + i omega c [N/m].
    position : (2,) ndarray
        Journal from the bearing centre [m].
    tilt, deflection, pad_load : (n_pads,) ndarray
        [rad] (counter-clockwise), [m], [N]
    status : tuple of Condition
        Named conditions, which compare and print like strings; empty when all is well.
    equilibrium : Equilibrium
        In the frame where the shaft turns counter-clockwise, see `model.mirror`.
    setup : Setup
    solver : callable
        `model.predict.predict_setup`, which made it: a coarser mesh is solved with the same.

    Examples
    --------
    >>> p = ti.predict(rocker, load=5000.0, speed=2 * np.pi * 22, excitation=2 * np.pi * np.array([25.0, 50.0]))
    >>> p.k.shape, p.converged
    ((2, 2, 2), True)
    """

    load: float
    load_direction: float
    speed: float
    rotation: str
    excitation: float | FloatArray
    h: ComplexArray
    bearing_h: ComplexArray = field(repr=False)
    position: FloatArray
    bearing_position: FloatArray = field(repr=False)
    load_reading: FloatArray = field(repr=False)
    tilt: FloatArray = field(repr=False)
    deflection: FloatArray = field(repr=False)
    pad_load: FloatArray
    status: tuple[Condition, ...]
    equilibrium: Equilibrium = field(repr=False)
    setup: Setup = field(repr=False)
    solver: Callable[..., Prediction] = field(repr=False, compare=False)

    def __str__(self) -> str:
        x, y = np.round(1e6 * self.position, 4) + 0.0  # a thousandth of a nanometre is none
        return (
            f"{self.load:g} N at {math.degrees(self.load_direction):.4g} deg, {self.speed / math.tau:.4g} Hz: "
            f"shaft at ({x:.4g}, {y:.4g}) um, thinnest film {1e6 * self.min_film:.3g} um, "
            f"hottest {self.max_temperature:.4g} degC; {', '.join(self.status) or 'all well'}"
        )

    def __repr__(self) -> str:
        return f"<Prediction {self.summary()}>"

    @property
    def _films(self) -> tuple[PadFilm, ...]:
        return self.equilibrium.films

    @property
    def _frequencies(self) -> FloatArray:
        return np.atleast_1d(np.asarray(self.excitation, float)) / math.tau

    def summary(self) -> str:
        """Operating point, direct coefficients in MN/m and kN s/m, position and extremes, in one line."""
        lines = self._frequencies
        kxx, kyy = np.diagonal(self.k.reshape(-1, 2, 2)[0]) / 1e6
        cxx, cyy = np.diagonal(self.c.reshape(-1, 2, 2)[0]) / 1e3
        addition = f" and at {len(lines) - 1} more" if len(lines) > 1 else ""
        return (
            f"{self}; at {lines[0]:.4g} Hz{addition}: kxx {kxx:.4g}, kyy {kyy:.4g} MN/m, "
            f"cxx {cxx:.4g}, cyy {cyy:.4g} kN s/m"
        )

    def _scaled(self) -> pd.DataFrame:
        """Coefficients over the excitation frequency, MN/m and kN s/m, headed with their units."""
        table = self.to_dataframe()
        scaled = table[["excitation_Hz"]].rename(columns={"excitation_Hz": "excitation, Hz"})
        for column in table.columns[5:13]:
            scale, unit = (1e6, "MN/m") if column[0] == "k" else (1e3, "kN s/m")
            scaled[f"{column[:3]}, {unit}"] = table[column] / scale
        return scaled

    def _repr_html_(self) -> str:
        """Coefficients over the excitation frequency, for a notebook."""
        return f"<p>{self}</p>{self._scaled().to_html(index=False, float_format='{:.4g}'.format)}"

    def to_dataframe(self) -> pd.DataFrame:
        """One row per excitation frequency: point, K, C, position, conditions; SI, names as in prediction.csv."""
        import pandas as pd

        table = {
            "static_load_N": self.load,
            "static_load_direction_deg": math.degrees(self.load_direction),
            "shaft_speed_Hz": self.speed / math.tau,
            "rotation": self.rotation,
            "excitation_Hz": self._frequencies,
        }
        for values, kind, unit in ((self.k, "k", "N_per_m"), (self.c, "c", "Ns_per_m")):
            for at, column in zip(("xx", "xy", "yx", "yy"), values.reshape(-1, 4).T, strict=True):
                table[f"{kind}{at}_{unit}"] = column
        x, y = self.position
        return pd.DataFrame(table | {"x_m": x, "y_m": y, "status": "; ".join(self.status)})

    def plot(self) -> Any:
        """Stiffness above damping over the excitation frequency, drawn by pandas.

        Returns
        -------
        matplotlib.figure.Figure
        """
        table = self._scaled()
        groups = [tuple(table.columns[1:5]), tuple(table.columns[5:])]
        axes = table.plot(x="excitation, Hz", subplots=groups, style="o-", grid=True, figsize=(7, 6))
        for axis in axes:
            axis.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
        return axes[0].figure

    @property
    def converged(self) -> bool:
        """Whether the equilibrium was found."""
        return self.equilibrium.converged

    @property
    def idle_pads(self) -> tuple[int, ...]:
        """Pads without a loaded attitude, numbers from 1."""
        return tuple(f.number for f in self._films if f.idle)

    @property
    def k(self) -> FloatArray:
        """Re h [N/m], shape of `h`."""
        return self.h.real

    @property
    def c(self) -> FloatArray:
        """Im h / omega [N s/m], shape of `h`."""
        return self.h.imag / np.asarray(self.excitation, float)[..., None, None]

    def __getattr__(self, name: str) -> Any:
        if len(name) == 3 and name[0] in "kc" and set(name[1:]) <= {"x", "y"}:
            table = self.k if name[0] == "k" else self.c
            value = table[..., "xy".index(name[1]), "xy".index(name[2])]
            return float(value) if value.ndim == 0 else value
        raise AttributeError(f"Prediction has no attribute {name!r}")

    @property
    def axial_tilt(self) -> FloatArray:
        """Of pads about the axis across them, ends at positive z outward (`Options.axial_tilt`); idle ones 0 [rad]."""
        return np.array([0.0 if f.idle else f.axial for f in self._films])

    @property
    def pressure(self) -> tuple[FloatArray, ...]:
        """Per pad, (nt + 1, nz + 1) on the half width (full if misaligned) [Pa]."""
        return tuple(f.work.pressure for f in self._films)

    @property
    def film(self) -> tuple[FloatArray, ...]:
        """Film thickness per pad [m], shapes as `pressure`."""
        return tuple(f.work.thickness for f in self._films)

    @property
    def temperature(self) -> tuple[FloatArray, ...]:
        """Film temperature per pad [degC], shapes as `pressure`."""
        return tuple(f.work.temperature for f in self._films)

    @property
    def max_pressure(self) -> float:
        """Highest film pressure [Pa]."""
        return max(float(p.max()) for p in self.pressure)

    @property
    def max_temperature(self) -> float:
        """Hottest film of a pad that carries [degC], anywhere across it."""
        return max((f.hottest for f in self._films if not f.idle), default=self.setup.inlet_temperature)

    @property
    def min_film(self) -> float:
        """Thinnest film [m]; infinite if no pad carries."""
        return min((float(f.work.thickness.min()) for f in self._films if not f.idle), default=math.inf)

    @property
    def face_temperature(self) -> tuple[FloatArray, ...]:
        """Temperature of the pads' faces [degC], shapes as `temperature`.

        The film's own, unless it has temperatures across (`thd`), or the journal takes part: then the parabola across
        the film that passes its heat, flat at the pad, is hotter there by half of what the mean is hotter than the
        journal.
        """
        journal = self.equilibrium.journal_temperature
        if not math.isfinite(journal) or self.setup.thermal == "thd":
            return tuple(f.face_temperature for f in self._films)
        return tuple(t + 0.5 * (t - journal) for t in self.temperature)

    @functools.cached_property
    def pad_flow(self) -> tuple[PadFlow, ...]:
        """Per pad: oil in, out and over the sides [m^3/s], temperatures in and out [degC]."""
        return tuple(pad_flow(f, self.setup.bearing.oil) for f in self._films)

    @property
    def reynolds(self) -> float:
        """Largest local Reynolds number rho U h / mu of all films."""
        return largest_reynolds(self._films, self.speed * self.setup.bearing.journal_radius)

    @property
    def sommerfeld(self) -> float:
        """S = mu N D L / W (R / Cb)^2, N in rev/s, mu of the oil that enters, Cb the mean of the pads."""
        bearing, clearance = self.setup.bearing, self._clearance
        viscosity = float(bearing.oil.viscosity(self.setup.inlet_temperature))
        size = viscosity * self.speed / math.tau * bearing.journal_diameter * bearing.length
        return size * (bearing.journal_radius / clearance) ** 2 / self.load if self.load > 0.0 else math.inf

    @property
    def eccentricity_ratio(self) -> float:
        """Distance of the journal from the bearing centre over the mean Cb."""
        return math.hypot(*self.bearing_position) / self._clearance

    @property
    def attitude_angle(self) -> float:
        """Angle from the load's direction to that of the journal [rad], positive with rotation, within +-pi."""
        x, y = self.bearing_position
        return (self._sense * (math.atan2(y, x) - self.load_direction) + math.pi) % math.tau - math.pi

    @property
    def _sense(self) -> float:
        """Of the speed about +z."""
        return -1.0 if self.rotation == ROTATIONS[1] else 1.0

    @property
    def _clearance(self) -> float:
        clearances = self.setup.bearing.clearances
        return sum(clearances) / len(clearances) + self.setup.clearance_change

    @property
    def power_loss(self) -> float:
        """Shear of all films, those of idle pads too [W]."""
        turbulent = self.setup.options.turbulence != "none"
        return power_loss(self._films, self.speed * self.setup.bearing.journal_radius, turbulent)

    def pad_temperature(self, fraction: float = 0.75) -> FloatArray:
        """Film temperature at mid-length, at a fraction of the arc from the leading edge, per pad [degC].

        With temperatures across the film (`thd`) the pad's face, where thermocouples are.

        Parameters
        ----------
        fraction : float
            Of the arc, from the leading edge.

        Returns
        -------
        (n_pads,) ndarray
            [degC]
        """
        return np.array([film.temperature_at(fraction) for film in self._films])

    @property
    def pad_matrices(self) -> tuple[PadMatrices, ...]:
        """Full matrices of the pads that carry, Eq. (11) and (12), in the frame of `equilibrium`."""
        return tuple(PadMatrices(*parts) for parts in zip(*pad_matrices(self.setup, self._films)))

    @functools.cached_property
    def mesh_error(self) -> float:
        """Estimated relative error of the direct coefficients from the mesh.

        A third of the difference to a mesh half as fine (second order), the largest of kxx, kyy, cxx, cyy. Solved
        when first asked for.
        """
        coarse = self.solver(
            self.setup.change(mesh=self.setup.mesh.coarser()),
            self.load, self.load_direction, self._sense * self.speed, self.excitation,
        )  # fmt: skip
        if not (coarse.converged and self.converged):
            return math.nan
        fine, rough = (np.diagonal(p.bearing_h, axis1=-2, axis2=-1) for p in (self, coarse))
        change = np.abs([(fine - rough).real, (fine - rough).imag])
        return float(np.max(change / np.maximum(np.abs([fine.real, fine.imag]), 0.05 * np.abs(fine)))) / 3.0
