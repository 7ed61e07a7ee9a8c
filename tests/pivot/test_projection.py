"""Projection on a pad's axes, and directions with their standard errors against draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.pivot.test_assemble import on_pad, vectors
from tpjb_ident.pivot.dry_record import PadDirection, displacement_direction, load_direction

LOADS = np.linspace(100.0, 3000.0, 24)
HOLDS = np.repeat(np.arange(8), 3)


def blocks(load, displacement, hold=HOLDS, angle=0.0):
    return on_pad(angle, load, displacement, hold, np.ones(len(load)))


def white(scale):
    return SimpleNamespace(covariance=lambda time, duration: scale**2 * np.eye(len(time)))


def test_without_motion_there_is_no_direction():
    some = blocks(vectors(0.0, LOADS), np.zeros((len(LOADS), 2)))
    assert displacement_direction(some, white(1e-7)) == PadDirection(0.0, math.inf)


def test_the_stated_error_is_that_of_the_draws():
    scale, drawn = 2e-7, []
    for seed in range(300):
        noise = scale * np.random.default_rng(seed).standard_normal((len(LOADS), 2))
        some = blocks(vectors(0.3, LOADS), vectors(0.35, 2e-9 * LOADS) + noise, angle=0.3)
        drawn.append(displacement_direction(some, white(scale)))
    angles, errors = np.array([[d.angle, d.se] for d in drawn]).T
    assert np.mean(angles) == pytest.approx(0.05, abs=4 * np.std(angles) / math.sqrt(300))
    # by hand: the slope across scatters by scale / (root of the sum of squares of the loads about their mean)
    by_hand = scale / math.sqrt(np.sum((LOADS - LOADS.mean()) ** 2)) / 2e-9
    assert np.std(angles) == pytest.approx(by_hand, rel=0.15)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(by_hand, rel=0.1)


def test_blocks_of_one_hold_count_as_one():
    rng = np.random.default_rng(4)
    scattered = vectors(0.0, LOADS) + rng.standard_normal((len(LOADS), 2))
    displacement = np.zeros((len(LOADS), 2))
    alone = blocks(scattered, displacement, np.arange(len(LOADS)))
    shared = blocks(scattered, displacement, HOLDS)
    between = blocks(scattered, displacement, np.full(len(LOADS), -1))
    errors = [load_direction(b).se for b in (alone, shared, between)]
    assert errors[1] / errors[0] == pytest.approx(math.sqrt(3.0))
    assert errors[2] / errors[0] == pytest.approx(math.sqrt(len(LOADS) / 3.0))
