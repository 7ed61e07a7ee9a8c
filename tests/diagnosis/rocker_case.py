"""The rocker bearing on a coarse mesh, what a campaign would show of it, and that with noise."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import around, dry, dynamic

ROCKER = Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml"
SPEED = 2 * math.pi * 22
LINE = 2 * math.pi * 25


def rocker_setup(mesh: Mesh | None = None, **options) -> Setup:
    bearing = load_bearing(ROCKER)
    return Setup(bearing, pivot_laws("kirk", bearing), mesh=mesh or Mesh(24, 4), **options)


def points(loads: Sequence[float], pads: int = 0, excitations: Sequence[float] = (LINE,)):
    """Dynamic tests, load downward, with thermometers on `pads` pads."""
    return dynamic(loads, excitations, SPEED, -math.pi / 2, pads)


def whole_layout(
    loads: Sequence[float], frequencies: Sequence[float] = (15.0, 25.0, 35.0, 45.0), sweep_first: bool = True
) -> Layout:
    """Frequencies [Hz] at 5 kN, other loads at 25 Hz, a locus, every pad dry, a polygon; noise goes by their order."""
    sweep, steps = points([5000.0], 5, [2 * math.pi * f for f in frequencies]), points(loads, 5)
    dynamic_points = (*sweep, *steps) if sweep_first else (*steps, *sweep)
    return Layout(dynamic_points, around(5000.0, 5, SPEED), dry(range(1, 6)), 200.0)


def noisy(planned, value, seed: int):
    """Observations that show `value` with the noise they have."""
    noise = np.sqrt(np.diag(planned.covariance)) * np.random.default_rng(seed).standard_normal(len(planned))
    return replace(planned, value=value + noise)
