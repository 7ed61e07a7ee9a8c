"""The 2x2 complex dynamic stiffness of a bearing at one frequency, with everything known about it."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Conditions
from tpjb_ident.errors import ArgumentError
from tpjb_ident.estimate.arrowhead import real_numbers
from tpjb_ident.estimate.statistics import half_width
from tpjb_ident.rounding import with_interval
from tpjb_ident.schema import DAMPING, STIFFNESS

#: Order of the eight real unknowns everywhere: Re hxx, Re hxy, Re hyx, Re hyy, Im hxx, ...
ENTRIES = ("xx", "xy", "yx", "yy")


class Interval(NamedTuple):
    """Lower and upper bounds of the eight real entries, in the order of the covariance [N/m]."""

    lo: FloatArray
    hi: FloatArray


@dataclass(frozen=True)
class DynamicStiffness:
    """What one method says about one operating point.

    Attributes
    ----------
    h : (2, 2) complex ndarray
        Dynamic stiffness K + i omega C [N/m]; NaN when it could not be found (`status` says why).
    omega : float
        Excitation frequency [rad/s].
    covariance : (8, 8) ndarray
        Random covariance of [Re hxx, Re hxy, Re hyx, Re hyy, Im hxx, ...], in N^2/m^2.
    dof : (8,) ndarray
        Degrees of freedom of each variance, for Student's t; infinite where it is known.
    method : str
        ``"ols"``, ``"rlm"``, ``"mm"``, ``"mm-eiv"``, ``"iv"``; a norm after a colon.
    weights : (n, 2) ndarray
        Final robust weight per window and force axis.
    status : tuple of Condition
        Named conditions, empty when all is well.
    condition : float
        Condition number of the displacement directions.
    chi_square : float
        Reduced chi-square of the direction means about F = h D against the repeats' own noise; NaN
        without repeats.
    spare_equations : int
        Real equations of the direction means beyond the eight unknowns: degrees of freedom of the
        chi-square.
    attenuation : (2,) ndarray
        Share by which noise on the displacements would pull a plain regression of F on X towards
        zero, along the weaker displacement direction first; NaN when not known.
    systematic : (8, 8) ndarray
        Covariance from calibration, common to all points of a campaign.

    Examples
    --------
    >>> est = ti.estimate_dynamic_stiffness(1e-6 * np.eye(2), 300.0 * np.eye(2), 157.0, method="ols")
    >>> print(est.h[0, 0].real, est.k.shape)
    300000000.0 (2, 2)
    """

    h: ComplexArray
    omega: float
    covariance: FloatArray
    dof: FloatArray
    method: str
    weights: FloatArray
    status: Conditions = ()
    condition: float = np.nan
    chi_square: float = np.nan
    spare_equations: int = 0
    attenuation: FloatArray = field(default_factory=lambda: np.full(2, np.nan))
    systematic: FloatArray = field(default_factory=lambda: np.zeros((8, 8)))

    @property
    def direct(self) -> tuple[float, float]:
        """Mean size of the direct entries of Re h and of Im h [N/m]."""
        return float(np.mean(np.abs(np.diag(self.h.real)))), float(np.mean(np.abs(np.diag(self.h.imag))))

    @property
    def k(self) -> FloatArray:
        """Stiffness matrix Re h [N/m], shape (2, 2)."""
        return self.h.real

    @property
    def c(self) -> FloatArray:
        """Damping matrix Im h / omega [N s/m], shape (2, 2)."""
        return self.h.imag / self.omega

    @property
    def vector(self) -> FloatArray:
        """The eight real entries in the order of the covariance [N/m]."""
        return real_numbers(self.h)

    @property
    def standard_error(self) -> FloatArray:
        """Random standard error of the eight entries [N/m]."""
        return np.sqrt(np.diag(self.covariance))

    def half_width(self, level: float = 0.95, systematic: bool = True) -> FloatArray:
        """Half the width of the interval of the eight entries [N/m].

        Parameters
        ----------
        level : float
            Probability content, in (0, 1).
        systematic : bool
            Whether to add the calibration part (Gaussian) to the random one (Student's t).
        """
        if not 0.0 < level < 1.0:
            raise ArgumentError(f"level must lie in (0, 1), got {level}")
        shared = np.sqrt(np.diag(self.systematic)) if systematic else np.zeros(8)
        return half_width(level, self.standard_error, self.dof, shared)

    def interval(self, level: float = 0.95, systematic: bool = True) -> Interval:
        """Interval of the eight entries; see `half_width` for the arguments.

        Parameters
        ----------
        level : float
            Probability that the interval is to hold.
        systematic : bool
            Whether what does not scatter (calibration, axes, delays, ..) counts.

        Returns
        -------
        Interval
            Lower and upper bounds, shape (8,) each, real parts first [N/m].
        """
        half = self.half_width(level, systematic)
        return Interval(self.vector - half, self.vector + half)

    def figures(self) -> FloatArray:
        """Value, ends of the 95 % interval, standard errors and half widths, random and systematic ones, (8, 7)."""
        value, half, random = self.vector, self.half_width(), self.half_width(systematic=False)
        systematic = np.sqrt(np.maximum(half**2 - random**2, 0.0))
        errors = self.standard_error, np.sqrt(np.diag(self.systematic))
        return np.stack([value, value - half, value + half, *errors, random, systematic], axis=1)

    def direct_coefficients(self) -> str:
        """Direct coefficients with half their 95 % intervals, in MN/m and kN s/m."""
        cells, order = self.cells(), ((0, STIFFNESS), (4, DAMPING), (3, STIFFNESS), (7, DAMPING))
        return ", ".join(f"{kind.symbol}{ENTRIES[i % 4]} {cells[i]} {kind.display_unit}" for i, kind in order)

    def cells(self) -> list[str]:
        """Write kxx .. cyy with half their 95 % intervals, in the units of tables that people read."""
        cells = []
        for i, (value, half) in enumerate(zip(self.vector, self.half_width(), strict=True)):
            scale = STIFFNESS.display_scale if i < 4 else DAMPING.display_scale * self.omega
            cells.append(with_interval(value, value - half, value + half, scale))
        return cells

    def __repr__(self) -> str:
        at = f"at {self.omega / (2 * np.pi):.4g} Hz by {self.method}"
        return f"<DynamicStiffness {at}: {self.direct_coefficients()}>"

    def __str__(self) -> str:
        half = self.half_width()
        rows = [f"dynamic stiffness at {self.omega / (2 * np.pi):.4g} Hz, {self.method}"]
        for i, entry in enumerate(ENTRIES):
            k, c = (f"{self.vector[j] / s: .4e} +- {half[j] / s:.1e}" for j, s in ((i, 1.0), (i + 4, self.omega)))
            rows.append(f"  k{entry} {k} N/m    c{entry} {c} N s/m")
        return "\n".join([*rows, *(f"  {condition.sentence()}" for condition in self.status)])
