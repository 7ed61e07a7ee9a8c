"""What a rotordynamics program takes of a prediction: K-C-M, K and C at whirl frequencies, the full set.

A tilting-pad bearing has no K and C of its own: its pads follow the shaft with a delay, so that the 2 x 2 coefficients
change with the frequency of the whirl. Three answers, from the least to the most that is kept:

- `kcm`: h = K - omega^2 M + i omega C, one set over a band, with what it costs (`misfit`);
- `reduced`: K and C at whirl frequencies of choice, from the same static solution;
- `full_set`: the matrices with every pad's tilt and pivot deflection as coordinates, valid at every frequency and for
  damped whirl (Eq. (9)-(12) before they are reduced).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.dynamics.reduction import bearing_impedance, pad_matrices
from model.predict import Prediction

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class FrequencyModel:
    """h = K - omega^2 M + i omega C over a band.

    Attributes
    ----------
    stiffness, damping, mass : (2, 2) ndarray
        [N/m], [N s/m], [kg]; the mass is the curvature of Re h, seldom that of any oil or pad.
    band : tuple of float
        Lowest and highest frequency fitted [rad/s]; beyond, the model is extrapolated.
    misfit : float
        Largest ||model - h|| / ||h|| over the frequencies fitted.
    """

    stiffness: FloatArray
    damping: FloatArray
    mass: FloatArray
    band: tuple[float, float]
    misfit: float

    def h(self, omega: ArrayLike) -> ComplexArray:
        """Dynamic stiffness of the model, (..., 2, 2), at frequencies [rad/s]."""
        s = np.asarray(omega, float)[..., None, None]
        return np.asarray(self.stiffness - s**2 * self.mass + 1j * s * self.damping)

    def __str__(self) -> str:
        low, high = (w / (2 * math.pi) for w in self.band)
        rows = [
            f"{name} [{unit}]: " + ", ".join(f"{x:.4g}" for x in matrix.ravel())
            for name, unit, matrix in (
                ("K", "N/m", self.stiffness),
                ("C", "N s/m", self.damping),
                ("M", "kg", self.mass),
            )
        ]
        return "\n".join([f"K-C-M over {low:.4g} to {high:.4g} Hz, misfit {self.misfit:.2%}", *rows])


def fit_kcm(omega: ArrayLike, h: ArrayLike) -> FrequencyModel:
    """Fit K, C and M to a dynamic stiffness over frequency, relative to its size at every frequency.

    Parameters
    ----------
    omega : (n,) array_like
        [rad/s], two different ones at least.
    h : (n, 2, 2) array_like
        [N/m]

    Raises
    ------
    ValueError
        Fewer than two different frequencies, or h that is not finite (a point without equilibrium).
    """
    w, table = np.asarray(omega, float), np.asarray(h, complex)
    if w.ndim != 1 or table.shape != (len(w), 2, 2):
        raise ValueError(f"need h of shape (n, 2, 2) at n frequencies, got {table.shape} at {w.shape}")
    if len(np.unique(w)) < 2:
        raise ValueError(f"K-C-M needs two different frequencies at least, got {len(np.unique(w))}")
    if not np.isfinite(table).all():
        raise ValueError("h is not finite: leave out points without equilibrium")
    size = np.linalg.norm(table, axis=(1, 2))
    weight = 1.0 / size
    real = np.linalg.lstsq(np.column_stack([weight, -(w**2) * weight]), _columns(table.real, weight), rcond=None)[0]
    imag = np.linalg.lstsq((w * weight)[:, None], _columns(table.imag, weight), rcond=None)[0]
    stiffness, mass, damping = real[0].reshape(2, 2), real[1].reshape(2, 2), imag[0].reshape(2, 2)
    model = FrequencyModel(stiffness, damping, mass, (float(w.min()), float(w.max())), 0.0)
    misfit = float((np.linalg.norm(model.h(w) - table, axis=(1, 2)) / size).max())
    return FrequencyModel(stiffness, damping, mass, model.band, misfit)


def _columns(table: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray(table.reshape(len(weight), 4) * weight[:, None])


def kcm(prediction: Prediction) -> FrequencyModel:
    """K-C-M over the frequencies of a prediction, of what the records would show."""
    return fit_kcm(np.atleast_1d(prediction.excitation), np.reshape(prediction.h, (-1, 2, 2)))


def reduced(prediction: Prediction, omega: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """K and C of the bearing at whirl frequencies, from the static solution at hand, free of instruments.

    Parameters
    ----------
    prediction : Prediction
    omega : float or (n,) array_like
        [rad/s]; 0 gives the slope of the static locus and the damping of very slow motion.

    Returns
    -------
    stiffness, damping : (2, 2) or (n, 2, 2) ndarray
        [N/m], [N s/m]
    """
    if not prediction.converged:
        raise ValueError(f"no equilibrium, hence no coefficients: {', '.join(prediction.status)}")
    w = np.asarray(omega, float)
    # damping at rest is the limit: far below what moves a pad, far above rounding
    slow = np.maximum(np.atleast_1d(w), 1e-3 * prediction.speed)
    stiffness = bearing_impedance(prediction.setup, prediction.equilibrium, np.atleast_1d(w)).real
    damping = bearing_impedance(prediction.setup, prediction.equilibrium, slow).imag / slow[:, None, None]
    return stiffness.reshape(*w.shape, 2, 2), damping.reshape(*w.shape, 2, 2)


@dataclass(frozen=True)
class FullSet:
    """Mass, damping and stiffness with every pad's motion as coordinates: M q'' + C q' + K q = forces on the shaft.

    Attributes
    ----------
    names : tuple of str
        ``x``, ``y`` of the shaft, then ``tilt k`` [rad] and ``give k`` (radial pivot deflection, outward [m]) of
        every pad that carries; a pad on a rigid pivot has no ``give``. With a housing spring in series ``inner x``,
        ``inner y`` stand between; with one that gives in one direction only, ``structure``: how far it gave [m].
    mass, damping, stiffness : (n, n) ndarray
        The shaft's own mass is not in.
    """

    names: tuple[str, ...]
    mass: FloatArray = field(repr=False)
    damping: FloatArray = field(repr=False)
    stiffness: FloatArray = field(repr=False)

    def reduce(self, s: complex) -> ComplexArray:
        """Dynamic stiffness (2, 2) of the shaft for motion as exp(s t); s = i omega for a steady whirl."""
        z = s**2 * self.mass + s * self.damping + self.stiffness
        return np.asarray(z[:2, :2] - z[:2, 2:] @ np.linalg.solve(z[2:, 2:], z[2:, :2]))


def full_set(prediction: Prediction) -> FullSet:
    """Matrices of a bearing before any reduction, Eq. (9)-(12), without instruments.

    Raises
    ------
    ValueError
        The point has no equilibrium.
    """
    if not prediction.converged:
        raise ValueError(f"no equilibrium, hence no coefficients: {', '.join(prediction.status)}")
    setup = prediction.setup
    pads = [m for f in prediction.equilibrium.films if (m := pad_matrices(setup, f)) is not None]
    names = ["x", "y"]
    if any(setup.series_compliance):
        names += ["inner x", "inner y"]
    inner = len(names) - 2
    places = []
    for pad in pads:
        own = [f"tilt {pad.number}"]
        if math.isfinite(pad.pad_stiffness[1, 1]):
            own.append(f"give {pad.number}")
        places.append([inner, inner + 1, *range(len(names), len(names) + len(own))])
        names += own
    mass, damping, stiffness = np.zeros((3, len(names), len(names)))
    for pad, at in zip(pads, places, strict=True):
        count, block = len(at), np.ix_(at[2:], at[2:])
        stiffness[np.ix_(at, at)] += pad.stiffness[:count, :count]
        damping[np.ix_(at, at)] += pad.damping[:count, :count]
        stiffness[block] += pad.pad_stiffness[: count - 2, : count - 2]
        damping[block] += pad.pad_damping[: count - 2, : count - 2]
        mass[block] += pad.pad_mass[: count - 2, : count - 2]
    mass[inner : inner + 2, inner : inner + 2] += setup.added_mass * np.eye(2)
    if inner:
        return _spring_between(setup.structure, names, (mass, damping, stiffness))
    return FullSet(tuple(names), mass, damping, stiffness)


def _spring_between(
    compliance: FloatArray, names: list[str], matrices: tuple[FloatArray, FloatArray, FloatArray]
) -> FullSet:
    """Put the structure's spring between the shaft's readings and the inner coordinates, where it gives at all."""
    gives, directions = np.linalg.eigh(compliance)
    soft = gives > 1e-9 * gives[-1]
    labels = names[2:4] if soft.all() else ["structure"]
    # what was `inner` is the shaft less what the structure gave: full rank keeps the inner coordinates themselves
    turn = np.zeros((len(names), len(names) - 2 + len(labels)))
    turn[:2, :2] = np.eye(2)
    turn[4:, 2 + len(labels) :] = np.eye(len(names) - 4)
    if soft.all():
        turn[2:4, 2:4] = np.eye(2)
        spring = np.linalg.inv(compliance)
        own = np.block([[spring, -spring], [-spring, spring]])
    else:
        turn[2:4, :2], turn[2:4, 2] = np.eye(2), -directions[:, -1]
        own = np.diag([0.0, 0.0, 1.0 / gives[-1]])
    mass, damping, stiffness = (turn.T @ m @ turn for m in matrices)
    stiffness[: len(own), : len(own)] += own
    return FullSet((*names[:2], *labels, *names[4:]), mass, damping, stiffness)
