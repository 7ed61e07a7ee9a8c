"""Sweeps of other hands and loggers: a shaft against springs, in closed steps, by no program of this project."""

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.problem import RigDataError
from rigdata.vector import directions
from tests.clearance.cases import ANGLES
from tests.manifests import PROBES_AND_CELLS, manifest, write_files
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.clearance.sweep import _settled

PUSH, CENTRE = 300.0, (40e-6, -25e-6)


def pushed(force, clearance, stiffness):
    """Place (n, 2) of a shaft that pads of (k,) clearances hold, pivots as the power 1.5 of their deflection."""
    normals, spring = directions(ANGLES), PUSH / (PUSH / stiffness) ** 1.5
    place = np.outer(np.ones(len(force)), [0.0, 0.0])
    for _ in range(200):
        over = np.maximum(place @ normals.T - clearance, 0.0)
        missing = force - spring * over**1.5 @ normals
        tangent = np.einsum("nk,ki,kj->nij", 1.5 * spring * np.sqrt(over), normals, normals) + 1e4 * np.eye(2)
        step = np.linalg.solve(tangent, missing[:, :, None])[:, :, 0]
        place += step * np.minimum(1.0, 5e-6 / np.maximum(np.linalg.norm(step, axis=1), 1e-30))[:, None]
    return place


def sweep(
    folder,
    rate=50.0,
    seconds=60.0,
    turns=1.0,
    steps=0,
    noise=0.2e-6,
    stiffness=3e8,
    runout=0.0,
    off=0.0,
    last=0.0,
    step=0,
    lag=0.0,
    untared=0.0,
):
    """A campaign of one sweep, and the pads' clearances (5,) [m]; `step` [m] of the probes' converter.

    A shaft that rubs on both pads of its corner lies as under a load turned back by the angle of friction, `lag`.
    """
    rng = np.random.default_rng(20)
    time = np.arange(seconds * rate) / rate
    share = time / time[-1]
    angle = -0.5 * np.pi + 2 * np.pi * turns * (
        np.minimum(np.floor(share * steps), steps - 1) / steps if steps else share
    )
    force = PUSH * np.column_stack([np.cos(angle), np.sin(angle)])
    clearance = 80e-6 + np.array([0.0, off, 0.0, 0.0, last])
    felt = PUSH * np.column_stack([np.cos(angle - lag), np.sin(angle - lag)])
    probes = (pushed(felt, clearance, stiffness) + CENTRE) @ directions(np.radians([45.0, 135.0])).T
    probes += runout * np.column_stack([np.sin(33.0 * share + 0.3), np.cos(33.0 * share + 0.3)])
    probes += noise * rng.standard_normal(probes.shape)
    probes = np.round(probes / step) * step if step else probes
    cells = force + untared * np.array([1.0, -0.7]) + 3.0 * rng.standard_normal(force.shape)
    columns = np.column_stack([1e6 * probes, cells])
    np.savetxt(folder / "c-1.csv", columns, "%.6g", delimiter=",", header=",".join(PROBES_AND_CELLS), comments="")
    run = {"id": "c-1", "file": "c-1.csv", "kind": "clearance", "static_load": "300 N"}
    text = manifest(PROBES_AND_CELLS, run, acquisition={"sample_rate": f"{rate:g} Hz"})
    return load_campaign(write_files(folder, text)), clearance


GOOD = {
    "continuous": {},
    "one pad off": {"off": 12e-6},
    "holds of 15 deg": {"steps": 24},
    "nine tenths of a turn": {"turns": 0.9},
    "a reading a second": {"rate": 1.0, "seconds": 240.0},
    "holds, two readings a second": {"rate": 2.0, "seconds": 180.0, "steps": 36},
    "noise of 3 um": {"noise": 3e-6},
    "soft pivots": {"stiffness": 3e7},
    "very soft pivots, by which pads look untouched at first": {"stiffness": 2e7},
    "a converter of 5 um": {"noise": 5e-8, "step": 5e-6},
    "cells that read more at no load than under the push": {"untared": 300.0},
    "a shaft that rubs": {"lag": 0.15},
    "a shaft that rubs the other way": {"lag": -0.1},
}


@pytest.mark.parametrize("name", GOOD)
def test_clearances_of_unusual_sweeps_lie_in_their_intervals(tmp_path, name):
    campaign, clearance = sweep(tmp_path, **GOOD[name])
    measured = measure_clearance(campaign, ANGLES)
    assert np.all(np.abs(measured.clearance - clearance) < 3.0 * measured.clearance_se)
    coarse = GOOD[name].get("step", 0.0)
    assert np.all(measured.clearance_se < np.maximum(0.5e-6, 0.5 * coarse))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("turns its load through", {"turns": 0.6}),
        ("their zero walks", {"runout": 3e-6}),
        ("their zero walks", {"runout": 2e-5}),
    ],
)
def test_a_half_turn_and_a_shaft_that_was_turned_are_refused(tmp_path, name, change):
    campaign, _ = sweep(tmp_path, **change)
    with pytest.raises(RigDataError, match=name):
        measure_clearance(campaign, ANGLES)


def test_two_of_five_pads_that_deviate_leave_the_centre_open(tmp_path):
    """A centre elsewhere explains the sweep with other deviations; they are right but for a shift of all."""
    campaign, clearance = sweep(tmp_path, off=9e-6, last=-7e-6)
    measured = measure_clearance(campaign, ANGLES)
    (text,) = [condition.detail for condition in measured.status if condition == "pads-not-separable"]
    assert "all pads may be off" in text
    error, normals = measured.clearance - clearance, directions(ANGLES)
    shift = np.linalg.lstsq(normals, error, rcond=None)[0]
    assert np.abs(error - normals @ shift).max() < 0.2e-6


def test_a_shaft_that_stands_still_on_its_way_is_in_no_corner():
    """Within five micrometres of a pad it seems to touch it; its clearance came out two micrometres short."""
    rng, time = np.random.default_rng(3), 0.1 * np.arange(60)
    place = 1e-7 * rng.standard_normal((60, 2))
    place[:6] += [4e-6, 3e-6]
    touched = np.zeros((60, 5), dtype=bool)
    touched[:, 1:3] = True
    settled = _settled(time, place, touched)
    assert not settled[:6].any()
    assert settled[10:].mean() > 0.7
