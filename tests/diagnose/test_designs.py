"""Tests that could follow: the other sense of rotation, hot polygon, hotter oil, and trials of next tests."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.bench import Bench
from tests.studies.diagnosis.next_test_bench import followed_by_all, next_bench, of_data_set, tabled
from tests.studies.diagnosis.next_test_trials import NextTrial, next_trials, run_next_trial
from tests.studies.diagnosis.surrogate import EffectTable, Surrogate, tabulate
from tpjb_ident.diagnose.diagnose import pose
from tpjb_ident.diagnose.forward.forward import Forward
from tpjb_ident.diagnose.forward.nuisance import whitener
from tpjb_ident.diagnose.next_test.checks import CHECKS
from tpjb_ident.diagnose.next_test.designs import Design, designs
from tpjb_ident.diagnose.next_test.mirrored import mirrored, reversible
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.plan.data_sets import masks, part_of
from tpjb_ident.diagnose.plan.planned import around, dry, dynamic, planned_observations
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
SPEED = 2 * math.pi * 22
LINE = 2 * math.pi * 25
#: Without thermometers thin oil and warm oil are alike.
ALIKE = ("oil_viscosity", "supply_temperature")


@pytest.fixture(scope="module")
def setup():
    bearing = load_bearing(BEARINGS / "rocker.toml")
    return Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(24, 4), accuracy=1e-5)


@pytest.fixture(scope="module")
def found(setup):
    return designs(setup, Layout(dynamic([3000.0, 5000.0, 7000.0], [LINE], SPEED, -math.pi / 2, 5)))


def by_words(found, words):
    (one,) = (d for d in found if words in d.words)
    return one


def predicted(design, setup, *effects):
    seen = design.planned(setup)
    return design.forward(setup, seen)(effects)


def test_a_mirror_seen_in_a_mirror_is_the_thing_itself(setup):
    there = Effect("misalignment", angle=1e-4, direction=0.4)
    tilted = setup.change(misalignment=(there.parameters["angle"], there.parameters["direction"]))
    back = mirrored(mirrored(tilted))
    assert back.misalignment == pytest.approx(tilted.misalignment)
    assert [p.pivot_angle for p in back.bearing.pads] == pytest.approx([p.pivot_angle for p in setup.bearing.pads])


def test_the_other_sense_of_rotation_swaps_what_is_left_and_right(setup, found):
    reverse = by_words(found, "turning the other way")
    straight = Design("as it was", Layout(dynamic([3000.0, 5000.0, 7000.0], [LINE], SPEED, -math.pi / 2, 0)))
    names = [e.observable for e in reverse.planned(setup).elements]
    h = np.array([n[0] in "kc" for n in names])
    five = predicted(reverse, setup, Effect("soft_pivot", pad=5, stiffness_factor=0.5))[h]
    two = predicted(straight, setup, Effect("soft_pivot", pad=2, stiffness_factor=0.5))
    assert five == pytest.approx(two, rel=1e-4, abs=2e-4 * np.abs(two).max())
    assert np.abs(five - predicted(straight, setup)).max() > 1e-2 * np.abs(two).max()


def test_a_sensor_error_does_not_turn_with_the_shaft(setup, found):
    reverse = by_words(found, "turning the other way")
    crossed = Effect("loadcell_crosstalk", fraction=0.01)
    change = predicted(reverse, setup, crossed) - predicted(reverse, setup)
    straight = Design("as it was", reverse.layout)  # the same points, not in the mirror
    same = predicted(straight, setup, crossed) - predicted(straight, setup)
    names = np.array([e.observable for e in reverse.planned(setup).elements])
    assert change[names == "kxy"] == pytest.approx(-same[names == "kxy"], rel=1e-3)


def test_pads_that_carry_one_way_only_are_not_reversed(setup):
    offset = setup.change_pads(lambda k, pad: replace(pad, pivot_offset=0.6))
    assert reversible(setup)
    assert not reversible(offset)
    assert not any("other way" in d.words for d in designs(offset, Layout(dynamic([5e3], [LINE], SPEED, 0.0, 0))))


def test_growth_shows_in_a_hot_polygon_only(setup, found):
    growth = Effect("thermal_growth", clearance_change=7e-6)
    for words, wanted in (("still hot", 7e-6), ("200 N, cold", 0.0)):
        design = by_words(found, words)
        change = predicted(design, setup, growth) - predicted(design, setup)
        assert change[:5] == pytest.approx(np.full(5, wanted), abs=1e-12)


def test_hotter_oil_is_hotter_and_thinner(setup, found):
    hot = predicted(by_words(found, "10 K hotter"), setup)
    cold = predicted(by_words(found, "turning the other way"), setup)  # a symmetric bearing: as it was
    names = [e.observable for e in by_words(found, "10 K hotter").planned(setup).elements]
    warmer = np.array([h - c for h, c, n in zip(hot, cold, names, strict=True) if n == "pad_temperature"])
    assert np.median(warmer) == pytest.approx(9.0, abs=3.0)


def test_plenty_of_oil_ends_starvation_and_is_no_test_for_carry_over(setup, found):
    plenty = by_words(found, "so much oil")
    starved, carried = [Effect("starvation", arc_fraction=0.1)], [Effect("hot_oil_carryover", fraction=0.4)]
    assert not plenty.acting(starved)
    assert plenty.fits(starved, [])
    assert not plenty.fits(starved, carried)


@pytest.fixture(scope="module")
def bench(setup):
    lines = [2 * math.pi * f for f in (20.0, 25.0, 30.0)]
    sweep = dynamic([3000.0, 7000.0], lines, SPEED, -math.pi / 2, 5)
    layout = Layout(sweep, around(5000.0, 3, SPEED), dry(range(1, 6)), 200.0)
    planned = planned_observations(setup, layout)
    forward = Forward(setup, layout, planned.elements)
    posed = pose(planned, forward, DiagnoseSettings())
    posed = replace(posed, pool=tuple(c for c in posed.pool if c.name in ALIKE))
    factor = whitener(posed.observations, posed.nuisances.columns)
    tables = tuple(tabulate(forward, posed.base, c, factor, 25.0) for c in posed.pool)
    surrogate = Surrogate(planned.elements, posed.base, posed.pool, tables)
    return Bench(planned, posed, surrogate, np.zeros_like(posed.base))


@pytest.mark.slow
def test_parts_of_a_campaign_have_their_elements_and_their_tests(bench):
    layout = bench.observations.layout
    speeds = {t.speed for t in layout.dynamic}
    for name, mask in masks(bench.observations.elements, speeds).items():
        if name in "ABCD":
            alone = of_data_set(bench, name)
            assert len(alone.observations) == mask.sum()
            assert alone.observations.layout == part_of(layout, name)
    assert part_of(layout, "A").dynamic[0].excitation == (LINE,)
    assert not part_of(layout, "B").locus
    assert part_of(layout, "C").push_load == 200.0


@pytest.mark.slow
def test_a_test_that_follows_settles_what_the_campaign_cannot_tell(setup, bench):
    alone = of_data_set(bench, "B")
    wanted = ("viscometer", "probes moved", "balance", "1000 N, cold")
    options = [*designs(setup, alone.observations.layout), *CHECKS]
    chosen = [o for o in options if any(w in o.words for w in wanted)]
    assert len(chosen) == len(wanted)
    nb = next_bench(alone, [tabled(setup, alone, o) for o in chosen])
    assert len(nb.whole.observations) == len(alone.observations) + sum(len(p.seen) for p in nb.parts)
    rows = [run_next_trial((nb, alone), t) for t in next_trials([c.label for c in alone.pool], "B", 3)]
    asked = [r for r in rows if "then_tests" in r]
    assert len(asked) >= 5
    assert {r["verdict"] for r in asked} == {"ambiguous"}
    assert np.mean([r["then_settled"] for r in asked]) >= 0.8
    assert np.mean([r["then_settled"] for r in asked]) > np.mean([r["random_settled"] for r in asked])
    first = asked[0]
    trial = NextTrial("hidden", first["truth"], first["size"], 1.0, first["number"], "B")
    assert run_next_trial((nb, alone), trial) == first
    assert all(r["then_expected"] > r["apart_now"] for r in asked)


def thinned(surrogate):
    """Tables of the ends and the neutral amplitude alone: a few solves each, kept in files like any others."""
    tables = []
    for candidate, table in zip(surrogate.candidates, surrogate.tables, strict=True):
        (neutral,) = np.flatnonzero(table.amplitudes == candidate.neutral)
        kept = sorted({0, int(neutral), len(table.amplitudes) - 1})
        tables.append(EffectTable(table.amplitudes[kept], table.changes[kept]))
    return replace(surrogate, tables=tuple(tables))


@pytest.mark.slow
def test_tables_of_tests_are_kept_between_runs(setup, bench, tmp_path):
    short = of_data_set(bench, "A")
    short = replace(short, surrogate=thinned(short.surrogate))
    first = followed_by_all(setup, short, lambda name: tmp_path / f"{name}.npz")
    files = {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    again = followed_by_all(setup, short, lambda name: tmp_path / f"{name}.npz")
    assert {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()} == files
    assert np.array_equal(first.whole.surrogate.base, again.whole.surrogate.base)
    assert len(files) == sum(isinstance(p.option, Design) for p in first.parts)
