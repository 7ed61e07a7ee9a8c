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
bilinear         1 + (r-1)/{1 + exp[(u-b)/(w b)]}    two contacts one after the other; a play before the
                                                     first is the contact loss that every law may carry
spline           exp(piecewise linear in ln u)       no physics: only monotone and smooth
===============  ==================================  ==================================================

Each shape has a weak prior (mean, standard deviation) that says what is physically plausible; it keeps the
extrapolation sane where the records say nothing, and it makes the laws' evidences comparable.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import interpolate

from rigdata.arrays import FloatArray

#: Values (n,) and their derivative (n, k) with respect to the shape parameters.
WithDerivative = tuple[FloatArray, FloatArray]
#: Of load over reference load (n,) and the shape parameters (k,).
Shape = Callable[[FloatArray, FloatArray], WithDerivative]
_SPHERE = 2.0 / 3.0


@dataclass(frozen=True, eq=False)
class Law:
    """Shape of a law.

    Attributes
    ----------
    name : str
        In tables and files.
    phi, psi : callable
        Shapes of deflection and of compliance: of load over the reference load (n,) and k shape parameters they give
        values (n,) and their derivative (n, k) with respect to the parameters.
    parameters : tuple of str
        Names of the k shape parameters.
    prior_mean : (k,) ndarray
        Most plausible shape.
    prior_precision : (k, k) ndarray
        Inverse covariance of the prior.
    bounds : (k,), (k,) ndarray
        Lowest and highest shape parameters at which the law is monotone.

    Examples
    --------
    >>> law = LAWS["linear"]
    >>> shape, by_parameter = law.phi(np.array([0.5, 2.0]), law.prior_mean)
    >>> print(law.name, shape)
    linear [0.5 2. ]
    """

    name: str
    phi: Shape
    psi: Shape
    parameters: tuple[str, ...]
    prior_mean: FloatArray
    prior_precision: FloatArray
    bounds: tuple[FloatArray, FloatArray]


def _log(u: FloatArray) -> FloatArray:
    """Logarithm that stays finite at zero load, where every use multiplies it by zero or bounds it."""
    return np.log(np.maximum(u, 1e-9))


def _power_phi(u: FloatArray, q: FloatArray) -> WithDerivative:
    value = np.maximum(u, 0.0) ** q[0] / q[0]
    return value, (value * (_log(u) - 1.0 / q[0]))[:, None]


def _power_psi(u: FloatArray, q: FloatArray) -> WithDerivative:
    value = np.maximum(u, 1e-9) ** (q[0] - 1.0)
    return value, (value * _log(u))[:, None]


def _fixed(power: Shape, p: float, u: FloatArray, q: FloatArray) -> WithDerivative:
    """Constant compliance at p = 1, sphere on a flat at p = 2/3 (paper, Eq. 16)."""
    return power(u, np.array([p]))[0], np.zeros((len(u), 0))


def _in_series(power: Shape, u: FloatArray, q: FloatArray) -> WithDerivative:
    """Sphere on flat with a linear compliance in series: q is the linear share at the reference load."""
    point, line = _fixed(power, _SPHERE, u, q)[0], _fixed(power, 1.0, u, q)[0]
    return (1.0 - q[0]) * point + q[0] * line, (line - point)[:, None]


def _line_phi(u: FloatArray, q: FloatArray) -> WithDerivative:
    """Cylinder in cylinder: deflection as W (A - ln W) (paper, Eq. 17); kappa = 1 / (A - 1 - ln W_r)."""
    fall = u * (1.0 - _log(u))
    return u + q[0] * fall, fall[:, None]


def _line_psi(u: FloatArray, q: FloatArray) -> WithDerivative:
    # at very small or very large loads the logarithm leaves the law's range: the compliance stays positive
    log = np.minimum(_log(u), 0.98 / max(q[0], 1e-12))
    return 1.0 - q[0] * log, -log[:, None]


def _bilinear_phi(u: FloatArray, q: FloatArray) -> WithDerivative:
    """Two compliances, r the first over the second, with a bend between them at u = b, w of b wide."""
    r, b, w = np.exp(q)
    soft, step, _, z = _bend(u, b, w)
    # the bent part is b g(u / b) with g homogeneous: d/d(log b) = g b - u g'
    wider = soft - b / (1.0 + np.exp(-1.0 / w)) - w * b * z * step
    return u + (r - 1.0) * soft, np.column_stack([r * soft, (r - 1.0) * (soft - u * step), (r - 1.0) * wider])


def _bilinear_psi(u: FloatArray, q: FloatArray) -> WithDerivative:
    r, b, w = np.exp(q)
    _, step, curve, z = _bend(u, b, w)
    columns = [r * step, -(r - 1.0) * u * curve, (r - 1.0) * z * step * (1.0 - step)]
    return 1.0 + (r - 1.0) * step, np.column_stack(columns)


def _bend(u: FloatArray, b: float, w: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Integral of the smooth step from 0 to u, the step, its derivative, and the distance from it in its widths."""
    z = np.clip((u - b) / (w * b), -500.0, 500.0)
    step = 1.0 / (1.0 + np.exp(z))
    integral = w * b * (np.logaddexp(0.0, 1.0 / w) - np.logaddexp(0.0, -z))
    return integral, step, -step * (1.0 - step) / (w * b), z


NODES = np.log(np.array([0.08, 0.16, 0.3, 0.55, 1.0, 1.6, 2.4, 4.0]))  # ln(W / W_r); the one at 0 is the scale
FIXED = 4  # the node at the reference load: its value is zero, the scale stands beside it
_FREE = np.flatnonzero(np.arange(len(NODES)) != FIXED)
# weights (n, k) of the nodes at x (n,): linear in between, and beyond the ends
_WEIGHTS = interpolate.make_interp_spline(NODES, np.eye(len(NODES)), k=1)
TYPICAL_SLOPE = -0.15  # of ln(compliance) over ln(load), between linear (0) and a sphere (-1/3)
SLOPE_SPREAD = 0.25
BEND_SPREAD = 0.2  # change of that slope from node to node, standard deviation


def _spline_precision() -> FloatArray:
    """Precision (k, k) of the prior: a slope at the reference load, and small bends (k: free nodes)."""
    slopes = np.diff(np.eye(len(NODES)), axis=0) / np.diff(NODES)[:, None]
    bends = np.diff(slopes, axis=0) / BEND_SPREAD
    rows = np.vstack([bends, slopes[FIXED] / SLOPE_SPREAD])[:, _FREE]
    return rows.T @ rows


def _spline_psi(u: FloatArray, q: FloatArray) -> WithDerivative:
    """The logarithm of the compliance is piecewise linear in that of the load; beyond the nodes its slope goes on."""
    weights = _WEIGHTS(_log(u))[:, _FREE]
    value = np.exp(weights @ q)
    return value, weights * value[:, None]


def _spline_phi(u: FloatArray, q: FloatArray) -> WithDerivative:
    """Integral of the compliance, which rises with the load whatever the nodes say."""
    # of d phi / d ln u on the grid: values, and their derivatives with respect to the nodes
    columns = np.exp(_GRID + _GRID_COLUMNS[:, 1:] @ q)[:, None] * _GRID_COLUMNS
    # below the grid the compliance is a power of the load, integrable whatever the slope says
    gap = NODES[1] - NODES[0]
    slope = max((q[1] - q[0]) / gap, -0.9)
    below = columns[0] / (1.0 + slope)
    # that share changes with the slope, so with the first two nodes (both free: the fixed one lies higher up)
    below[1:3] += np.array([1.0, -1.0]) * below[0] / (1.0 + slope) / gap
    total = below + _GRID_STEP * (np.cumsum(columns, axis=0) - 0.5 * (columns + columns[0]))
    table = np.column_stack([np.log(total[:, 0]), total[:, 1:] / total[:, :1]])
    # between grid points, and beyond them, the integral is a power of the load: its logarithm is straight
    x = (np.log(np.maximum(u, 1e-12)) - _GRID[0]) / _GRID_STEP
    cell = np.clip(x.astype(int), 0, len(_GRID) - 2)
    part = (x - cell)[:, None]
    between = (1.0 - part) * table[cell] + part * table[cell + 1]
    phi = np.where(u > 0.0, np.exp(between[:, 0]), 0.0)
    return phi, between[:, 1:] * phi[:, None]


# ln u on which the compliance is integrated
_GRID, _GRID_STEP = np.linspace(np.log(2e-3), np.log(25.0), 320, retstep=True)
_GRID_COLUMNS = np.column_stack([np.ones(len(_GRID)), _WEIGHTS(_GRID)[:, _FREE]])


def _law(name: str, phi: Shape, psi: Shape, parameters: dict[str, tuple[float, float, float, float]]) -> Law:
    """A law of independent shape parameters: prior mean and standard deviation, lowest and highest of each."""
    mean, spread, low, high = np.array(list(parameters.values())).reshape(-1, 4).T
    return Law(name, phi, psi, tuple(parameters), mean, np.diag(1.0 / spread**2), (low, high))


def _contact_law(name: str, p: float) -> Law:
    return _law(name, functools.partial(_fixed, _power_phi, p), functools.partial(_fixed, _power_psi, p), {})


_WIDE = np.full(len(_FREE), 4.0)  # nothing in a spline can break monotony
_ALL = (
    _law("hertz-line", _line_phi, _line_psi, {"kappa": (0.08, 0.05, 0.0, 0.45)}),
    _contact_law("hertz-point", _SPHERE),
    _law("power", _power_phi, _power_psi, {"p": (0.85, 0.15, 0.3, 1.3)}),
    _contact_law("linear", 1.0),
    _law(
        "point-in-series",
        functools.partial(_in_series, _power_phi),
        functools.partial(_in_series, _power_psi),
        {"lam": (0.5, 0.25, 0.0, 1.0)},
    ),
    _law(
        "bilinear",
        _bilinear_phi,
        _bilinear_psi,
        {"log r": (0.0, 0.5, -2.0, 2.0), "log b": (0.0, 0.5, -1.6, 1.0), "log w": (-2.5, 0.8, -4.6, -0.7)},
    ),
    # monotone and smooth: its bends are held down by the prior (a random walk of the slope), which is what a smoothing
    # spline is (Wahba, 1990), and which also widens the band outside the points
    Law(
        "spline",
        _spline_phi,
        _spline_psi,
        tuple(f"ln psi({np.exp(x):.2g})" for x in NODES[_FREE]),
        TYPICAL_SLOPE * NODES[_FREE],
        _spline_precision(),
        (-_WIDE, _WIDE),
    ),
)
LAWS = {law.name: law for law in _ALL}
