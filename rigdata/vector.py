"""Readings along two or more directions, turned into X and Y."""

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel

#: Two directions whose sine is not above this (3 deg) count as one.
_COLLINEAR_SINE = 0.05
#: Weight of no tilt beside what channels in two planes tell: where some are missing, there is none.
_LEAST_TILT = 1e-6


def directions(axes: float | Sequence[float] | FloatArray) -> FloatArray:
    """Unit vectors (.., 2) along `axes` (..) [rad]: they turn X and Y into components."""
    return np.stack([np.cos(axes), np.sin(axes)], axis=-1)


def levers(channels: Sequence[Any]) -> FloatArray:
    """Distances of channels of one quantity from the film's mid-plane, (m,) [m]; zero where all stand in one plane."""
    planes = np.array([channel.plane for channel in channels])
    return planes if len(set(planes)) > 1 else np.zeros(len(planes))


def inverse_directions(channels: Sequence[Any]) -> FloatArray:
    """(2, m) matrix from readings of channels of one quantity to X and Y; NaN where they span no plane."""
    return _inverse(*_places(channels))


def _places(channels: Sequence[Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Angles of channels of one quantity [rad], and their distances from the mid-plane [m]."""
    return tuple(channel.axis or 0.0 for channel in channels), tuple(levers(channels).tolist())


@functools.lru_cache(maxsize=64)  # a campaign has a few sets of channels, and asks for each thousands of times
def _inverse(axes: tuple[float, ...], planes: tuple[float, ...]) -> FloatArray:
    """See `inverse_directions`."""
    unit_readings = np.eye(len(axes), dtype=complex)
    inverse = plane_vector(directions(axes), unit_readings, np.array(planes)).real.T
    inverse = np.where(np.abs(inverse) < 1e-12, 0.0, inverse)  # cos 90 deg is not quite zero
    inverse.flags.writeable = False
    return inverse


def channels_vector(channels: Sequence[Any], values: ComplexArray | FloatArray) -> ComplexArray:
    """X and Y (.., 2) of values (.., m) of the channels of one quantity, by least squares; NaN where they tell none."""
    axes, planes = _places(channels)
    readings: ComplexArray = np.asarray(values, complex)
    if axes and np.isfinite(readings).all():
        return readings @ _inverse(axes, planes).T
    return plane_vector(directions(axes), readings, np.array(planes))


def vector_rows(channels: Sequence[Channel], readings: Sequence[FloatArray]) -> FloatArray:
    """X and Y (2, n) [SI] of raw readings, (n,) of each channel.

    Least squares where there are more than two channels, NaN where fewer than two directions have a value.
    """
    values = np.array([channel.to_si(reading) for channel, reading in zip(channels, readings, strict=True)])
    rows = inverse_directions(channels) @ values
    partial = np.isnan(rows[0])
    rows[:, partial] = channels_vector(channels, values[:, partial].T).real.T
    return rows


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles [rad] from -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def plane_vector(along: FloatArray, values: ComplexArray, planes: FloatArray) -> ComplexArray:
    """X and Y (.., 2) of components (.., m) along unit vectors (.., m, 2), by least squares over those with a value.

    At the film's mid-plane where `planes` (m,) [m] from it are not all zero: a tilt is fitted beside, as far as the
    components tell one. NaN where they span no plane.
    """
    present = np.isfinite(values)
    axes = np.where(present[..., None], along, 0.0)
    gram = np.swapaxes(axes, -1, -2) @ axes
    spanned = np.linalg.det(gram) > _COLLINEAR_SINE**2
    if planes.any():
        axes = np.concatenate([axes, axes * planes[:, None] / np.abs(planes).max()], axis=-1)
        gram = np.swapaxes(axes, -1, -2) @ axes + np.diag([0.0, 0.0, _LEAST_TILT, _LEAST_TILT])
    moment = np.swapaxes(axes, -1, -2) @ np.where(present, values, 0.0)[..., None]
    vectors = np.full((*values.shape[:-1], 2), np.nan + 0j)
    vectors[spanned] = np.linalg.solve(gram[spanned], moment[spanned])[..., :2, 0]
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
        return channels_vector([self.channels[k] for k in places], values[..., places])


def zero_uncertainty(channels: Iterable[Channel], quantity: str) -> FloatArray:
    """Standard uncertainty of a quantity's zero along X and Y (2,) [SI], from what the manifest states."""
    chosen = [c for c in channels if c.quantity == quantity and c.axis is not None]
    if len(chosen) < 2:
        return np.zeros(2)
    inverse = inverse_directions(chosen)
    return np.sqrt(inverse**2 @ np.array([c.zero_uncertainty for c in chosen]) ** 2)
