"""What a sweep tells of cells and probes: an ellipse for a circle, ways along the pads, and where runs begin."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.vector import directions
from rigdata.virtual_rig import ClearanceSweep, DryTest, Fault, Instruments, Noise, RigPlan, RigTruth, VirtualRig
from tests.pivot.test_assemble import record
from tpjb_ident.pivot import sweep_witness as sweep_witness_module
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.pivot.sweep_witness import (
    SweepWitness,
    cell_errors,
    probe_errors,
    probes_of,
    push_circle,
    sweep_witness,
    witness_of,
)

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
AROUND = np.linspace(0.0, 2.0 * np.pi, 3000)
CLEARANCE = 8e-5
DOUBTS = {"cells-differ", "probe-gains-differ", "probe-turned", "starts-elsewhere", "shaft-slipped"}


@pytest.mark.parametrize("axes", [(0.0, 0.5 * np.pi), (0.4, 1.6), (1.6, 0.4)])
@pytest.mark.parametrize("zero", [(0.0, 0.0), (300.0, -200.0)])
@pytest.mark.parametrize(("gain", "turn"), [(1.0, 0.0), (0.9, 0.0), (1.0, 0.08), (1.2, -0.06)])
def test_a_push_that_goes_around_shows_zero_gains_and_axes_of_the_cells(axes, zero, gain, turn):
    stated, true = directions(axes), directions([axes[0], axes[1] + turn])
    readings = 200.0 * directions(AROUND) @ true.T * [gain, 1.0]
    circle = push_circle(np.linalg.solve(stated, readings.T).T + zero)
    np.testing.assert_allclose(circle.zero, zero, atol=1e-6)
    assert circle.scatter == pytest.approx(0.0, abs=1e-9)
    errors = cell_errors(circle, np.array(axes), np.zeros(2))
    np.testing.assert_allclose(errors.real, np.log(gain) * np.array([1.0, -1.0]), atol=1e-9)
    np.testing.assert_allclose(errors.imag, 0.5 * turn * np.array([-1.0, 1.0]), atol=1e-9)


def test_a_line_is_no_circle():
    assert push_circle(np.outer(np.linspace(-1.0, 1.0, 50), [3.0, 4.0])) is None


def swept(angles=ANGLES):
    """Load and place of a shaft that lies in the corners, without any friction."""
    pads = np.sort(np.mod(angles, 2.0 * np.pi))
    middle = pads + 0.5 * np.diff(pads, append=pads[0] + 2.0 * np.pi)
    sides = np.stack([directions(pads), directions(np.roll(pads, -1))], axis=1)
    corners = np.linalg.solve(sides, np.full((len(pads), 2, 1), CLEARANCE))[..., 0]
    nearest = np.argmax(np.cos(AROUND[:, None] - middle), axis=1)
    return 200.0 * directions(AROUND), corners[nearest]


@pytest.mark.parametrize("axes", [(0.25 * np.pi, 0.75 * np.pi), (0.3, 1.5)])
@pytest.mark.parametrize(
    ("gain", "turned"), [(0.0, (0.0, 0.0)), (0.05, (0.0, 0.0)), (0.0, (0.0, -0.3)), (0.1, (0.1, 0.0))]
)
def test_ways_along_the_pads_show_gains_and_axes_of_the_probes(axes, gain, turned):
    axes, (load, place) = np.array(axes), swept()
    rows = directions(axes + turned) * np.exp([[gain], [0.0]])
    errors = probe_errors(load, np.linalg.solve(directions(axes), rows @ place.T).T, ANGLES, axes)
    np.testing.assert_allclose(errors.real, [gain, -gain], atol=2e-3)
    np.testing.assert_allclose(errors.imag, turned, atol=2e-3)


def test_three_pads_and_a_frame_that_turns_as_a_whole_tell_nothing_of_probes():
    axes = np.array([0.25, 0.75]) * np.pi
    load, place = swept()
    assert not probe_errors(load, place @ directions([0.1, 0.1 + 0.5 * np.pi]), ANGLES, axes).any()
    assert not probe_errors(load, place * [1.0, -1.0], ANGLES, axes).any()  # exchanged or reversed: that is refused
    assert not probe_errors(*swept(ANGLES[:3] * 5 / 3), ANGLES[:3] * 5 / 3, axes).any()


@pytest.mark.parametrize("zero", [(0.0, 0.0), (2e-5, -1e-5)])
@pytest.mark.parametrize("gain", [1.0, 0.9])
def test_a_run_that_begins_elsewhere_is_told_from_a_zero_that_moved(zero, gain):
    runs = []
    for pad, angle in enumerate(ANGLES, 1):
        one = record(pad)
        start = (CLEARANCE + directions([angle])[0] @ zero) * (gain if pad == 2 else 1.0)
        blocks = replace(one.blocks, deflection=one.blocks.deflection - one.blocks.deflection.min() + start)
        runs.append(replace(one, blocks=blocks))
    witness = SweepWitness({}, {}, (), swept()[1], probes_of(runs[0].run))
    shares = [one.elsewhere for one in witness.held_against(runs)]
    away = (gain - 1.0) * (1.0 + directions(ANGLES[1:2])[0] @ zero / CLEARANCE)
    np.testing.assert_allclose(shares, [0.0, away, 0.0, 0.0, 0.0], atol=1e-3)


@pytest.mark.parametrize("off", [0.036, -0.02])
@pytest.mark.parametrize("gain", [0.0, 0.15])
def test_probes_along_right_angled_pads_show_no_gain_and_those_in_between_do(gain, off):
    """A pad that stood 2 deg elsewhere read as a gain of 850 %: what pads as drawn would show of it is nothing."""
    stated = 0.25 * np.pi + 0.5 * np.pi * np.arange(4)
    for axes, shown, actual in (
        (np.array([0.25, 0.75]) * np.pi, 0.0, stated + np.array([0.0, off, 0.0, 0.001])),
        (np.array([0.0, 0.5]) * np.pi, gain, stated),
    ):
        load, place = swept(actual)
        rows = directions(axes) * np.exp([[gain], [0.0]])
        errors = probe_errors(load, np.linalg.solve(directions(axes), rows @ place.T).T, stated, axes)
        np.testing.assert_allclose(errors, np.array([shown, -shown]), atol=3e-3)


def test_a_sweep_that_does_not_go_around_tells_not_where_runs_begin(monkeypatch):
    """A pad that half a turn had left out was said to begin elsewhere by 80 % of the clearance."""
    load, place = swept()
    run = record(1).run
    for part, probes in ((AROUND >= 0.0, probes_of(run)), (np.pi > AROUND, ())):
        vectors = load[part], place[part]
        monkeypatch.setattr(sweep_witness_module, "_good_vectors", lambda run, vectors=vectors: vectors)
        assert witness_of(run, ANGLES).probes == probes
        assert witness_of(run, ANGLES[:0]).probes == probes_of(run)  # pads that nobody states


PLAN = RigPlan(
    clearance=(ClearanceSweep(),), dry=tuple(DryTest(pad, levels=(1e3, 2e3, 3e3, 4e3, 5e3)) for pad in range(1, 6))
)


def rig(seed, *faults):
    truth = RigTruth.constant(
        np.diag([2e8, 4e8]),
        np.diag([4e5, 6e5]),
        pivot_deflection=lambda pad, load: 4e-9 * load,
        clearance=(CLEARANCE,) * 5,
    )
    instruments, noise = Instruments.like_paper(seed=seed), Noise.like_samples()
    return VirtualRig(truth=truth, plan=PLAN, seed=seed, instruments=instruments, noise=noise, faults=faults)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (Fault("scaled", channel="L1H", value=0.9), "cells-differ"),
        (Fault("scaled", channel="L1V", value=1.07), "cells-differ"),
        (Fault("scaled", channel="X1A", value=1.06), "probe-gains-differ"),
    ],
)
def test_curves_of_sensors_that_the_sweep_contradicts_hold(campaign_of, fault, says):
    """Not told, the stiffness of some pad was off by all of the gain, at an interval of 2 or 3 %."""
    curves = fit_pivots(load_campaign(campaign_of(rig(5, fault))), ANGLES)
    for curve in curves:
        assert DOUBTS.intersection(curve.status) == {says}
        lo, hi = curve.stiffness_band([2000.0, 4000.0])
        assert np.all((lo < 2.5e8) & (hi > 2.5e8))


def test_good_campaigns_are_not_doubted(campaign_of):
    for seed in range(1, 5):
        source = load_campaign(campaign_of(rig(seed)))
        assert sweep_witness(source, ANGLES).channels == {}
        assert all(not DOUBTS.intersection(curve.status) for curve in fit_pivots(source, ANGLES))
