"""From blocks to a curve and its status, and records that are refused: exact staircases, one thing wrong at a time."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.calibration import Channel
from rigdata.problem import RigDataError
from rigdata.record import VectorRecord
from tpjb_ident.conditions import sentences
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.bad_steps import sound_parts
from tpjb_ident.pivot.blocks import Blocks, Hold, LoadCourse
from tpjb_ident.pivot.dry_record import (
    FRICTION_SE,
    FRICTION_SHARE,
    DryRecord,
    PadDirection,
    displacement_direction,
    load_direction,
    pad_axes,
    read_dry_run,
    with_load_zero,
)
from tpjb_ident.pivot.fit import assemble_curve
from tpjb_ident.pivot.law_fit import FRICTION, LawFit, fit_law
from tpjb_ident.pivot.law_fit import SCALE as LN_SCALE
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.readings import (
    LAG,
    MODEL_ERROR,
    REFERENCE_SHARE,
    UNKNOWN_ZERO,
    fit_data,
    with_friction,
    with_shared_errors,
)
from tpjb_ident.pivot.refusals import check_directions, check_placement, check_spares, structure_behind

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
LEVELS = np.arange(500.0, 5001.0, 500.0)
SCALE, PER = 4e-9, 6
NOISE = NoiseModel(white=1e-18, flicker=1e-18, drift=1e-9)
REACH = 8e-5


def channel(quantity, axis, uncertainty=None, zero_uncertainty=0.0):
    return Channel("", quantity, axis=axis, uncertainty=uncertainty, zero_uncertainty=zero_uncertainty)


CHANNELS = {
    "X1A": channel("displacement", math.radians(45.0)), "X1B": channel("displacement", math.radians(135.0)),
    "L1H": channel("force", 0.0), "L1V": channel("force", math.radians(90.0)),
}  # fmt: skip


def vectors(angle, size):
    return np.outer(size, [math.cos(angle), math.sin(angle)])


def record(pad=1, levels=LEVELS, turn=(0.0, 0.0), shift=(0.0, 0.0), held=True, name=None, branch=1):
    """A staircase of exact blocks: load and displacement `turn` off the pad, displacement moved by `shift` [m]."""
    load = np.repeat(levels, PER) if held else np.linspace(levels[0], levels[-1], PER * len(levels))
    n, angle = len(load), float(ANGLES[pad - 1])
    hold = np.repeat(np.arange(len(levels)), PER) if held else np.full(n, -1)
    place = vectors(angle, np.full(n, REACH)) + vectors(angle + turn[1], SCALE * load) + np.array(shift)
    blocks = on_pad(angle, vectors(angle + turn[0], load), place, hold, np.full(n, branch))
    holds = tuple(Hold(0.6 * k, 0.6 * k + 0.6, level) for k, level in enumerate(levels)) if held else ()
    run = SimpleNamespace(id=name or f"p-{pad}", file=f"p-{pad}.csv", pad=pad, channels=CHANNELS)
    moved = displacement_direction(blocks, NOISE)
    good = np.ones(n, dtype=bool)
    course = LoadCourse(blocks.time, blocks.load, 0.1)
    return DryRecord(run, pad, angle, holds, blocks, course, good, 0.0, 0.0, load_direction(blocks), moved)


def on_pad(angle, load, place, hold, branch):
    """Blocks of a tenth of a second with loads and displacements (n, 2) on the axes of a pad."""
    (along, across), (deflection, aside) = (pad_axes(angle) @ vector.T for vector in (load, place))
    n, zeros = len(load), np.zeros(len(load))
    return Blocks(0.1 * np.arange(n), np.full(n, 0.1), along, across, deflection, aside, zeros, zeros, hold, branch)


def check(one):
    return [problem.what for problem in check_directions([one], ANGLES)]


@pytest.mark.parametrize(
    ("load", "moved", "taken"), [(7.5, 0.0, True), (-8.5, -8.5, False), (0.0, 29.0, True), (0.0, -31.0, False)]
)
def test_directions_are_taken_up_to_their_limits(load, moved, taken):
    one = record(turn=(math.radians(load), math.radians(moved)))
    assert math.degrees(one.load_direction.angle) == pytest.approx(load, abs=1e-6)
    assert math.degrees(one.displacement_direction.angle) == pytest.approx(moved, abs=1e-3)
    problems = check(one)
    assert len(problems) == (0 if taken else 1)
    for what in problems:
        assert re.search(r"p-1 says pad 1 at -90 deg, but its (force|displacement) grows -", what)


@pytest.mark.parametrize(
    ("turn", "guess"),
    [
        ((72.0, 72.0), "force grows .72.0 deg away from .*wrong pad: load and displacement both point at pad 2"),
        ((-72.0, -80.0), "wrong pad: load and displacement both point at pad 5"),
        ((20.0, 25.0), r"wrong angle: load and displacement turn together by \+20 deg"),
        ((40.0, 40.0), "wrong angle: load and displacement turn together by .40"),
        ((170.0, -170.0), "wrong angle: load and displacement turn together by .170"),
        ((-172.0, 175.0), "wrong angle: load and displacement turn together by -172"),
        ((90.0, 10.0), "wrong channel: .*so force channels are exchanged or reversed"),
        ((180.0, 0.0), "force grows .*180.0 deg opposite to"),
        ((3.0, 120.0), "displacement grows .120.0 deg away from .*so displacement channels"),
        ((60.0, -100.0), "wrong pad, wrong channel or wrong angle"),
    ],
)
def test_the_likeliest_mistake_is_named(turn, guess):
    (what,) = check(record(turn=tuple(np.radians(turn))))
    assert re.search(guess, what)


def campaign(odd=(0.0, 0.0), spread=0.0, zeroed=False):
    """Runs of all pads about a common centre somewhere, `spread` to one side or the other; one of pad 3 is `odd`.

    Places are shares of the reach, along and beside the pad's direction.
    """
    records = []
    for pad, aside in [*((p, s) for p in range(1, 6) for s in {spread, -spread}), (3, None)]:
        axes = REACH * pad_axes(ANGLES[pad - 1])
        place = np.array([2e-5, -5e-5]) + (odd @ axes if aside is None else aside * axes[1]) - zeroed * axes[0]
        records.append(record(pad, shift=place, name="odd" if aside is None else None))
    return records


@pytest.mark.parametrize(
    ("options", "named"),
    [({"odd": (0.0, 0.11)}, False), ({"odd": (0.0, 0.16)}, True), ({"odd": (0.0, -0.16)}, True),
     ({"odd": (0.4, 0.0)}, False), ({"odd": (0.65, 0.0)}, True), ({"odd": (-0.65, 0.0)}, True),
     # five robust standard deviations of where the campaign's own runs stand beside their pads
     ({"odd": (0.0, 0.35), "spread": 0.08}, False), ({"odd": (0.0, 0.9), "spread": 0.08}, True),
     # readings set to zero before each run tell no place
     ({"zeroed": True}, False)],
)  # fmt: skip
def test_a_shaft_that_stands_elsewhere_is_named(options, named):
    records = campaign(**options)
    found = check_placement(records)
    assert [p.run for p in found] == (["odd"] if named else [])
    for problem in found:
        # the reach holds the first load's deflection: 80 um and 2 um
        assert re.search("toward pad 3.* say 82 um toward it.*or probes set anew", problem.what)
    # two pads tell no centre
    assert check_placement([one for one in records if one.pad > 3]) == check_placement([]) == []


@pytest.mark.parametrize(
    ("odd", "seed", "named"),
    [({}, 1, False), ({}, 2, False), ({"gain": 1.01}, 1, False), ({"gain": 1.1}, 1, True), ({"turn": 10.0}, 1, True)],
)
def test_three_probes_that_contradict_one_another_are_refused(odd, seed, named):
    """Each with the gain error that is stated of it, half a per cent, and drift of some nanometres."""
    rng = np.random.default_rng(seed)
    axes = np.radians([0.0, 60.0, 120.0])
    probes = {f"X{k}": channel("displacement", axis, 0.005) for k, axis in enumerate(axes)}
    gain = 1.0 + 0.005 * rng.standard_normal(3)
    gain[2] *= odd.get("gain", 1.0)
    read_along = axes.copy()
    read_along[2] += math.radians(odd.get("turn", 0.0))
    records = []
    for pad in range(1, 6):
        one = record(pad)
        one.run.channels = probes
        slopes = gain * np.cos(read_along - ANGLES[pad - 1]) + 0.0005 * rng.standard_normal(3)
        records.append(replace(one, slopes=dict(zip(probes, slopes[:, None]))))
    problems = check_spares(records, NOISE)
    assert [p.run for p in problems] == ([f"p-{pad}" for pad in range(1, 6)] if named else [])
    if named:
        assert "X0, X1, X2 contradict one another" in problems[0].what
        for one in records:  # in planes of their own they may move apart
            one.run.channels = probes | {"X2": replace(probes["X2"], plane=0.02)}
        assert check_spares(records, NOISE) == []


def law(name="linear", scale=SCALE, friction=0.0, chi_square=50.0, contact=(), zero=0.0, spread=1e-6):
    theta = [zero, friction, math.log(scale), *contact]
    return LawFit(
        LAWS[name], 2000.0, bool(contact), np.array(theta), spread**2 * np.eye(len(theta)), 0.0, chi_square, 57
    )


STRAIGHT = PadDirection(0.0, 1e-3)


def curve(*records, fits=None, weights=(1.0,), good=None, directions=(STRAIGHT, STRAIGHT), **options):
    changes = {"load_direction": directions[0], "displacement_direction": directions[1]}
    changes |= {} if good is None else {"good": good}
    records = [replace(one, **changes) for one in records or (record(),)]
    return assemble_curve(records, (fits or (law(),), np.array(weights)), NOISE, **options)


def test_steps_are_the_means_of_holds_from_zero_load():
    made = curve(fits=(law(zero=-2e-6, scale=SCALE / 0.98, friction=0.02),))
    np.testing.assert_allclose(made.steps.load, 0.98 * LEVELS)
    np.testing.assert_allclose(made.steps.deflection, SCALE * LEVELS, atol=1e-15)
    np.testing.assert_allclose(made.steps.deflection_se, math.sqrt(NOISE.mean_variance(0.6)))
    np.testing.assert_allclose(made.steps.across_load, 0.0, atol=1e-9)
    np.testing.assert_allclose(made.steps.across_deflection, 0.0, atol=1e-15)
    np.testing.assert_array_equal(made.steps.weight, 1.0)
    np.testing.assert_array_equal(made.steps.branch, 1)
    assert (made.valid_from, made.valid_to) == pytest.approx((500.0, 5000.0))
    assert (made.pad, made.angle, made.runs, made.status) == (1, ANGLES[0], ("p-1",), ())
    assert made.hysteresis is None
    aside = curve(record(turn=(0.01, 0.2)))
    np.testing.assert_allclose(aside.steps.across_load, LEVELS * math.sin(0.01), rtol=1e-9)
    moved = SCALE * (LEVELS - 500.0) * math.sin(0.2)
    np.testing.assert_allclose(aside.steps.across_deflection, moved, atol=1e-15)


def test_every_run_of_a_pad_has_its_zero():
    low = record(levels=LEVELS[::-1] - 250.0, name="down", branch=-1)
    made = curve(record(), low, fits=(law(friction=0.01),))
    assert made.runs == ("p-1", "down")
    np.testing.assert_allclose(made.steps.load[:10], 0.99 * LEVELS)
    np.testing.assert_allclose(made.steps.load[10:], 1.01 * (LEVELS[::-1] - 250.0))
    held_back = 0.01 * SCALE * np.array([LEVELS.mean(), LEVELS.mean() - 250.0])
    np.testing.assert_allclose(made.steps.deflection[:10], SCALE * LEVELS - held_back[0], atol=1e-15)
    np.testing.assert_allclose(made.steps.deflection[10:], SCALE * (LEVELS[::-1] - 250.0) + held_back[1], atol=1e-15)
    # the loop of a straight law with a share mu of friction: 2 mu s F over the loads of both
    width = 2 * 0.01 * SCALE * np.array([500.0, 4750.0])
    assert made.hysteresis.energy == pytest.approx(0.5 * width.sum() * 4250.0, rel=1e-6)


def test_certificates_of_channels_that_share_a_direction():
    """Two probes at 45 deg to the pad share it: 1/sqrt(2) of one; two cells of which one lies along: that one."""
    probes = {f"X1{n}": channel("displacement", math.radians(a), 0.01) for n, a in (("A", 45.0), ("B", 135.0))}
    cells = {"L1H": channel("force", 0.0, 0.2), "L1V": channel("force", math.radians(90.0), 0.02)}
    others = {"A1H": channel("acceleration", 0.0, 0.5), "Q": channel("force", None, 0.7)}
    certified = probes | cells | others
    one = record()
    one.run.channels = certified
    assert curve(one).relative_calibration == pytest.approx(math.hypot(0.01 / math.sqrt(2.0), 0.02), rel=1e-9)
    one.run.channels = CHANNELS
    assert curve(one).relative_calibration == 0.0


def test_scatter_beyond_the_noise_widens_the_interval_by_birges_ratio():
    calm, wild = curve(fits=(law(chi_square=57.0),)), curve(fits=(law(chi_square=570.0),))
    np.testing.assert_allclose(wild.law.covariance, 10.0 * calm.law.covariance)
    assert sentences(wild.status) == ("misfit: the scatter exceeds the noise",)
    np.testing.assert_allclose(calm.law.covariance, 1e-12 * np.eye(3))
    exact = replace(law(chi_square=9.0), freedom=0)
    assert curve(fits=(exact,)).status == ()


CONTACT = (3e-6, math.log(500.0))


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"directions": (PadDirection(math.radians(-4.1), 0.0), PadDirection(0.0, 0.0))}, "load-off-pad: -4.10 deg"),
        (
            {"directions": (PadDirection(0.0, 0.0), PadDirection(math.radians(15.1), 0.0))},
            r"moves-aside: the shaft goes \+15.10",
        ),
        ({"fits": (law(contact=CONTACT),)}, "contact-incomplete: the shaft is not fully in contact below 1701 N"),
        ({"fits": (law(contact=(3e-4, math.log(3000.0))),)}, "contact-never-complete"),
        (
            {"fits": (law(), law("hertz-point")), "weights": (0.49, 0.51)},
            "law-undecided: linear 0.49, hertz-point 0.51",
        ),
        ({"structure": "a soft base"}, "structure-gives: a soft base"),
    ],
)
def test_every_condition_has_its_name(changes, status):
    found = sentences(curve(**changes).status)
    assert any(re.search(status, said) for said in found), found


def test_conditions_just_within_their_limits_say_nothing():
    inside = (PadDirection(math.radians(3.9), 0.0), PadDirection(math.radians(-14.9), 0.0))
    assert curve(directions=inside).status == ()
    # with and without contact loss it is the same law
    both = (law(), law(contact=CONTACT), law("hertz-point"))
    assert curve(fits=both, weights=(0.3, 0.21, 0.49)).status == ()
    lost = replace(record(), lost=0.051)
    assert curve(lost).status == ("samples-lost",)
    assert curve(replace(record(), lost=0.049)).status == ()


def test_what_a_law_is_fitted_to_has_all_its_variances():
    first = record()
    blocks = replace(first.blocks, load_spread=np.full(60, 30.0), rate=np.full(60, 200.0))
    first = replace(first, blocks=blocks, quantisation=3e-8)
    data = fit_data([first], NOISE)
    root = np.linalg.inv(data.whitener)
    covariance = root @ root.T
    moved = SCALE * 4500.0
    own = (SCALE * 30.0) ** 2 + (LAG * SCALE * 200.0) ** 2 + (MODEL_ERROR * moved) ** 2
    own += (SCALE * 20.0**2 / 72.0 * np.cbrt(5000.0) / np.cbrt(blocks.load) ** 4) ** 2  # a law of W^(2/3) bends
    one_hold = 3e-8**2 * (blocks.hold[:, None] == blocks.hold[None, :])
    expected = NOISE.covariance(blocks.time, blocks.duration) + np.diag(own) + one_hold
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-22)
    assert data.reference_load == pytest.approx(REFERENCE_SHARE * 5000.0)
    assert data.friction == (FRICTION_SHARE, FRICTION_SE)
    np.testing.assert_allclose(data.deflection, SCALE * (np.repeat(LEVELS, PER) - 500.0), atol=1e-15)
    # two runs: each its own zero and drift; the one whose load came back tells friction
    down = replace(first, blocks=replace(blocks, branch=np.full(60, -1)), friction=(0.01, 0.02))
    both = fit_data([first, replace(down, good=np.arange(60) != 5)], NOISE)
    root = np.linalg.inv(both.whitener)
    joint = root @ root.T
    np.testing.assert_allclose(joint[:60, 60:], 0.0, atol=1e-20)
    np.testing.assert_allclose(joint[:60, :60], expected + UNKNOWN_ZERO**2, rtol=1e-6)
    assert joint.shape == (119, 119)
    assert both.friction == (0.01, 0.02)
    np.testing.assert_array_equal(both.branch, np.r_[np.ones(60), -np.ones(59)])


def noisy(one, seed, off, noise=NOISE):
    rng = np.random.default_rng(seed)
    error = np.linalg.cholesky(noise.covariance(one.blocks.time, one.blocks.duration)) @ rng.standard_normal(len(off))
    return replace(one, blocks=replace(one.blocks, deflection=one.blocks.deflection + error + off))


def stairs():
    """Six blocks on every hold, two on every ramp between them."""
    n = 10 * 8
    hold = np.where(np.arange(n) % 8 < 2, -1, np.arange(n) // 8)
    into = np.interp(np.arange(n) % 8, [0, 2], [0.25, 1.0])
    load = LEVELS[np.arange(n) // 8] - np.where(hold < 0, 500.0 * (1.0 - into), 0.0)
    place = vectors(ANGLES[0], REACH + SCALE * load)
    blocks = on_pad(ANGLES[0], vectors(ANGLES[0], load), place, hold, np.ones(n, dtype=int))
    return replace(record(), blocks=blocks, good=np.ones(n, dtype=bool))


@pytest.mark.parametrize(
    ("one", "slipped", "left_out"),
    [
        (record(), slice(0, 0), slice(0, 0)),
        (record(), slice(18, 24), slice(18, 24)),
        (record(), slice(36, 42), slice(36, 42)),
        (record(held=False), slice(24, 28), slice(24, 28)),  # a ramp is looked at in fifteen stretches
        (stairs(), slice(34, 40), slice(32, 42)),  # the ramps beside a hold go with it
    ],
)
def test_what_slipped_is_left_out_and_no_more(one, slipped, left_out):
    number = np.arange(len(one.blocks))
    (part,) = sound_parts(noisy(one, 5, 8e-7 * np.isin(number, number[slipped])), NOISE)
    np.testing.assert_array_equal(np.flatnonzero(~part.good), number[left_out])


@pytest.mark.parametrize("size", [6e-7, -6e-7])
def test_from_a_slip_on_a_record_has_another_zero(size):
    """The ramp on which it happened is left out; all else stays, and the curve is what it was without."""
    number = np.arange(80)
    parts = sound_parts(noisy(stairs(), 5, size * (number > 40)), NOISE)
    assert [len(part.blocks) for part in parts] == [42, 38]
    assert [np.sum(~part.good) for part in parts] == [2, 0]
    curve = assemble_curve(parts, ((fit_law(LAWS["linear"], False, fit_data(parts, NOISE)),), np.ones(1)), NOISE)
    np.testing.assert_allclose(curve.stiffness([1000.0, 4000.0]), 1 / SCALE, rtol=0.01)
    np.testing.assert_allclose(curve.steps.deflection, curve.deflection(curve.steps.load), atol=1e-8)
    detail = {str(condition): condition.detail for condition in curve.status}["shaft-slipped"]
    assert detail == f"by {1e6 * size:+.2g} µm at 3000 N of p-1"


def test_a_kink_is_no_slip():
    one, noise = stairs(), NoiseModel(white=1e-17, flicker=1e-16, drift=5e-9)
    bent = 0.5 * SCALE * np.minimum(one.blocks.load - 2000.0, 0.0)
    (part,) = sound_parts(noisy(one, 5, bent, noise), noise)
    assert part.good.all()


class Run:
    """A dry run in memory, one value per sample and channel."""

    def __init__(self, n=4000, rate=500.0, pad=1, seed=1):
        rng = np.random.default_rng(seed)
        self.id, self.kind, self.file, self.channels = "p-1-up", "dry_pivot", "p.csv", CHANNELS
        self.pad, self.sample_rate = pad, rate
        self.reader = SimpleNamespace(problems=lambda: ())
        self.time = np.arange(n) / rate
        load = np.interp(self.time, *np.array([[0, 0.5, 2.5, 3, 5, 5.5, 8], [100, 1000, 1000, 2000, 2000, 3000, 3000]]))
        self.force = vectors(ANGLES[0], load) + rng.standard_normal((n, 2))
        self.displacement = vectors(ANGLES[0], REACH + SCALE * load) + 2e-8 * rng.standard_normal((n, 2))

    def vector(self, quantity):
        values = getattr(self, quantity)
        return VectorRecord(quantity, values, self.time[: len(values)], self.sample_rate, ("H", "V"))

    def record(self, name):
        vector = getattr(self, CHANNELS[name].quantity)
        axis = CHANNELS[name].axis
        return SimpleNamespace(values=vector @ np.array([math.cos(axis), math.sin(axis)]))


def read(run):
    return read_dry_run(run, float(ANGLES[0]))


def repeating(run, share, quantity="displacement"):
    """Repeat a share of the readings."""
    same = np.arange(4000) % 20 < 20 * share
    setattr(run, quantity, getattr(run, quantity)[np.maximum.accumulate(np.where(same, 0, np.arange(4000)))])


def stuck(run, samples, quantity="displacement"):
    values = getattr(run, quantity)
    values[1000 : 1000 + samples] = values[1000]


PROBES, CELLS = ["channel X1A", "channel X1B"], ["channel L1H", "channel L1V"]


@pytest.mark.parametrize(
    ("share", "samples", "still"),
    [(0.0, 49, []), (0.0, 51, PROBES), (0.0, 700, PROBES),
     # with two of five readings repeated a stretch of nine is to be expected; ten times that is none of chance
     (0.4, 80, []), (0.4, 140, PROBES), (0.4, 700, PROBES),
     # where more than half repeat, the converter's step hides the noise, and standing still says nothing
     (0.6, 700, [])],
)  # fmt: skip
@pytest.mark.parametrize("cells", [0, 400])
def test_channels_that_stand_still_are_named_with_time_and_share(share, samples, still, cells):
    run = Run()
    repeating(run, share)
    stuck(run, samples)
    stuck(run, cells, "force")
    still = [*(CELLS if cells else []), *still]
    if not still:
        live_run(run)
        return
    with pytest.raises(RigDataError) as caught:
        live_run(run)
    assert sorted(p.place for p in caught.value.problems) == sorted(still)
    share = {"channel X": samples, "channel L": cells}
    for problem in caught.value.problems:
        assert f"from 2.00 s on for {100 * share[problem.place[:9]] / 4000:.0f} % of the run" in problem.what


def test_one_coarse_channel_lets_its_quantity_stand_still():
    run = Run()
    run.force = np.round(run.force / [4.0, 1e-9]) * [4.0, 1e-9]  # the horizontal cell repeats most readings
    stuck(run, 700, "force")
    run.channels = CHANNELS | {"T1": channel("temperature", None)}  # of other quantities nothing is asked
    live_run(run)


def few(run, n):
    run.time, run.force, run.displacement = run.time[:n], run.force[:n], run.displacement[:n]


def unpushed(run):
    run.force = vectors(ANGLES[0], np.full(4000, 300.0)) + np.random.default_rng(1).standard_normal((4000, 2))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (unpushed, "has a load that does not rise"),
        (lambda run: few(run, 49), "has 49 samples"),
        (lambda run: few(run, 60), "gives only . usable averages of 0.1 s"),
        (lambda run: run.force[:2001].fill(np.nan), "of which 50 % are missing or glitches"),
        (lambda run: stuck(run, 4000), "stands still"),
    ],
)
def test_runs_that_hold_too_little_are_refused(spoil, said):
    run = Run()
    spoil(run)
    with pytest.raises(RigDataError, match=said):
        read(run)


def test_a_run_has_its_holds_and_blocks_whatever_order_its_stamps_have_and_ends_with_the_shorter_vector():
    run = Run()
    plain = read(run)
    assert [round(h.level, -1) for h in plain.holds] == [1000.0, 2000.0, 3000.0]
    assert (plain.pad, plain.angle, plain.quantisation) == (1, ANGLES[0], 0.0)
    assert plain.lost < 2e-3
    assert np.polyfit(plain.blocks.load, plain.blocks.deflection, 1)[0] == pytest.approx(SCALE, rel=1e-3)
    for values in (run.time, run.force, run.displacement):
        values[[1000, 1001]] = values[[1001, 1000]]
    np.testing.assert_allclose(read(run).blocks.load, plain.blocks.load, rtol=1e-9)
    for lost, quantity in ((300, "force"), (500, "displacement")):
        run = Run()
        setattr(run, quantity, getattr(run, quantity)[:-lost])
        assert read(run).blocks.time[-1] == pytest.approx(plain.blocks.time[-1] - lost / 500.0, abs=0.15)


def test_steps_of_a_converter_that_no_noise_reaches_are_known():
    run = Run()
    step = 1e-6
    clean = vectors(ANGLES[0], REACH + SCALE * (run.force @ vectors(ANGLES[0], [1.0])[0]).round(-2))
    run.displacement = np.round(clean / step) * step
    assert read(run).quantisation == pytest.approx(step / math.sqrt(6.0), rel=1e-6)


@pytest.mark.parametrize("friction", [0.005, 0.02])
def test_an_overshoot_shows_the_friction_that_one_branch_hides(friction):
    """Ten steps that overshoot by 15 per cent: the pivot stays where the peak left it, or slides back."""
    time = 0.01 * np.arange(1000)
    since = time % 1.0
    load = 500.0 * np.floor(time) + 500.0 * np.minimum(since / 0.2, 1.0)
    load += 75.0 * np.where(since < 0.2, since / 0.2, np.exp(-np.maximum(since - 0.2, 0.0) / 0.1))
    felt, pressed_by = np.zeros(1000), 0.0
    for k, value in enumerate(load):
        felt[k] = pressed_by = min(max(pressed_by, value * (1 - friction)), value * (1 + friction))
    blocks = record().blocks
    hold = np.where(np.arange(100) % 10 >= 4, np.arange(100) // 10, -1)
    means = [values.reshape(100, 10).mean(axis=1) for values in (time, load, SCALE * felt)]
    tenths, zeros = np.full(100, 0.1), np.zeros(100)
    blocks = Blocks(means[0], tenths, means[1], zeros, means[2], zeros, zeros, zeros, hold, np.ones(100))
    course = LoadCourse(time, load, 0.01)
    one = replace(record(), blocks=blocks, course=course, good=np.ones(100, dtype=bool))
    with_play = with_friction(one, NOISE)
    fit = fit_law(LAWS["linear"], False, fit_data([with_play], NOISE))
    assert fit.theta[FRICTION] == pytest.approx(friction, rel=0.1)
    assert fit.theta[LN_SCALE] == pytest.approx(math.log(SCALE), abs=2e-3)
    plain = fit_law(LAWS["linear"], False, fit_data([one], NOISE))
    assert abs(plain.theta[FRICTION] - friction) > 0.3 * friction


def pressed(compliance, mirror=None, pads=range(1, 6)):
    """One record per pad: pivots of 1 nm/N behind a 2 x 2 compliance."""
    records = []
    for pad in pads:
        one, normal = record(pad), vectors(ANGLES[pad - 1], np.ones(1))[0]
        shift = (np.eye(2) if mirror is None else mirror) @ (compliance @ normal + 1e-9 * normal)
        along, across = pad_axes(ANGLES[pad - 1]) @ shift
        blocks = replace(one.blocks, deflection=along * one.blocks.load)
        moved = PadDirection(math.atan2(across, along), 1e-3)
        records.append(replace(one, blocks=blocks, displacement_direction=moved))
    return records


@pytest.mark.parametrize("direction", [-70.0, 0.0, 20.0, 90.0])
def test_a_spring_of_one_direction_is_found_with_its_size(direction):
    axis = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction))])
    said = structure_behind(pressed(4e-9 * np.outer(axis, axis)))
    size, along = re.match(r"a structure that gives (\S+) nm/N more along (\S+) deg", said).groups()
    assert float(size) == pytest.approx(4.0)
    assert math.cos(2 * math.radians(float(along) - direction)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("compliance", "mirror", "pads"),
    [
        (np.zeros((2, 2)), np.array([[0.0, 1.0], [1.0, 0.0]]), range(1, 6)),  # exchanged probes
        (4e-9 * np.diag([1.0, 0.0]), None, range(1, 4)),  # three pads are too few
        (1e-10 * np.diag([1.0, 0.0]), None, range(1, 6)),  # nothing beyond the limit
    ],
)
def test_no_structure_is_seen_where_none_is_known(compliance, mirror, pads):
    assert structure_behind(pressed(compliance, mirror, pads)) == ""


@pytest.mark.parametrize("apart", [0.0, 0.06, 0.3])
def test_tests_of_one_pad_tell_how_far_they_are_to_be_believed(apart):
    """The other pads, tested once, are no better: what one test says of a pad scatters as much there."""
    first, second, single = record(name="a"), record(name="b"), record(pad=2)
    softer = replace(second.blocks, deflection=REACH + (1 + apart) * (second.blocks.deflection - REACH))
    pads = [[first, replace(second, blocks=softer)], [single]]
    data = [fit_data(records, NOISE) for records in pads]
    wider, scatter = with_shared_errors(pads, data)
    assert scatter == pytest.approx(apart / math.sqrt(2), rel=0.3, abs=1e-6)
    for plain, wide, tests in zip(data, wider, (2, 1), strict=True):
        before, after = (fit_law(LAWS["spline"], False, pad) for pad in (plain, wide))
        assert after.theta[LN_SCALE] == pytest.approx(before.theta[LN_SCALE], abs=0.02)
        grown = after.covariance[LN_SCALE, LN_SCALE] - before.covariance[LN_SCALE, LN_SCALE]
        assert math.sqrt(max(grown, 0.0)) == pytest.approx(scatter / math.sqrt(tests), rel=0.3, abs=1e-6)


ZERO = np.array([180.0, -90.0])


def untared(pads, stated, zero=ZERO):
    """Records toward some pads, each load a degree or two aside, of cells that read `zero` at no load."""
    channels = CHANNELS | {name: replace(CHANNELS[name], zero_uncertainty=stated) for name in ("L1H", "L1V")}
    records = []
    for pad, turn in zip(pads, np.radians([1.0, -2.0, 0.5, 1.5, -1.0]), strict=False):
        one = record(pad, turn=(turn, 0.0))
        along, across = pad_axes(one.angle) @ zero
        load, across_load = one.blocks.load + along, one.blocks.across_load + across
        blocks = replace(one.blocks, load=load, across_load=across_load)
        run = SimpleNamespace(**{**vars(one.run), "channels": channels})
        course = one.course._replace(load=one.course.load + along)
        records.append(replace(one, run=run, blocks=blocks, course=course, load_direction=load_direction(blocks)))
    return records


@pytest.mark.parametrize("stated", [0.0, 200.0])
def test_lines_of_load_toward_three_pads_meet_in_what_the_cells_read_at_none(stated):
    for given, mended in zip(
        [record(pad) for pad in (1, 3, 4)], with_load_zero(untared((1, 3, 4), stated)), strict=True
    ):
        np.testing.assert_allclose(mended.blocks.load, given.blocks.load, atol=5.0)
        np.testing.assert_allclose(mended.course.load, given.course.load, atol=5.0)
        assert mended.load_error < 10.0
        assert "201 N" in mended.untared


@pytest.mark.parametrize(
    ("pads", "zero", "stated"), [((1, 2), ZERO, 0.0), ((1,), ZERO, 60.0), ((1, 2, 4), 0.02 * ZERO, 0.0)]
)
def test_a_zero_that_nothing_tells_is_known_as_stated(pads, zero, stated):
    records = untared(pads, stated, zero)
    for given, kept in zip(records, with_load_zero(records), strict=True):
        np.testing.assert_array_equal(kept.blocks.load, given.blocks.load[given.blocks.load > 2 * stated])
        assert kept.load_error == pytest.approx(stated)
        assert not kept.untared


def test_an_unknown_zero_widens_a_curve_that_bends_and_no_straight_one():
    """A straight curve is as stiff everywhere; that of a sphere is a third of the share off."""
    error, widths = 50.0, []
    for exponent in (1.0, 2 / 3):
        bent = replace(
            record().blocks, deflection=SCALE * record().blocks.load ** exponent * 3000.0 ** (1.0 - exponent)
        )
        one = replace(record(), blocks=bent, load_error=error)
        (wider,), _ = with_shared_errors([[one]], [fit_data([one], NOISE)])
        fit = fit_law(LAWS["power"], False, wider)
        at = np.array([1000.0])
        gradient = fit.log_softness(at, False)[1]
        plain = fit_law(LAWS["power"], False, fit_data([one], NOISE))
        widths.append(math.sqrt(float((gradient @ (fit.covariance - plain.covariance) @ gradient.T)[0, 0])))
    assert widths[0] < 2e-3
    assert 0.3 < widths[1] / (error / 3.0 / 1000.0) < 1.5
