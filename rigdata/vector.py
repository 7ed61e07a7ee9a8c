"""Readings along two or more directions, turned into X and Y."""

import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel

#: Two directions whose sine is not above this (3 deg) count as one.
_COLLINEAR_SINE = 0.05
#: The same limit as the smallest singular value of two directions, sqrt(1 - cos).
_LEAST_SINGULAR = math.sqrt(1.0 - math.sqrt(1.0 - _COLLINEAR_SINE**2))


def directions(axes: float | Sequence[float] | FloatArray) -> FloatArray:
    """Unit vectors (.., 2) along `axes` (..) [rad]: they turn X and Y into components."""
    return np.stack([np.cos(axes), np.sin(axes)], axis=-1)


@functools.lru_cache(maxsize=256)
def inverse_directions(axes: tuple[float, ...]) -> FloatArray:
    """(2, m) matrix from components along `axes` [rad] to X and Y; NaN where they span no plane."""
    along = directions(axes)
    if len(axes) < 2 or np.linalg.svd(along, compute_uv=False)[-1] <= _LEAST_SINGULAR:
        return np.full((2, len(axes)), np.nan)
    inverse = np.linalg.pinv(along)
    inverse[np.abs(inverse) < 1e-12] = 0.0  # cos 90 deg is not quite zero
    inverse.setflags(write=False)
    return np.asarray(inverse)


def vector_rows(channels: Sequence[Channel], readings: Sequence[FloatArray]) -> FloatArray:
    """X and Y (2, n) [SI] of raw readings, (n,) of each channel.

    Least squares where there are more than two channels, NaN where fewer than two directions have a value.
    """
    axes = [channel.axis or 0.0 for channel in channels]
    values = np.array([channel.to_si(reading) for channel, reading in zip(channels, readings, strict=True)])
    rows = inverse_directions(tuple(axes)) @ values
    partial = np.isnan(rows[0])
    if partial.any():
        rows[:, partial] = plane_vector(directions(axes), values[:, partial].T).real.T
    return rows


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles [rad] from -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def plane_vector(along: FloatArray, values: ComplexArray) -> ComplexArray:
    """X and Y (.., 2) of components (.., m) along unit vectors (.., m, 2), by least squares over those with a value.

    NaN where they span no plane.
    """
    present = np.isfinite(values)
    axes = np.where(present[..., None], along, 0.0)
    gram = np.swapaxes(axes, -1, -2) @ axes
    moment = np.swapaxes(axes, -1, -2) @ np.where(present, values, 0.0)[..., None]
    spanned = np.linalg.det(gram) > _COLLINEAR_SINE**2
    vectors = np.full((*values.shape[:-1], 2), np.nan + 0j)
    vectors[spanned] = np.linalg.solve(gram[spanned], moment[spanned])[..., 0]
    return vectors


class Directed:
    """What several channels show, side by side; `channels` have a quantity and an axis each."""

    channels: Any

    def pick(self, quantity: str) -> list[int]:
        """Places of the channels of a quantity."""
        return [k for k, channel in enumerate(self.channels) if channel.quantity == quantity]

    def plane(self, quantity: str, values: ComplexArray | FloatArray) -> ComplexArray:
        """X and Y (.., 2) of a quantity from values (.., n_channels) of all channels, NaN where there is none."""
        places = self.pick(quantity)
        along = directions([self.channels[k].axis or 0.0 for k in places])
        return plane_vector(along, np.asarray(values[..., places], complex))


def zero_uncertainty(channels: Iterable[Channel], quantity: str) -> FloatArray:
    """Standard uncertainty of a quantity's zero along X and Y (2,) [SI], from what the manifest states."""
    chosen = [c for c in channels if c.quantity == quantity and c.axis is not None]
    if len(chosen) < 2:
        return np.zeros(2)
    inverse = inverse_directions(tuple(c.axis or 0.0 for c in chosen))
    return np.sqrt(inverse**2 @ np.array([c.zero_uncertainty for c in chosen]) ** 2)
