"""A dynamic stiffness and circular noise, for exact limits of estimates made by hand."""

import math

import numpy as np

from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.operating_point import OperatingPoint
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.phasors.lines import known_lines
from tpjb_ident.phasors.run_data import RunPhasors

H = np.array([[2.0 + 0.7j, 0.3 - 0.2j], [-0.4 - 0.2j, 1.5 + 0.9j]])


def vector_channels(quantities: tuple[str, ...] = VECTOR_QUANTITIES) -> tuple[Channel, ...]:
    """Channels along X and Y of some quantities: what stands for vectors that were never channels."""
    names = [(quantity, axis) for quantity in quantities for axis in (0, 1)]
    return tuple(Channel(f"{quantity} {'xy'[axis]}", quantity, axis=axis * np.pi / 2) for quantity, axis in names)


def complex_normal(rng, *shape):
    """Circular, unit power per component."""
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


#: Of a film [N/m], at the frequency of `run`.
FILM_H = np.array([[2.1e8 + 6.3e7j, 2.0e7 + 3.1e6j], [-1.5e7 + 1.6e6j, 5.0e8 + 9.4e7j]])
OMEGA = 2 * np.pi * 25.0
WINDOWS = 6


def run(name: str, direction: float, force: float = 500.0, h=FILM_H, load: float = 5000.0, seed: int = 0):
    """A run of six windows, F = h D but for a little noise."""
    rng = np.random.default_rng([seed, round(1e3 * direction)])
    noise = rng.standard_normal((WINDOWS, 4)) + 1j * rng.standard_normal((WINDOWS, 4))
    F = force * np.array([np.cos(direction), np.sin(direction)]) + 0.1 * noise[:, :2]
    D = np.linalg.solve(h, F.T).T + 1e-9 * noise[:, 2:]
    return run_phasors(name, direction, load, D, F, (0.0, -load))


def run_phasors(name: str, direction: float, load: float, D, F, mean_force, channels=None) -> RunPhasors:
    """A run of six windows at 25 Hz, from phasors (6, 2) and mean force [N]; channels along X and Y, or others."""
    channels = channels or vector_channels(("displacement", "force"))
    axes = np.array([c.axis for c in channels])
    along = np.stack([np.cos(axes), np.sin(axes)], axis=1)
    probes = np.array([c.quantity == "displacement" for c in channels])
    z = np.where(probes, D @ along.T, F @ along.T)[:, None]
    mean = np.tile(along @ mean_force, (WINDOWS, 1))
    noise = np.full((WINDOWS, len(channels)), 1e-9)
    start = 0.25 * np.arange(WINDOWS)
    parts = (tuple(channels), z, mean, noise, np.zeros_like(noise), 30.0)
    return RunPhasors(name, place(load), direction, known_lines((25.0,), 22.0, 1000.0), start, 0.25, *parts)


def place(load: float = 5000.0, direction: float = -90.0, speed: float = 22.0, excitation: float = 25.0):
    """An operating point: N, degrees, Hz, Hz."""
    return OperatingPoint(load, math.radians(direction), 2 * math.pi * speed, 2 * math.pi * excitation)


def stiff(h=H, omega: float = 160.0, covariance=None, dof: float = np.inf, **more) -> DynamicStiffness:
    """An estimate with this answer; by default each of its eight parts has variance one, known for certain."""
    spread = np.eye(8) if covariance is None else covariance
    return DynamicStiffness(np.asarray(h, dtype=complex), omega, spread, np.full(8, dof), "mm", np.ones((3, 2)), **more)


def hermitian(rng, n):
    root = complex_normal(rng, n, n)
    return root @ root.conj().T + 0.3 * np.eye(n)


NOISE = 1e-3 * hermitian(np.random.default_rng(20), 4)


def windows(seed, g=6, n=40, noise=NOISE):
    """Windows in g directions, n each, with such noise."""
    rng = np.random.default_rng(seed)
    D = np.repeat(complex_normal(rng, g, 2), n, axis=0)
    z = np.concatenate([D, D @ H.T], axis=1) + complex_normal(rng, g * n, 4) @ np.linalg.cholesky(noise).T
    return phasor_table(z[:, :2], z[:, 2:], np.repeat(np.arange(g), n))
