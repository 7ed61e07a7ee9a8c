"""The measured curve of one pivot: load, deflection, tangent stiffness, each with its interval."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import integrate, special

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.columns import amount
from tpjb_ident.conditions import Conditions, sentences
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.dry_record import PadDirection
from tpjb_ident.pivot.law_fit import FRICTION, OFFSET, SCALE, LawFit
from tpjb_ident.presentation import Presented
from tpjb_ident.rounding import with_interval
from tpjb_ident.schema import STIFFNESS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Hysteresis:
    """Loop of one load cycle.

    Attributes
    ----------
    energy, energy_se : float
        Area between the branches [J] over the loads that both cover.
    loss_factor, loss_factor_se : float
        energy / (pi dF dx / 4), with dF and dx the ranges of load and deflection of the loop: for an
        elliptic loop the tangent of the loss angle.
    load_range : (float, float)
        Loads that both branches cover [N].
    """

    energy: float
    energy_se: float
    loss_factor: float
    loss_factor_se: float
    load_range: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.load_range
        return (
            f"loop from {low:.0f} to {high:.0f} N: {self.energy:.3g} J (se {self.energy_se:.1g}), "
            f"loss factor {self.loss_factor:.3g} (se {self.loss_factor_se:.1g})"
        )


def measure_loop(law: LawFit, low: float, high: float) -> Hysteresis | None:
    """Area between the readings of a fit while loading and while unloading, from load to load [N].

    The fit knows drift from friction by what goes on within the holds, while an area between the steps themselves
    takes every drift from the way up to the way down for a loss.
    """
    load = np.linspace(low, high, 200)
    up, up_gradient = law.reading_gradient(load, np.ones(len(load)))
    down, down_gradient = law.reading_gradient(load, -np.ones(len(load)))
    stored = math.pi / 4.0 * (high - low) * abs(up[-1] - up[0])
    if not high > low or stored == 0.0:
        return None
    energy = float(integrate.trapezoid(down - up, load))
    sensitivity = integrate.trapezoid(down_gradient - up_gradient, load, axis=0)
    energy_se = math.sqrt(max(sensitivity @ law.covariance @ sensitivity, 0.0))
    return Hysteresis(energy, energy_se, energy / stored, energy_se / stored, (low, high))


EXTRAPOLATION_SPREAD = 0.04  # of ln(stiffness) per e-fold of load beyond the points: no law is quite the pivot's own


@dataclass(frozen=True)
class PivotSteps:
    """Settled means of the holds of a test (of all blocks, where the load never stood still).

    Attributes
    ----------
    load : (n,) ndarray
        Along the pad [N], what friction holds back taken off.
    deflection, deflection_se : (n,) ndarray
        From zero load [m]; the standard error is that of the mean about the run's own level.
    across_load, across_deflection : (n,) ndarray
        Components across the pad [N], [m].
    branch : (n,) ndarray of int
        +1 loading, -1 unloading.
    weight : (n,) ndarray
        1 used, 0 left out as a bad step.
    """

    load: FloatArray
    deflection: FloatArray
    deflection_se: FloatArray
    across_load: FloatArray
    across_deflection: FloatArray
    branch: IntArray
    weight: FloatArray

    def __len__(self) -> int:
        return len(self.load)


@dataclass(frozen=True, repr=False)
class PivotCurve(Presented):
    """Load-deflection curve of one pad's pivot, housing included.

    The displacement is measured between shaft and housing, so pivot, pad back and housing seat all deflect:
    `includes_housing` is True, and no further housing compliance may be put in series with this curve.

    The curve is that of the most likely law; the intervals also hold the spread of the other likely laws
    about it.

    Attributes
    ----------
    pad : int
        Number, from 1.
    angle : float
        Direction of the pad [rad].
    steps : PivotSteps
        The points.
    fits : tuple of LawFit
        Likely laws, most likely first.
    weights : (n,) ndarray
        Their posterior shares.
    onset_load : float
        The shaft is fully in contact from here on [N]; zero where no contact loss was seen.
    onset_load_se : float
        Its standard error [N].
    valid_from, valid_to : float
        Loads between which the curve was measured with full contact [N].
    load_direction, displacement_direction : PadDirection
        Fitted directions, relative to the pad.
    hysteresis : Hysteresis or None
        Loop of loading and unloading, where both were recorded.
    relative_calibration : float
        Standard uncertainty of the stiffness from probe and cell certificates and from what a sweep shows of them,
        relative. The bands hold it; standard errors do not, because what the same channels measure shares it.
    status : tuple of Condition
        Named conditions; empty when all is well.
    runs : tuple of str
        Where it came from.

    Examples
    --------
    >>> pads = ti.load_bearing(rocker).pads
    >>> curve = ti.fit_pivots(ti.load_campaign(demo), [pad.pivot_angle for pad in pads])[0]
    >>> curve.stiffness([1000.0, 2000.0]).shape
    (2,)
    """

    pad: int
    angle: float
    steps: PivotSteps
    fits: tuple[LawFit, ...]
    weights: FloatArray = field(repr=False)
    onset_load: float
    onset_load_se: float
    valid_from: float
    valid_to: float
    load_direction: PadDirection
    displacement_direction: PadDirection
    hysteresis: Hysteresis | None = None
    relative_calibration: float = 0.0
    status: Conditions = ()
    runs: tuple[str, ...] = ()
    includes_housing: bool = True

    @property
    def law(self) -> LawFit:
        """The most likely law with its parameters and covariance."""
        return self.fits[0]

    def deflection(self, load: ArrayLike) -> FloatArray:
        """Deflection [m] at pad loads [N]; same shape as `load`, which must not be negative.

        Parameters
        ----------
        load : array_like
            [N], not negative.
        """
        return self.law.deflection(_positive(load))

    def stiffness(self, load: ArrayLike) -> FloatArray:
        """Tangent stiffness dW/d delta [N/m] at pad loads [N], what small vibrations feel (paper, Eq. 18).

        Parameters
        ----------
        load : array_like
            [N], not negative.
        """
        return np.asarray(1.0 / self.law.compliance(_positive(load)))

    def secant(self, load: ArrayLike) -> FloatArray:
        """Secant stiffness W/delta [N/m] at pad loads [N], what the printed formulas mean (Eq. 16, 17).

        Parameters
        ----------
        load : array_like
            [N], not negative.
        """
        return np.asarray(_positive(load) / self.deflection(load))

    def stiffness_band(self, load: ArrayLike, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Interval of the tangent stiffness.

        Parameters
        ----------
        load : array_like
            Pad loads [N].
        level : float
            Coverage.

        Returns
        -------
        lo, hi : ndarray
            [N/m], shape of `load`. Random errors, drift, friction, the choice of the law, and calibration.
        """
        return self._band(load, level, secant=False)

    def secant_band(self, load: ArrayLike, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Interval of the secant stiffness [N/m]; as `stiffness_band`.

        Parameters
        ----------
        load : array_like
            [N], not negative.
        level : float, optional
            Of the interval, 0 to 1.
        """
        return self._band(load, level, secant=True)

    def _band(self, load: ArrayLike, level: float, secant: bool) -> tuple[FloatArray, FloatArray]:
        value = self.secant(load) if secant else self.stiffness(load)
        error = np.hypot(self.relative_stiffness_se(load, secant), self.relative_calibration)
        factor = np.exp(_quantile(level) * error)
        return np.asarray(value / factor), np.asarray(value * factor)

    def relative_stiffness_se(self, load: ArrayLike, secant: bool = False) -> FloatArray:
        """Standard error of ln(stiffness) at pad loads [N], calibration apart.

        Parameters
        ----------
        load : array_like
            [N]
        secant : bool
            Of the secant stiffness instead of the tangent one.
        """
        variance = np.diag(self.relative_stiffness_covariance(load, secant))
        return np.sqrt(variance).reshape(np.shape(load))

    def relative_stiffness_covariance(self, load: ArrayLike, secant: bool = False) -> FloatArray:
        """Covariance of ln(stiffness) between pad loads (n,) [N], (n, n).

        A curve that is off is off as a whole: contact and friction bend it, noise hardly scatters it. Each law's own,
        the laws' about the leading one, and what extrapolation by so many e-folds adds.

        Parameters
        ----------
        load : (n,) array_like
            [N]
        secant : bool
            Of the secant stiffness instead of the tangent one.
        """
        loads = np.maximum(_positive(load).ravel(), 1e-6 * self.valid_to)
        _, covariance = self._mixed(lambda fit: fit.log_softness(loads, secant))
        outside = np.maximum(loads / self.valid_to, np.min(self.steps.load) / loads)
        return covariance + np.diag((EXTRAPOLATION_SPREAD * np.log(np.maximum(outside, 1.0))) ** 2)

    def _mixed(self, quantity: Callable[[LawFit], tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray]:
        """Values (n,) of the leading law, and their covariance (n, n) by all laws about it."""
        leading, _ = quantity(self.law)
        covariance = np.zeros((len(leading), len(leading)))
        for fit, weight in zip(self.fits, self.weights, strict=True):
            value, gradient = quantity(fit)
            difference = value - leading
            covariance += weight * (gradient @ fit.covariance @ gradient.T + np.outer(difference, difference))
        return leading, covariance

    def reading_band(self, load: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Deflection that the steps should show while loading, and its 95 % interval.

        Other than `deflection` it holds the way into contact, and its interval is that of the reading about the
        steps' own zero: what the fit leaves open among the points, not how far the zero load's reading is known.

        Parameters
        ----------
        load : array_like
            Pad loads [N].

        Returns
        -------
        value, lo, hi : ndarray
            [m], shape of `load`.
        """
        values = _positive(load)
        applied, up = values.ravel() / (1.0 - self.law.theta[FRICTION]), np.ones(values.size)
        reading, covariance = self._mixed(lambda fit: fit.reading_gradient(applied, up))
        half = (_quantile(0.95) * np.sqrt(np.diag(covariance))).reshape(values.shape)
        value = (reading - self.law.theta[OFFSET]).reshape(values.shape)
        return value, value - half, value + half

    def is_extrapolated(self, load: ArrayLike) -> BoolArray:
        """True where a load lies outside what was measured with full contact.

        Parameters
        ----------
        load : array_like
            [N]
        """
        values = _positive(load)
        return np.asarray((values < self.valid_from) | (values > self.valid_to))

    def to_frame(self) -> pd.DataFrame:
        """Rows of ``pivot_curves.csv``."""
        from tpjb_ident.pivot.tables import pivot_table

        return pivot_table([self])

    def plot(self, **options: Any) -> Any:
        """Draw the stiffness over the load; see `tpjb_ident.report.plots.pivot_stiffness`.

        Parameters
        ----------
        **options
            ``formula``, ``loads``, ``title``.
        """
        from tpjb_ident.report.plots import pivot_stiffness

        return pivot_stiffness([self], **options)

    def __str__(self) -> str:
        parameters = []
        for name, value, variance in zip(self.law.names, self.law.theta, np.diag(self.law.covariance), strict=True):
            parameters.append(f"{name} = {value:.4g} (se {math.sqrt(variance):.2g})")
        middle = 0.5 * self.valid_to
        low, high = map(float, self.stiffness_band(middle))
        stiffness = with_interval(float(self.stiffness(middle)), low, high, STIFFNESS.display_scale)
        lines = [
            f"pad {self.pad} at {math.degrees(self.angle):g} deg: {stiffness} {STIFFNESS.display_unit} (tangent, 95 %) "
            f"at {amount(middle, 'force', '.4g')}",
            f"  law {self.law.name} ({100 * self.weights[0]:.0f} %): {', '.join(parameters[SCALE:])}",
            f"  holds from {self.valid_from:.0f} to {self.valid_to:.0f} N; load {self.load_direction}",
        ]
        if self.onset_load > 0.0:
            lines.append(f"  fully in contact from {self.onset_load:.0f} N (se {self.onset_load_se:.0f} N)")
        if self.hysteresis is not None:
            lines.append(f"  {self.hysteresis}")
        if self.status:
            lines.append("  status: " + ", ".join(sentences(self.status)))
        return "\n".join(lines)


def _positive(load: ArrayLike) -> FloatArray:
    """Loads as an array; refused where one is negative or none: a pivot can only be pressed."""
    loads = np.asarray(load, dtype=float)
    if not np.all(loads >= 0.0):
        raise ArgumentError("load must be zero or positive, and not NaN: a pivot can only be pressed")
    return loads


def _quantile(level: float) -> float:
    """Standard deviations on either side of a normal interval of this coverage."""
    if not 0.0 < level < 1.0:
        raise ArgumentError(f"level must lie between 0 and 1, got {level}")
    return special.ndtri(0.5 + 0.5 * level)
