"""Pivot curves of virtual campaigns and of the samples: errors, coverage, contact onset, refusals.

The virtual rig knows nothing of `tpjb_ident`; its laws are given here as plain functions.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import trapezoid

from rigdata.campaign import Campaign, load_campaign
from rigdata.problem import RigDataError
from rigdata.virtual_rig import (
    CampaignTruth,
    ClearanceSweep,
    DryTest,
    Fault,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    VirtualRig,
    write_campaign,
)
from tests.good_campaigns import SAMPLES, sample
from tpjb_ident.clearance.locus import measure_locus
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.fit import fit_pivots

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
LOADS = np.array([1000.0, 2000.0, 4000.0])
CONTACT_LOAD = 500.0
CONTACT_TOLERANCE = 0.05
#: Load programmes, one test each; `dataclasses.replace` gives them another pad.
PROGRAMMES = {
    "down": DryTest(1, branch="down"),
    "cycle": DryTest(1, branch="cycle"),
    "unequal": DryTest(1, hold=(0.5, 2.0, 1.0, 0.6, 3.0, 1.0, 0.8, 1.5, 0.5, 2.0), overshoot=0.1, load_drift=-0.003),
    "few": DryTest(1, levels=(1000.0, 2500.0, 5000.0), hold=3.0, ramp=1.0),
    "ramp": DryTest(1, levels=(5000.0,), hold=0.1, ramp=12.0),
}


class Law(NamedTuple):
    """Deflection [m] and tangent compliance [m/N] under a load [N]."""

    deflection: Callable[[np.ndarray], np.ndarray]
    compliance: Callable[[np.ndarray], np.ndarray]


def line(f: float = 1.0, housing: float = 0.0) -> Law:
    """Rocker: the printed formula's shape, softer by `f`, with a housing of compliance `housing` in series."""
    c = 7.0e-11 / f
    return Law(
        lambda load: c * load * (18.95 - np.log(np.maximum(load, 1e-6))) + housing * load,
        lambda load: c * (17.95 - np.log(load)) + housing,
    )


def sphere(f: float = 1.0, housing: float = 0.0) -> Law:
    """Point contact, with a housing of compliance `housing` in series."""
    c = 6.03e-8 / f
    return Law(
        lambda load: c * np.cbrt(load) ** 2 + housing * load, lambda load: c * 2.0 / 3.0 / np.cbrt(load) + housing
    )


#: Two contacts one after the other.
PLAY = Law(
    lambda load: 3e-9 * np.minimum(load, 1500.0) + 1.5e-9 * np.maximum(load - 1500.0, 0.0),
    lambda load: np.where(load < 1500.0, 3e-9, 1.5e-9),
)


#: Compliance of the housing, and the law of its pivots.
KINDS = {
    "rocker": (line, 0.0),
    "rocker on housing": (line, 3e-10),
    "sphere": (sphere, 0.0),
    "sphere on housing": (sphere, 5e-10),
}


def bearing(kind: str, seed: int) -> list[Law]:
    """Five laws of one make, each pad with a stiffness of its own."""
    law, housing = KINDS[kind]
    return [law(f, housing) for f in np.random.default_rng(seed).uniform(0.3, 1.0, 5)]


def campaign(path: Path, laws: Sequence[Law], seed: int, **changes) -> tuple[Campaign, CampaignTruth]:
    """Write a campaign with dry tests and open it; gives its truth too."""
    truth = RigTruth.constant(
        np.diag([2e8, 4e8]), np.diag([4e5, 6e5]), pivot_deflection=lambda pad, load: laws[pad - 1].deflection(load)
    )
    dry = changes.pop("dry", tuple(DryTest(p) for p in range(1, 6)))
    usual = {"instruments": Instruments.like_paper(seed=seed), "noise": Noise.like_samples(), "seed": seed}
    rig = VirtualRig(truth, RigPlan(dry=dry, clearance=changes.pop("clearance", ())), **usual | changes)
    path.unlink(missing_ok=True)
    written = write_campaign(path, rig)
    return load_campaign(path), written


def fitted(path: Path, laws: Sequence[Law], seed: int, **changes) -> tuple[PivotCurve, ...]:
    """The curves of such a campaign."""
    return fit_pivots(campaign(path, laws, seed, **changes)[0], ANGLES)


def true_onset(law, gap: float) -> float:
    """Load from which the contact loss adds less than 5 % to the compliance [N]."""
    load = np.linspace(20.0, 7000.0, 70_000)
    missing = gap / CONTACT_LOAD * np.exp(-load / CONTACT_LOAD) > CONTACT_TOLERANCE * law.compliance(load)
    return float(load[missing].max())


def errors_within(curve, law, spreads):
    """Errors of the stiffness at `LOADS`, each within so many of its stated standard errors."""
    error = np.log(curve.stiffness(LOADS) * law.compliance(LOADS))
    assert np.all(np.abs(error) < spreads * curve.relative_stiffness_se(LOADS))
    return np.abs(error)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rocker", "sphere"])
def test_one_campaign(tmp_path, kind):
    laws = bearing(kind, 1)
    source, truth = campaign(tmp_path / "c.h5", laws, 1)
    curves = fit_pivots(source, ANGLES)
    assert [c.pad for c in curves] == [1, 2, 3, 4, 5]
    for curve, law in zip(curves, laws, strict=True):
        assert curve.law.name == {"rocker": "hertz-line", "sphere": "hertz-point"}[kind]
        errors_within(curve, law, 4)
        facts = truth["runs"][f"p-{curve.pad}-up"]
        stated = np.radians(facts["load_direction_error_deg"])
        assert abs(curve.load_direction.angle - stated) < 5 * curve.load_direction.se + 1e-3
        upper = curve.pad in (3, 4)
        assert (curve.onset_load > 0.0) is upper
        assert ("contact-incomplete" in curve.status) is upper
        if upper:
            assert curve.onset_load == pytest.approx(true_onset(law, facts["contact_gap_m"]), rel=0.2)
            assert curve.valid_from == curve.onset_load


@pytest.mark.slow
def test_errors_and_coverage(tmp_path):
    kinds = ["rocker", "rocker on housing", "sphere", "sphere on housing"]
    errors, scores, onsets, beyond = [], [], [], []
    for seed in range(12):
        laws = bearing(kinds[seed % 4], 100 + seed)
        source, truth = campaign(tmp_path / "c.h5", laws, 100 + seed)
        for curve, law in zip(fit_pivots(source, ANGLES), laws, strict=True):
            error = np.log(curve.stiffness(LOADS) * law.compliance(LOADS))
            errors.append(error)
            scores.append(error / curve.relative_stiffness_se(LOADS))
            top = np.log(curve.stiffness(8000.0) * law.compliance(8000.0)) / curve.relative_stiffness_se(8000.0)
            beyond.append(abs(float(top)) < 1.96)
            if curve.pad in (3, 4):
                gap = truth["runs"][f"p-{curve.pad}-up"]["contact_gap_m"]
                onsets.append(curve.onset_load / true_onset(law, gap) - 1.0)
    errors, inside = np.abs(errors), np.abs(scores) < 1.96
    assert np.all(np.median(errors, axis=0) < 0.03)
    # 180 values from 60 independent curves: two standard errors of a share of 0.95 are 0.05
    assert 0.91 < inside.mean() < 0.995
    assert np.mean(beyond) > 0.88
    assert np.median(np.abs(onsets)) < 0.10
    assert np.mean(np.abs(onsets) < 0.25) > 0.9


SHORT = tuple(DryTest(p, levels=tuple(800.0 * (i + 1) for i in range(6)), hold=0.6) for p in range(1, 6))
MUST_REFUSE = (
    *(Fault("swapped", f"p-{run}", "X1A", other="X1B") for run in ("2-up", "3-up", "4-up", "5-up", "*")),
    *(Fault("swapped", f"p-{run}", "L1H", other="L1V") for run in ("1-up", "2-up", "3-up", "4-up", "5-up", "*")),
    *(Fault("inverted", "p-1-up", channel) for channel in ("X1A", "X1B", "L1V")),
    *(Fault("wrong_pad", "p-1-up", value=pad) for pad in range(2, 6)),
    *(Fault("wrong_pad", f"p-{pad}-up", value=pad % 5 + 1) for pad in range(2, 6)),
    *(Fault("inverted", f"p-{pad}-up", channel) for pad, channel in ((2, "X1A"), (4, "L1V"), (5, "X1B"))),
    Fault("dead", "p-2-up", "X1A"),
    Fault("stuck", "p-1-up", "X1B", start=3.0),
    Fault("clipped", "p-4-up", "L1V"),
)


@pytest.mark.slow
def test_records_that_are_not_what_they_claim_are_refused(tmp_path):
    laws = bearing("rocker", 7)
    good, _ = campaign(tmp_path / "c.h5", laws, 7, dry=SHORT)
    assert len(fit_pivots(good, ANGLES)) == 5
    for fault in MUST_REFUSE:
        struck = tuple(test for test in SHORT if fault.affects(f"p-{test.pad}-up"))
        spoilt, _ = campaign(tmp_path / "spoilt.h5", laws, 7, dry=struck, faults=(fault,))
        runs = {run.id: run for run in (*good.runs, *spoilt.runs)}
        source = replace(good, runs=tuple(runs.values()))
        with pytest.raises(RigDataError, match=r"wrong (pad|channel|angle)|stuck, clipped or dead") as caught:
            fit_pivots(source, ANGLES)
        assert all(p.run and p.cure for p in caught.value.problems), fault


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", [Fault("swapped", "p-1-up", "X1A", other="X1B"), Fault("inverted", "p-1-up", "L1H")], ids=lambda f: f.kind
)
def test_mistakes_on_the_mirror_line_change_nothing_along_the_pad(tmp_path, fault):
    laws = bearing("rocker", 7)
    # probes that read the same at the bearing centre: where the shaft stands says nothing of an exchange
    given = {"dry": SHORT, "instruments": Instruments.like_paper()}
    spoilt, clean = (fitted(tmp_path / "c.h5", laws, 7, faults=faults, **given)[0] for faults in ((fault,), ()))
    assert spoilt.stiffness(LOADS) == pytest.approx(clean.stiffness(LOADS), rel=4e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMMES)
def test_any_load_programme(tmp_path, name):
    law = sphere(0.8)
    (curve,) = fitted(tmp_path / "c.h5", [law] * 5, 11, dry=(PROGRAMMES[name],))
    assert curve.law.name == "hertz-point"
    assert errors_within(curve, law, 4).max() < 0.03
    assert ("no-holds" in curve.status) is (name == "ramp")
    assert (curve.hysteresis is not None) is (name == "cycle")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rocker", "sphere on housing"])
def test_ramps_of_all_pads_are_not_taken_for_drift(tmp_path, kind):
    """Load and time grow together on a ramp: a drift learnt from it would eat the pivots' compliance."""
    laws = bearing(kind, 4003)
    dry = tuple(replace(PROGRAMMES["ramp"], pad=pad) for pad in range(1, 6))
    for curve, law in zip(fitted(tmp_path / "c.h5", laws, 4003, dry=dry), laws, strict=True):
        assert errors_within(curve, law, 3.5)[1:].max() < 0.06


RUBBING = replace(Noise.like_samples(), dry=replace(Noise.like_samples().dry, friction=0.03))


def test_friction_shows_as_a_loop_and_is_taken_off(tmp_path):
    law = sphere()
    (curve,) = fitted(tmp_path / "c.h5", [law] * 5, 5, dry=(DryTest(1, branch="cycle"),), noise=RUBBING)
    assert curve.law.theta[1] == pytest.approx(0.03, abs=0.004)
    assert curve.stiffness(LOADS) == pytest.approx(1.0 / law.compliance(LOADS), rel=0.02)
    load = np.linspace(500.0, 4500.0, 400)
    width = law.deflection(1.03 * load) - law.deflection(0.97 * load)
    assert curve.hysteresis.energy == pytest.approx(trapezoid(width, load), rel=0.2)


@pytest.mark.slow
def test_up_and_down_in_two_runs_make_one_curve(tmp_path):
    law = sphere()
    tests = (DryTest(1), DryTest(1, branch="down"))
    (curve,) = fitted(tmp_path / "c.h5", [law] * 5, 6, dry=tests, noise=RUBBING)
    assert curve.runs == ("p-1-up", "p-1-down")
    assert set(curve.steps.branch) == {1, -1}
    assert curve.stiffness(LOADS) == pytest.approx(1.0 / law.compliance(LOADS), rel=0.03)
    errors_within(curve, law, 4)
    assert curve.hysteresis is not None


def test_a_long_false_load_is_left_out(tmp_path):
    law = line(0.4)
    knock = Fault("glitch", "p-1-up", "L1V", value=3000.0, start=5.2, length=0.3)
    (curve,) = fitted(tmp_path / "c.h5", [law] * 5, 21, dry=(DryTest(1),), faults=(knock,))
    assert errors_within(curve, law, 4)[1:].max() < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rocker", "sphere", "sphere on housing"])
def test_clearance_has_no_bias_of_its_own(tmp_path, kind):
    """Without noise what is left is the method's own: slides, slow approaches to corners, the give's extrapolation."""
    laws = bearing(kind, 1002)
    source, _ = campaign(tmp_path / "c.h5", laws, 1002, noise=Noise.none(), clearance=(ClearanceSweep(),))
    found = measure_clearance(source, ANGLES, fit_pivots(source, ANGLES))
    assert np.abs(found.clearance - 80e-6).max() < 0.04e-6


@pytest.mark.slow
@pytest.mark.parametrize(("odd", "law"), [(PLAY, "bilinear"), (sphere(0.6, 3e-9), "point-in-series")])
def test_a_pad_of_its_own_kind_keeps_its_own_law(tmp_path, odd, law):
    laws = bearing("sphere on housing", 1)
    laws[1] = odd
    curve = fitted(tmp_path / "c.h5", laws, 1)[1]
    assert curve.law.name == law
    errors_within(curve, odd, 3)


@pytest.mark.slow
def test_clearance_over_seeds(tmp_path):
    misses = []
    for seed in range(4):
        laws = bearing("sphere" if seed % 2 else "rocker", 300 + seed)
        source, _ = campaign(tmp_path / "c.h5", laws, 300 + seed, clearance=(ClearanceSweep(),))
        found = measure_clearance(source, ANGLES, fit_pivots(source, ANGLES))
        misses.append(found.clearance - 80e-6)
    assert np.abs(misses).max() < 0.5e-6
    assert np.sqrt(np.mean(np.square(misses))) < 0.15e-6


@pytest.mark.slow
@pytest.mark.samples
@pytest.mark.parametrize("name", ["rocker-baseline", "rocker-measured-pivots", "spherical-baseline"])
def test_samples(name):
    truth = json.loads((SAMPLES / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    source = load_campaign(sample(name))
    curves = fit_pivots(source, ANGLES)
    errors = []
    for curve, true in zip(curves, truth["pivot_curves"], strict=True):
        stiffness = np.interp(LOADS, true["force_N"], true["stiffness_N_per_m"])
        error = np.log(curve.stiffness(LOADS) / stiffness)
        errors.append(error)
        deviation = curve.relative_stiffness_se(LOADS)
        assert np.all(np.abs(error) < 2.6 * deviation)
        # 5 %, where the record can tell that: probes that wander leave 3 % of one campaign
        assert np.all(np.abs(error) < np.maximum(0.05, 2.0 * deviation))
    assert np.median(np.abs(errors)) < 0.03
    polygon = measure_clearance(source, ANGLES, curves)
    assert polygon.clearance == pytest.approx(np.array(truth["clearance_cold_m"]), abs=0.5e-6)
    gaps = np.array(truth["gap_voltage_V"]) / 7780.0
    centre = np.array([-gaps[0] + gaps[1], -gaps[0] - gaps[1]]) / np.sqrt(2.0)
    assert polygon.centre == pytest.approx(centre, abs=0.5e-6)
    places = {round(p["static_load_direction_deg"]) % 360: (p["x_m"], p["y_m"]) for p in truth["locus"]}
    for point in measure_locus(source, polygon).points:
        there = places[round(point.point.static_load_direction_deg) % 360]
        assert point.position == pytest.approx(np.array(there), abs=0.6e-6)
