"""Every term: what is wrong with an instrument is told where the records tell it, and else stands in the interval."""

from dataclasses import replace

import numpy as np
import pytest

from tests.estimate import block_cases
from tests.estimate.block_cases import (
    COMPLIANCE,
    Case,
    away,
    deviations,
    drawn_turning,
    made,
    numbers,
    solved,
    terms_of,
)
from tests.seeds import seeds
from tpjb_ident.terms.amplitude import Amplitude
from tpjb_ident.terms.load_turn import LoadTurn
from tpjb_ident.terms.registry import learnt_rig, solved_as_learnt
from tpjb_ident.terms.temperature import Temperature

SEEDS = seeds(3)
_WRONG, _LATE = "accelerometers-contradict-cells", "cells-and-accelerometers-out-of-phase"


def answered(case, seed=0):
    """The solve of a case, and its truth."""
    rig, blocks, truth = made(case, seed)
    return solved(rig, blocks, truth), truth


def held(solution, truth, limit=4.0):
    """H is within `limit` of its own standard deviations everywhere."""
    return np.abs(away(solution, truth)).max() < limit


def told(fitted, true, limit=4.0):
    """All parameters are estimated, and near the truth by their own standard errors."""
    return fitted.estimated.all() and (np.abs(fitted.value - true) < limit * fitted.deviation).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_gains_of_two_probes_are_considered_and_stand_in_the_interval(seed):
    known = {"displacement": {"uncertainty": 0.01}, "force": {"uncertainty": 0.005}}
    case = Case(gains={"D1": 0.012, "F2": -0.004}, stated=known)
    solution, truth = answered(case, seed)
    gains = solution.fitted["calibration"]
    assert not gains.estimated.any()
    np.testing.assert_array_equal(gains.value, 0.0)
    assert held(solution, truth)
    assert np.abs(solution.h / truth - 1)[:, [0, 1], [0, 1]].max() > 0.003
    share = solution.shares["calibration"][:, 0, 0] / deviations(solution)[:, 0] ** 2
    assert (share > 0.8).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_third_probe_tells_the_differences_of_gains(seed):
    case = Case(probes=3, gains={"D1": 0.05}, stated={"displacement": {"uncertainty": 0.02}})
    solution, truth = answered(case, seed)
    gains = solution.fitted["calibration"]
    difference = gains.value[0] - gains.value[1:3].mean()
    assert difference == pytest.approx(0.05, abs=0.004)
    assert held(solution, truth)
    alone = made(replace(case, gains={}), seed)
    assert solution.terms[0].conditions(solved(*alone).fitted["calibration"]) == ()


def test_a_probe_far_beyond_what_is_stated_is_named():
    case = Case(probes=3, gains={"D1": 0.05}, stated={"displacement": {"uncertainty": 0.005}})
    rig, blocks, truth = made(case)
    solution = solved(learnt_rig(rig, solved(rig, blocks, truth)), blocks, truth)
    (found,) = solution.terms[0].conditions(solution.fitted["calibration"])
    assert found == "probe-gains-differ"
    assert "D1" in found.detail
    assert held(solution, truth)


def test_two_calibrations_of_one_probe_have_a_gain_each():
    case = Case(probes=3, noise=1e-4, stated={"displacement": {"uncertainty": 0.01}})
    rig, blocks, truth = made(case)
    later = blocks.point == 2
    calibration, z = blocks.calibration.copy(), blocks.z.copy()
    calibration[later, 0] = 1
    z[later, 0] *= 1.03
    solution = solved(rig, replace(blocks, calibration=calibration, z=z), truth)
    (gain,) = [term for term in solution.terms if term.name == "calibration"]
    assert [p.name for p in gain.parameters][:2] == ["D1, calibration 1", "D1, calibration 2"]
    first, second = solution.fitted["calibration"].value[:2]
    assert second - first == pytest.approx(np.log(1.03), abs=2e-3)
    assert held(solution, truth)


@pytest.mark.parametrize("mount", ["cells", "floating"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_delay_is_told_by_the_housing_s_equations(mount, seed):
    """Standing: cells against accelerometers. Floating: probes against accelerometers."""
    late = {"cells": "force", "floating": "acceleration"}[mount]
    case = Case(mount=mount, late={late: 3e-4}, stated={late: {"delay_uncertainty": 3e-4}})
    case = replace(case, hertz=(30.0, 90.0), loads=(5000.0,))
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    delay = solution.fitted["delay"]
    assert told(delay, 0.3)
    assert delay.deviation[0] < 0.15
    assert held(solution, truth)
    ignored = solved(
        replace(rig, channels=tuple(replace(s, delay_uncertainty=0.0) for s in rig.channels)), blocks, truth
    )
    assert np.abs(away(ignored, truth)).max() > np.abs(away(solution, truth)).max()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("accelerometers", [2, 0])
def test_a_low_corner_that_nobody_states_stands_in_the_interval(seed, accelerometers):
    """Charge-coupled cells at one frequency: the springs' loss would explain the lead as well."""
    case = Case(corner=0.6, hertz=(15.0,), accelerometers=accelerometers)
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    assert held(solution, truth, 2.5)
    ignored = solved(replace(rig, static=True), blocks, truth)
    assert np.abs(away(ignored, truth)).max() > 8
    said = replace(rig, channels=tuple(replace(s, corner_uncertainty=0.0) for s in rig.channels))
    assert not any(term.parameters for term in terms_of(said, blocks) if term.name == "corner")


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("corner", [0.3, 0.8])
def test_two_frequencies_tell_the_corner_by_the_housing_s_equations(seed, corner):
    case = Case(corner=corner, hertz=(10.0, 60.0), noise=3e-4)
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    assert told(solution.fitted["corner"], corner)
    assert solution.fitted["corner"].deviation[0] < 0.1
    assert held(solution, truth)
    term = next(t for t in terms_of(rig, blocks) if t.name == "corner")
    assert "low corner" in term.words(solution.fitted["corner"])[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("hertz", "corner", "late"), [((25.0, 45.0), 1.2, 0.0), ((25.0,), 0.7, 0.0), ((25.0, 45.0), 0.0, 1e-3)]
)
def test_accelerometers_that_lead_have_a_corner_or_the_cells_come_late(seed, hertz, corner, late):
    """What leads falls with frequency or grows with it; at one frequency the interval holds both."""
    rig, blocks, truth = made(Case(hertz=hertz, input_corner=corner, late={"force": late}, noise=2e-4), seed)
    first = solved(rig, blocks, truth)
    learnt = learnt_rig(rig, first)
    assert learnt is not rig
    solution = solved(learnt, blocks, truth)
    assert held(solution, truth)
    assert (_LATE in solution.conditions()) == bool(late)
    if len(hertz) > 1:
        assert solution.fitted["corner"].value[0] == pytest.approx(corner, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("late", [{"F1": 4e-4}, {"F2": 4e-4}, {"F2": 1.5e-3}])
def test_one_cell_that_comes_late_is_told_by_its_own_axis(seed, late):
    """As behind a multiplexer: one loss of both springs would take half of it, and the other half K and C."""
    rig, blocks, truth = made(Case(hertz=(25.0, 41.0), late=late, noise=2e-4), seed)
    first = solved(rig, blocks, truth)
    assert not held(first, truth)
    solution = solved(learnt_rig(rig, first), blocks, truth)
    assert held(solution, truth)
    (told,) = [condition for condition in solution.conditions() if condition == _LATE]
    assert f"the cells along {'X' if 'F1' in late else 'Y'} were" in told.detail


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("wrong", [{"late": {"D1": 5e-4}}, {"turned": {"D1": 0.06}}], ids=["late", "turned"])
def test_one_probe_of_three_that_no_gain_explains_stands_in_the_interval(seed, wrong):
    """A lag and an axis leave probes contradicting one another, and gains would answer for them."""
    sure = {f"D{k}": {"uncertainty": 2e-3} for k in (1, 2, 3)}
    rig, blocks, truth = made(Case(probes=3, hertz=(25.0, 41.0), noise=2e-4, stated=sure, **wrong), seed)
    first = solved(rig, blocks, truth)
    assert not held(first, truth)
    solution = solved(learnt_rig(rig, first), blocks, truth)
    assert held(solution, truth)
    assert "probe-gains-differ" in solution.conditions()


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("wrong", [[-1.0, -1.0], [-1.0, 1.0]])
@pytest.mark.parametrize(
    "leads", [{"late": {"force": 5e-4}}, {"corner": 1e-9, "input_corner": 1.0}], ids=["late", "corner"]
)
def test_wrong_accelerometers_stay_wrong_where_something_leads(seed, wrong, leads):
    """It may be cells that come late, or a negative corner of theirs; an accelerometer that is inverted is neither."""
    rig, blocks, truth = made(Case(hertz=(25.0, 45.0), noise=2e-4, **leads), seed)
    z = blocks.z.copy()
    z[:, rig.pick("acceleration")] *= wrong
    blocks = replace(blocks, z=z)
    learnt = learnt_rig(rig, solved(rig, blocks, truth))
    assert learnt.out_of_step or "late" in leads
    assert _WRONG in solved(learnt, blocks, truth).conditions()


#: What no records tell, the term that it is of, and the share by which it has H off.
CONSIDERED = {
    "late": (Case(late={"displacement": 1e-4}, stated={"displacement": {"delay_uncertainty": 1e-4}}), "delay", 0.01),
    "turned": (Case(turned={"D1": 0.01}, stated={"displacement": {"axis_uncertainty": 0.01}}), "axis", 0.003),
    "heavier": (Case(hertz=(90.0,), mass_error=0.02, mass_uncertainty=0.02), "mass", 0.0),
    "no accelerometers": (Case(accelerometers=0), "housing", 0.0),
    "no accelerometers, no mount": (Case(accelerometers=0, mount="unknown"), "housing", 0.0),
}


@pytest.mark.parametrize("name", CONSIDERED)
def test_what_is_not_told_is_considered_and_stands_in_the_interval(name):
    case, term, off = CONSIDERED[name]
    solution, truth = answered(case)
    assert not solution.fitted[term].estimated.any()
    assert held(solution, truth)
    assert np.abs(solution.h - truth).max() > off * np.abs(truth).max()
    assert solution.shares[term][0, 0, 0] > 0


@pytest.mark.parametrize("rate", [1e-4, -3e-4])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_clock_s_rate_is_told_by_how_phases_turn_within_the_records(rate, seed):
    case = Case(
        rates={"force": rate, "acceleration": rate},
        stated={"force": {"clock": "second"}, "acceleration": {"clock": "second"}, "displacement": {"clock": "first"}},
    )
    solution, truth = answered(case, seed)
    clock = solution.fitted["clock"]
    assert told(clock, 1e4 * rate)
    assert clock.deviation[0] < 0.05
    assert held(solution, truth)
    (term,) = [t for t in solution.terms if t.name == "clock"]
    assert term.rates(clock.value)["second"] == pytest.approx(rate, rel=0.2)
    (found,) = term.conditions(clock)
    assert found == "clocks-differ"


def test_clocks_that_agree_are_not_named():
    case = Case(stated={"force": {"clock": "b"}, "acceleration": {"clock": "b"}, "displacement": {"clock": "a"}})
    solution = solved(*made(case))
    (term,) = [t for t in solution.terms if t.name == "clock"]
    assert term.conditions(solution.fitted["clock"]) == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_springs_under_the_housing_are_told(seed):
    solution = solved(*made(Case(), seed))
    housing = solution.fitted["housing"]
    c = 1e9 * COMPLIANCE.real
    assert told(housing, [c[0, 0], c[1, 1], c[0, 1], 0.01, 0.01])
    assert solution.terms[0].conditions(housing) == ()


@pytest.mark.parametrize(
    ("turn", "named"),
    [
        (lambda a: -a, "accelerometers-contradict-cells"),
        (lambda a: a[:, ::-1], "accelerometers-contradict-cells"),
        (lambda a: a * [0, 1], "accelerometers-contradict-cells"),
        (lambda a: 0 * a, "accelerometers-contradict-cells"),
        (lambda a: a * np.exp(-0.3j), "cells-and-accelerometers-out-of-phase"),
    ],
    ids=["inverted", "exchanged", "one dead", "both dead", "late"],
)
def test_accelerometers_that_no_housing_on_springs_has_are_named(turn, named):
    rig, blocks, truth = made(Case(hertz=(60.0,)))
    z = blocks.z.copy()
    z[:, rig.pick("acceleration")] = turn(z[:, rig.pick("acceleration")])
    solution = solved(rig, replace(blocks, z=z), truth)
    (term,) = [t for t in solution.terms if t.name == "housing"]
    assert term.conditions(solution.fitted["housing"]) == (named,)


@pytest.mark.parametrize("seed", SEEDS)
def test_how_h_turns_with_the_load_s_direction_is_learnt_from_the_runs_own_misses(seed):
    turning = drawn_turning(np.random.default_rng(seed))
    case = Case(directions=6, noise=2e-4, miss=(0.004, 0.01), turning=turning)
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    turn = solution.fitted["load direction"]
    assert (np.abs(turn.value - turning) < 4 * turn.deviation).all()
    assert held(solution, truth)
    without = solved(rig, blocks, truth, without=(LoadTurn,))
    # a turn that all runs miss does what the runs' own turns do
    turned, plausible = (each.shares["load miss"][:, 1:3, 1:3].trace(axis1=1, axis2=2) for each in (solution, without))
    assert not np.allclose(turned, plausible, rtol=0.05)
    gain = np.abs(without.h - truth).max(axis=(1, 2)) / np.abs(solution.h - truth).max(axis=(1, 2))
    assert np.median(gain) > 2


@pytest.mark.slow
def test_a_miss_that_all_loads_share_is_considered():
    """The runs' scatter over the root of their number is how large it may be."""
    outside = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        common = 0.02 / np.sqrt(12) * complex(*rng.standard_normal(2))
        rig, blocks, truth = made(Case(miss=(0.02, 0.02), common_miss=common, noise=2e-4), seed)
        solution = solved(rig, blocks, truth)
        assert not solution.fitted["load miss"].estimated.any()
        outside.append(np.abs(away(solution, truth)[:, [0, 3, 4, 7]]) > 1.96)
    assert np.mean(outside) < 0.12


@pytest.mark.parametrize("seed", SEEDS)
def test_what_turns_with_the_shaft_is_told_from_the_motion(seed):
    case = Case(shaft=0.5, loads=(5000.0,), directions=6)
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    assert held(solution, truth)
    assert np.abs(solution.h / truth - 1)[:, [0, 1], [0, 1]].max() < 0.02
    silent = solved(rig, replace(blocks, shaft=np.full(len(blocks), np.nan + 0j)), truth)
    assert np.abs(silent.h / truth - 1).max() > 0.05


@pytest.mark.parametrize("seed", SEEDS)
def test_several_amplitudes_give_the_stiffness_at_none(seed):
    case = Case(sizes=(0.3, 0.6, 1.0), bent=0.04, bent_told=0.08)
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    assert held(solution, truth)
    assert solution.fitted["amplitude"].estimated.any()
    without = solved(rig, blocks, truth, without=(Amplitude,))
    diagonal = np.s_[:, [0, 1], [0, 1]]
    assert np.abs(without.h / truth - 1)[diagonal].max() > 0.03
    assert np.abs(solution.h / truth - 1)[diagonal].max() < 0.02


@pytest.mark.parametrize("seed", SEEDS)
def test_what_one_amplitude_does_not_tell_stands_in_the_interval(seed):
    """Runs of other directions move otherwise; that is the film's direction, and no evidence on amplitude."""
    rig, blocks, truth = made(Case(bent=0.04, bent_told=0.05), seed)
    solution = solved(rig, blocks, truth)
    assert not solution.fitted["amplitude"].estimated.any()
    assert held(solution, truth)
    blind = solved(rig, blocks, truth, without=(Amplitude,))
    assert not held(blind, truth)
    assert "amplitude" not in solved(*made(Case())).fitted


@pytest.mark.parametrize("seed", SEEDS)
def test_a_probe_s_drift_is_told_by_runs_at_several_temperatures(seed):
    case = Case(drift={"D1": 5e-4}, kelvins=15.0, stated={"D1": {"temperature_coefficient_uncertainty": 5e-4}})
    rig, blocks, truth = made(case, seed)
    solution = solved(rig, blocks, truth)
    drift = solution.fitted["temperature"]
    assert told(drift, 0.5)
    assert held(solution, truth)
    without = solved(rig, blocks, truth, without=(Temperature,))
    assert np.median(np.abs(without.h - truth)) > np.median(np.abs(solution.h - truth))
    cold = replace(blocks, temperature=np.full(len(blocks), np.nan))
    assert "temperature" not in solved(rig, cold, truth).fitted


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("late", "share", "named"),
    [(0.0, 1.0, ()), (0.0, 0.95, ()), (2e-4, 1.0, (_LATE,)), (2e-3, 1.0, (_LATE,)), (0.0, -1.0, (_WRONG,))],
)
def test_a_floating_stator_s_accelerometers_are_held_against_the_probes(late, share, named, seed):
    rig, blocks, truth = made(Case(mount="floating", hertz=(60.0, 80.0)), seed)
    z = blocks.z.copy()
    z[:, rig.pick("acceleration")] *= share * np.exp(-1j * blocks.omega * late)[:, None]
    solution = solved(rig, replace(blocks, z=z), truth)
    (term,) = [t for t in solution.terms if t.name == "housing"]
    assert term.conditions(solution.fitted["housing"]) == named


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("late", [3e-4, -1.5e-4, -3e-4, -2e-3])
def test_one_line_tells_a_floating_stator_s_delays_from_a_shaft_that_gives(late, seed):
    """A shaft that gave way would show in phase as well, as no sound gain does."""
    rig, blocks, truth = made(Case(mount="floating", hertz=(47.0,), loads=(5000.0,)), seed)
    z, probes = blocks.z.copy(), rig.pick("displacement")
    cells_and_accelerometers = [j for j in range(len(rig)) if j not in probes]
    z[:, cells_and_accelerometers] *= np.exp(-1j * blocks.omega * late)[:, None]
    solution = solved_as_learnt(rig, lambda rig: solved(rig, replace(blocks, z=z), truth))
    assert solution.conditions() == (_LATE,) if late > 0 else held(solution, truth)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("gives", [0.0, 1.5e-9])
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, ""),
        ({"gains": {"D1": 0.1}}, "0.9"),
        ({"gains": {"D1": 0.1, "D2": 0.1}}, "0.9"),
        ({"turned": {"D1": 0.3, "D2": 0.3}}, "turned by 17 deg"),
        ({"input_corner": 2.0}, ""),
    ],
    ids=["right", "one probe 10 % off", "both", "turned", "accelerometers' corner"],
)
def test_a_floating_stator_tells_wrong_probes_from_a_shaft_that_gives(changes, says, gives, seed):
    """The shaft yields to the film's force, whose damping no gain and no axis has."""
    case = Case(mount="floating", hertz=(25.0, 45.0), noise=2e-4, shaft_gives=gives, **changes)
    rig, blocks, truth = made(case, seed)
    learnt = learnt_rig(rig, solved(rig, blocks, truth))
    solution = solved(learnt, blocks, truth)
    details = [condition.detail for condition in solution.conditions() if condition == _WRONG]
    if says:
        assert len(details) == 1
        assert says in details[0]
        return
    assert not solution.conditions()
    assert held(solution, truth)
    if not changes:
        assert solution.fitted["housing"].value[4:6] == pytest.approx(1e9 * gives, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("gives", "mass"), [(1.5e-9, 60.0), (4e-9, 150.0), (2e-8, 75.0)])
def test_a_shaft_under_a_floating_stator_has_mass(gives, mass, seed):
    """It resonates at 530, 205 and 130 Hz, the last in the midst of the excitation, and bends no H."""
    gains = {"uncertainty": 0.01}
    case = Case(
        (5000.0,), (25.0, 60.0, 100.0, 150.0, 180.0), mount="floating", noise=2e-4, shaft_gives=gives, shaft_mass=mass
    )
    rig, blocks, truth = made(replace(case, stated={"force": gains, "acceleration": gains}), seed)
    learnt = learnt_rig(rig, solved(rig, blocks, truth))
    solution = solved(learnt, blocks, truth)
    assert not solution.conditions()
    assert held(solution, truth)
    np.testing.assert_allclose(solution.h, truth, rtol=0, atol=0.006 * np.abs(truth).max())
    *_, compliance, heavy, _, _, _ = solution.fitted["housing"].value
    assert compliance == pytest.approx(1e9 * gives, rel=0.05)
    assert heavy == pytest.approx(mass, rel=0.25)
    # the housing's equations are no evidence on gains
    assert not solution.fitted["calibration"].estimated.any()


@pytest.mark.parametrize("gives", [1.5e-9, 8e-9])
@pytest.mark.parametrize("seed", SEEDS)
def test_one_frequency_tells_no_mass_of_a_shaft(seed, gives):
    """A spring and a resonance explain it alike: steps begin at the spring."""
    solution, truth = answered(Case(mount="floating", hertz=(45.0,), noise=2e-4, shaft_gives=gives), seed)
    (housing,) = (term for term in solution.terms if term.name == "housing")
    assert housing.start == ()
    assert solution.fitted["housing"].value[6] == 0.0
    assert not solution.conditions()
    assert held(solution, truth)


@pytest.mark.parametrize(
    ("loss", "mass", "named"), [(0.01, 1.0, ""), (0.2, 10.0, _LATE), (0.2, 1.0, "accelerometers-doubtful")]
)
def test_springs_that_lose_much_matter_as_far_as_inertia_does(loss, mass, named, monkeypatch):
    monkeypatch.setattr(block_cases, "COMPLIANCE", COMPLIANCE.real * (1 - 1j * loss))
    monkeypatch.setattr(block_cases, "MASS", mass * block_cases.MASS)
    solution, truth = answered(Case(noise=2e-4))
    assert solution.conditions() == ((named,) if named else ())
    assert held(solution, truth)


@pytest.mark.parametrize("share", [0.02, 1e-17])
def test_springs_much_stiffer_than_usual_and_accelerometers_that_read_rounding_do_no_harm(share):
    rig, blocks, truth = made(Case(noise=2e-4))
    cells, accelerometers = rig.pick("force"), rig.pick("acceleration")
    z, noise = blocks.z.copy(), blocks.noise.copy()
    z[:, cells] += rig.mass * (1 - share) * z[:, accelerometers]
    z[:, accelerometers] *= share
    noise[:, accelerometers] *= share
    noise[:, :, accelerometers] *= share
    solution = solved(rig, replace(blocks, z=z, noise=noise), truth)
    assert held(solution, truth)
    assert (deviations(solution) / np.abs(numbers(truth)))[:, [0, 3, 4, 7]].max() < 0.01
    assert solution.conditions() == (() if share > 0.01 else ("accelerometers-contradict-cells",))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_shaft_that_gives_more_than_the_film_is_no_fault_of_accelerometers(seed):
    solution, truth = answered(Case(mount="floating", hertz=(25.0, 45.0), noise=2e-4, shaft_gives=1.2e-8), seed)
    assert not solution.conditions()
    assert held(solution, truth)
    assert solution.fitted["housing"].value[4:6] == pytest.approx(12.0, rel=0.05)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("quantity", "mount"), [("displacement", "cells"), ("acceleration", "floating")])
def test_a_tilt_between_two_planes_of_sensors_does_no_harm(quantity, mount, seed):
    """Of the shaft in three probes, of a housing that pitches in four accelerometers."""
    planes = [0.03, 0.03, -0.03] if quantity == "displacement" else [0.05, 0.05, -0.03, -0.03]
    names = [f"{quantity[0].upper()}{k + 1}" for k in range(len(planes))]
    described = {name: {"plane": plane} for name, plane in zip(names, planes)}
    rig, blocks, truth = made(Case(probes=3, accelerometers=4, mount=mount, stated=described), seed)
    rng, z, places = np.random.default_rng(seed), blocks.z.copy(), rig.pick(quantity)
    size = np.linalg.norm(z[:, places[:2]], axis=1)[:, None]
    tilt = 2.0 * size * (rng.standard_normal((len(z), 2)) + 1j * rng.standard_normal((len(z), 2)))
    for j, plane in zip(places, planes):
        z[:, j] += plane * np.sum(blocks.along[:, j] * tilt, axis=1)
    tilted = replace(blocks, z=z)
    assert held(solved(rig, tilted, truth), truth)
    ignored = replace(rig, channels=tuple(replace(sensor, plane=0.0) for sensor in rig.channels))
    assert np.abs(solved(ignored, tilted, truth).h / truth - 1).max() > 0.02


def test_a_tilt_that_goes_with_the_motion_is_no_contradiction_of_probes():
    planes = dict(zip(("D1", "D2", "D3", "D4"), (0.04, 0.04, -0.025, -0.025), strict=True))
    rig, blocks, truth = made(Case(probes=4, stated={name: {"plane": plane} for name, plane in planes.items()}))
    z = blocks.z.copy()
    for j, plane in enumerate(planes.values()):
        z[:, j] *= 1.0 + 5.0 * np.exp(0.4j) * plane
    tilted = replace(blocks, z=z)
    assert learnt_rig(rig, solved(rig, tilted, truth)) is rig
    ignored = replace(rig, channels=tuple(replace(sensor, plane=0.0) for sensor in rig.channels))
    assert learnt_rig(ignored, solved(ignored, tilted, truth)).widened


def test_one_plane_of_probes_is_information_only():
    rig, blocks, truth = made(Case())
    beside = replace(rig, channels=tuple(replace(sensor, plane=0.06) for sensor in rig.channels))
    near, far = (solved(described, blocks, truth) for described in (rig, beside))
    np.testing.assert_array_equal(near.h, far.h)
    np.testing.assert_array_equal(deviations(near), deviations(far))


@pytest.mark.parametrize("seed", SEEDS)
def test_directions_on_oil_of_two_temperatures_stand_in_the_interval_and_are_told(seed):
    case = Case(directions=2, warmer=(-5.5, 5.5), thinner=-0.018)
    solution, truth = answered(case, seed)
    assert held(solution, truth, 2.5)
    assert np.abs(away(answered(replace(case, warmer=(0.0,)), seed)[0], truth)).max() < 4.0
    assert "film-not-equally-warm" in solution.conditions()
    far = np.abs(solution.h / truth - 1)[:, [0, 1], [0, 1]].max()
    assert far > 0.08  # without the term silently: noise is a thousandth


@pytest.mark.parametrize("seed", SEEDS)
def test_runs_of_one_direction_that_differ_in_temperature_tell_what_it_does(seed):
    case = Case(directions=4, sizes=(1.0, 1.0), warmer=(-2.0, 2.0, -2.0, 2.0, 2.0, -2.0, 2.0, -2.0), thinner=-0.018)
    solution, truth = answered(case, seed)
    fitted = solution.fitted["film temperature"]
    told_here = fitted.estimated[:8]
    assert told_here[[0, 3, 4, 7]].all()
    assert fitted.value[[0, 3]] == pytest.approx(-0.018, abs=0.003)
    assert held(solution, truth)


def test_runs_that_show_no_change_with_the_temperature_widen_little():
    """Whatever the thermometers say."""
    warmer = (-8.0, 8.0, -8.0, 8.0, 8.0, -8.0, 8.0, -8.0)
    case = Case(directions=4, sizes=(1.0, 1.0), warmer=warmer)
    solution, truth = answered(case)
    alone, _ = answered(replace(case, warmer=(0.0,)))
    assert held(solution, truth)
    assert np.median(deviations(solution) / deviations(alone)) < 2.5


def test_films_as_warm_as_a_supply_holds_them_widen_nothing():
    case = Case(directions=4, warmer=(-0.2, 0.2, 0.2, -0.2), thinner=-0.018)
    solution, truth = answered(case)
    assert "film temperature" not in solution.fitted
    assert held(solution, truth)
    solution, truth = answered(replace(case, warmer=(-0.9, 0.9, 0.9, -0.9)))
    alone, _ = answered(replace(case, warmer=(0.0,)))
    assert held(solution, truth)
    assert np.median(deviations(solution) / deviations(alone)) < 2.0
    assert "film-not-equally-warm" not in solution.conditions()
