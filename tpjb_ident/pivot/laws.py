r"""Load-deflection laws of a pivot, in one common form.

Every law is :math:`\delta(W) = s\,W_r\,\varphi(W/W_r; q)` with the compliance
:math:`d\delta/dW = s\,\psi(W/W_r; q)`, :math:`\psi = \varphi'`: a scale `s` [m/N] and a shape `q`. The reference
load `W_r` lies in the middle of the test, so scale and shape are nearly independent.

===============  ==================================  ==================================================
law              psi(u)                              where it comes from
===============  ==================================  ==================================================
hertz-line       1 - kappa ln u                      line contact (rocker): the printed W {2/3 + ln(B/W)};
                                                     a linear compliance in series only lowers kappa
hertz-point      u^(-1/3)                            point contact (sphere)
power            u^(p-1)                             contact of any conformity
linear           1                                   housing, shim, flexure
point-in-series  (1-lam) u^(-1/3) + lam              sphere on a compliant housing
bilinear         1 + (r-1)/{1 + exp[(u-b)/(b/10)]}   two contacts one after the other; a play before the
                                                     first is the contact loss that every law may carry
spline           exp(piecewise linear in ln u)       no physics: only monotone and smooth
===============  ==================================  ==================================================

Each shape has a weak prior (mean, standard deviation) that says what is physically plausible; it keeps the
extrapolation sane where the records say nothing, and it makes the laws' evidences comparable.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rigdata.arrays import FloatArray

#: Values (n,) and their derivative (n, k) with respect to the shape parameters.
WithDerivative = tuple[FloatArray, FloatArray]
_SPHERE = 2.0 / 3.0


class Law(Protocol):
    """Shape of a law. `u` (n,) is load over reference load, `q` (k,) the shape parameters.

    Examples
    --------
    >>> law = LAWS["linear"]
    >>> shape, by_parameter = law.phi(np.array([0.5, 2.0]), law.prior_mean)
    >>> print(law.name, shape)
    linear [0.5 2. ]
    """

    @property
    def name(self) -> str:
        """Name in tables and files."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k shape parameters."""

    @property
    def prior_mean(self) -> FloatArray:
        """(k,) most plausible shape."""

    @property
    def prior_precision(self) -> FloatArray:
        """(k, k) inverse covariance of the prior."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest shape parameters (k,), (k,) at which the law is monotone."""

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        """Deflection shape (n,) and its derivative with respect to q (n, k).

        Parameters
        ----------
        u : (n,) ndarray
            Load over the reference load.
        q : (k,) ndarray
            Parameters of the shape.
        """

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        """Compliance shape (n,) and its derivative with respect to q (n, k).

        Parameters
        ----------
        u : (n,) ndarray
            Load over the reference load.
        q : (k,) ndarray
            Parameters of the shape.
        """


class _Shape:
    """Name, parameters and prior, common to all laws but the spline; (k,) each."""

    name: str
    parameters: tuple[str, ...] = ()
    mean: tuple[float, ...] = ()
    spread: tuple[float, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()

    @property
    def prior_mean(self) -> FloatArray:
        return np.array(self.mean)

    @property
    def prior_precision(self) -> FloatArray:
        return np.diag(1.0 / np.array(self.spread) ** 2) if self.spread else np.zeros((0, 0))

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.low), np.array(self.high)


def _log(u: FloatArray) -> FloatArray:
    """Logarithm that stays finite at zero load, where every use multiplies it by zero or bounds it."""
    return np.log(np.maximum(u, 1e-9))


def _raised(u: FloatArray, p: float) -> FloatArray:
    """Integral of the compliance u^(p - 1)."""
    return np.asarray(np.maximum(u, 0.0) ** p / p)


def _compliance(u: FloatArray, p: float) -> FloatArray:
    """Compliance u^(p - 1), finite at zero load."""
    return np.asarray(np.maximum(u, 1e-9) ** (p - 1.0))


class _FixedPower(_Shape):
    """Deflection as W^p: p = 1 is a constant compliance, p = 2/3 a sphere on a flat (paper, Eq. 16)."""

    def __init__(self, name: str, p: float) -> None:
        self.name, self.p = name, p

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        return _raised(u, self.p), np.zeros((len(u), 0))

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        return _compliance(u, self.p), np.zeros((len(u), 0))


class _HertzLine(_Shape):
    """Cylinder in cylinder: deflection as W (A - ln W) (paper, Eq. 17); kappa = 1 / (A - 1 - ln W_r)."""

    name = "hertz-line"
    parameters = ("kappa",)
    mean = (0.08,)
    spread = (0.05,)
    low = (0.0,)
    high = (0.45,)

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        fall = u * (1.0 - _log(u))
        return u + q[0] * fall, fall[:, None]

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        # at very small or very large loads the logarithm leaves the law's range: the compliance stays positive
        log = np.minimum(_log(u), 0.98 / max(q[0], 1e-12))
        return 1.0 - q[0] * log, -log[:, None]


class _Power(_Shape):
    """Deflection as W^p."""

    name = "power"
    parameters = ("p",)
    mean = (0.85,)
    spread = (0.15,)
    low = (0.3,)
    high = (1.3,)

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        value = _raised(u, q[0])
        return value, (value * (_log(u) - 1.0 / q[0]))[:, None]

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        value = _compliance(u, q[0])
        return value, (value * _log(u))[:, None]


class _PointInSeries(_Shape):
    """Sphere on flat with a linear compliance in series: lam is the linear share at the reference load."""

    name = "point-in-series"
    parameters = ("lam",)
    mean = (0.5,)
    spread = (0.25,)
    low = (0.0,)
    high = (1.0,)

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        point = _raised(u, _SPHERE)
        return (1.0 - q[0]) * point + q[0] * u, (u - point)[:, None]

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        point = _compliance(u, _SPHERE)
        return (1.0 - q[0]) * point + q[0], (1.0 - point)[:, None]


class _Bilinear(_Shape):
    """Two compliances with a bend between them at u = b; r is the first over the second."""

    name = "bilinear"
    parameters = ("log r", "log b")
    mean = (0.0, 0.0)
    spread = (0.5, 0.5)
    low = (-2.0, -1.6)
    high = (2.0, 1.0)
    width = 0.1  # of the bend, as a share of b

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        r, b = np.exp(q)
        soft, slope_u, _ = self._bend(u, b)
        # the bent part is b g(u / b) with g homogeneous: d/d(log b) = g b - u g'
        return u + (r - 1.0) * soft, np.column_stack([r * soft, (r - 1.0) * (soft - u * slope_u)])

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        r, b = np.exp(q)
        _, step, curve = self._bend(u, b)
        return 1.0 + (r - 1.0) * step, np.column_stack([r * step, -(r - 1.0) * u * curve])

    def _bend(self, u: FloatArray, b: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Integral of the smooth step from 0 to u, the step, and its derivative."""
        w = self.width * b
        z = np.clip((u - b) / w, -500.0, 500.0)
        step = 1.0 / (1.0 + np.exp(z))
        integral = w * (np.logaddexp(0.0, b / w) - np.logaddexp(0.0, -z))
        return integral, step, -step * (1.0 - step) / w


NODES = np.log(np.array([0.08, 0.16, 0.3, 0.55, 1.0, 1.6, 2.4, 4.0]))  # ln(W / W_r); the one at 0 is the scale
FIXED = 4  # the node at the reference load: its value is zero, the scale stands beside it
TYPICAL_SLOPE = -0.15  # of ln(compliance) over ln(load), between linear (0) and a sphere (-1/3)
SLOPE_SPREAD = 0.25
BEND_SPREAD = 0.2  # change of that slope from node to node, standard deviation


def _spline_precision() -> FloatArray:
    """Precision (k, k) of the prior: a slope at the reference load, and small bends (k: free nodes)."""
    slopes = np.zeros((len(NODES) - 1, len(NODES)))
    gaps = np.diff(NODES)
    for j in range(len(NODES) - 1):
        slopes[j, j], slopes[j, j + 1] = -1.0 / gaps[j], 1.0 / gaps[j]
    bends = np.diff(slopes, axis=0) / BEND_SPREAD
    rows = np.delete(np.vstack([bends, slopes[FIXED] / SLOPE_SPREAD]), FIXED, axis=1)
    return np.asarray(rows.T @ rows)


class _Spline(_Shape):
    """Monotone smoothing spline; the shape parameters are ln(compliance) at the free nodes.

    The logarithm of the compliance is piecewise linear in the logarithm of the load. Whatever its values, the
    deflection rises with load; where the points end, the last slope goes on as a power law. Its bends are held
    down by a prior (a random walk of the slope), which is what a smoothing spline is (Wahba, 1990), and which
    also widens the band outside the points.
    """

    name = "spline"
    parameters = tuple(f"ln psi({np.exp(x):.2g})" for x in np.delete(NODES, FIXED))
    mean = tuple(TYPICAL_SLOPE * np.delete(NODES, FIXED))
    low = (-4.0,) * len(mean)  # wide: nothing here can break monotony
    high = (4.0,) * len(mean)
    precision = _spline_precision()

    @property
    def prior_precision(self) -> FloatArray:
        """(k, k) what holds the bends down."""
        return self.precision

    def psi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        weights = interpolation(np.log(np.maximum(u, 1e-9)), NODES)
        value = np.exp(weights @ np.insert(q, FIXED, 0.0))
        return value, np.delete(weights, FIXED, axis=1) * value[:, None]

    def phi(self, u: FloatArray, q: FloatArray) -> WithDerivative:
        logs = np.insert(q, FIXED, 0.0)
        weighted = _GRID_LOAD * np.exp(_GRID_WEIGHTS @ logs)  # d phi / d ln u on the grid
        columns = np.column_stack([weighted, weighted[:, None] * np.delete(_GRID_WEIGHTS, FIXED, axis=1)])
        # below the grid the compliance is a power of the load, integrable whatever the slope says
        slope = max((logs[1] - logs[0]) / (NODES[1] - NODES[0]), -0.9)
        trapezoids = 0.5 * _GRID_STEP * (columns[1:] + columns[:-1])
        total = np.vstack([np.zeros(columns.shape[1]), np.cumsum(trapezoids, axis=0)])
        below = columns[0] / (1.0 + slope)
        # that share changes with the slope, so with the first two nodes (both free: the fixed one lies higher up)
        turn = below[0] / (1.0 + slope) / (NODES[1] - NODES[0])
        below[1], below[2] = below[1] + turn, below[2] - turn
        total += below
        # between grid points the integral is a power of the load: interpolate its logarithm
        x = np.clip((np.log(np.maximum(u, 1e-12)) - _GRID[0]) / _GRID_STEP, None, len(_GRID) - 1.0)
        cell = np.clip(x.astype(int), 0, len(_GRID) - 2)
        part = x - cell
        value = total[:, 0]
        log = np.log(value)
        phi = np.exp((1.0 - part) * log[cell] + part * log[cell + 1])
        relative = total[:, 1:] / value[:, None]
        jacobian = (1.0 - part)[:, None] * relative[cell] + part[:, None] * relative[cell + 1]
        phi = np.where(u > 0.0, phi, 0.0)
        return phi, jacobian * phi[:, None]


def interpolation(x: FloatArray, knots: FloatArray) -> FloatArray:
    """Weights (n, k) of linear interpolation at rising knots (k,); linear extrapolation beyond the ends."""
    cell = np.clip(np.searchsorted(knots, x) - 1, 0, len(knots) - 2)
    share = (x - knots[cell]) / (knots[cell + 1] - knots[cell])
    weights = np.zeros((len(x), len(knots)))
    rows = np.arange(len(x))
    weights[rows, cell] = 1.0 - share
    weights[rows, cell + 1] = share
    return weights


# ln u on which the compliance is integrated
_GRID, _GRID_STEP = np.linspace(np.log(2e-3), np.log(25.0), 320, retstep=True)
_GRID_LOAD = np.exp(_GRID)
_GRID_WEIGHTS = interpolation(_GRID, NODES)
_ALL: tuple[Law, ...] = (
    _HertzLine(),
    _FixedPower("hertz-point", _SPHERE),
    _Power(),
    _FixedPower("linear", 1.0),
    _PointInSeries(),
    _Bilinear(),
    _Spline(),
)
LAWS = {law.name: law for law in _ALL}
