"""Equilibria: their conditions from scratch, limits, symmetry, changes of regime; pivot laws and mixing as the compiled
search has them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect
from model.film.dense import DEPTH, mixed
from model.measured_pivot import FormulaPivot, MeasuredPivot
from model.pad.pivot import OTHER, compliance, deflection
from model.pivots import RIGID_PIVOT, ScaledPivot, ask_laws, constant_pivot, encoded, formula_pivot
from model.predict import predict
from model.prediction import Prediction
from model.statics import search
from model.statics.search import Search
from model.statics.solve import _NEAR
from tests.model.points import DOWN, SPEED, close, run
from tests.rigs import random_bearings
from tests.rigs.bearings import changed_pads, ring


def assert_equilibrium(p: Prediction) -> None:
    for name, value in random_bearings.errors(p).items():
        assert value <= random_bearings.LIMITS[name], (name, value)


@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
@pytest.mark.parametrize("pivots", ["rigid", "kirk", 4e8])
def test_conditions_of_equilibrium_from_scratch(rocker, thermal, pivots):
    for direction in (DOWN, 0.3):
        assert_equilibrium(run(rocker, direction=direction, pivots=pivots, thermal=thermal))


@pytest.mark.parametrize(
    ("condition", "margin", "spoil"),
    [
        ("reynolds", 10.0, lambda films: setattr(films[0], "tilt", films[0].tilt + 1e-6)),
        ("pivot", 1.0, lambda films: setattr(films[1], "deflection", films[1].deflection + 1e-9)),
        ("force", 10.0, lambda films: films[0].work.pressure.__imul__(1.0001)),
        ("heat", 10.0, lambda films: films[0].work.temperature[5:].__iadd__(0.01)),
        ("missed", 1.0, lambda films: setattr(films[2], "idle", True)),
    ],
)
def test_every_condition_can_fail(rocker, condition, margin, spoil):
    # the check is worth something only if it sees a wrong answer
    p = run(rocker)
    spoil(p.equilibrium.films)
    assert random_bearings.errors(p)[condition] > margin * random_bearings.LIMITS[condition]


def test_very_stiff_pivots_are_rigid(rocker):
    rigid, stiff = (run(rocker, pivots=pivots) for pivots in ("rigid", 1e14))
    np.testing.assert_allclose(stiff.k, rigid.k, atol=2e-5 * rigid.kyy)
    np.testing.assert_allclose(stiff.c, rigid.c, atol=2e-5 * rigid.cyy)
    np.testing.assert_allclose(stiff.position, rigid.position, atol=1e-10)


def test_five_equal_pads_without_load_are_isotropic(rocker):
    p = run(rocker, load=0.0)
    np.testing.assert_allclose(p.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diag(p.k), p.kxx, rtol=1e-6)
    np.testing.assert_allclose(p.k[0, 1], -p.k[1, 0], rtol=1e-6)
    np.testing.assert_allclose(np.diag(p.c), p.cxx, rtol=1e-6)


def test_where_no_pad_has_a_curve_a_neighbour_is_not_moved():
    # at full speed the films are too hot for curves; from a journal in the middle the search ends with pad 2 idle
    angles = [math.radians(60.0 * k) for k in range(6)]
    clearances, oil = (177.845e-6, 109.787e-6), (0.01128108, 39.50594)
    hot = ring(angles, (0.2675282, 0.196916), 0.733297, clearances, oil, 0.583873)
    alone, heavier = (predict(hot, load, 1.532345, 515.8327, pivots=1.504415e8) for load in (14560.3, 21840.5))
    assert alone.converged
    assert np.isnan(alone.equilibrium.begun.position).all()
    assert heavier.idle_pads == alone.idle_pads == ()
    warm = predict(hot, 14560.3, 1.532345, 515.8327, pivots=1.504415e8, start=heavier)
    close(warm.h, alone.h, 1e-6)


def test_a_neighbour_moved_as_the_curves_are_is_nearer(rocker):
    # 1.5 times the load: as far as a search from nothing, or nearer, by one iteration and more where pads bend
    for thermal, saved in (("isothermal", 0), ("adiabatic", 0), ("tehd", 1)):
        start = run(rocker, load=4000.0, thermal=thermal)
        steps = [run(rocker, thermal=thermal, start=s).equilibrium for s in (None, start)]
        assert steps[1].iterations <= steps[0].iterations - saved, thermal


def test_upper_pads_unload_and_are_listed(rocker):
    p = run(rocker, load=8750.0, pivots=4e8)
    assert p.idle_pads == (3, 4)
    assert p.status == ("idle pads 3, 4",)
    assert (p.pad_load[2:4] == 0.0).all()
    assert [m.number for m in p.pad_matrices] == [1, 2, 5]
    assert_equilibrium(p)


@pytest.mark.slow
def test_offset_pads_take_up_their_load_on_their_pivots(rocker):
    # preload 0.1 and a pivot behind the middle: the pads carry down to a fold at a < 0, on soft pivots beyond it
    pads = tuple(replace(p, pivot_offset=0.55, pad_clearance=p.assembled_clearance / 0.9) for p in rocker.pads)
    for pivots in (2e8, 1e9, "rigid"):
        for load in (300.0, 2000.0, 6000.0):
            assert_equilibrium(run(rocker.with_pads(pads), load=load, direction=0.4, pivots=pivots))


def three_pads(rocker: Bearing, arc: float) -> Bearing:
    """Preload 0.1, pivots behind the middle: lightly loaded pads take up and shed their load with a jump."""
    pad = replace(rocker.pads[0], arc=arc, pivot_offset=0.55, pad_clearance=80e-6 / 0.9)
    return rocker.with_pads(tuple(replace(pad, pivot_angle=k * 2 * math.pi / 3) for k in range(3)))


@pytest.mark.slow
def test_no_steady_state_is_a_named_status(rocker):
    p = predict(three_pads(rocker, 1.7), 1500.0, 1.0, SPEED, pivots=3e8)
    assert not p.converged
    assert p.status[0] == "pads 3 can neither carry nor idle"
    assert np.isnan(p.k).all()
    assert np.isnan(p.c).all()


def test_a_pad_that_cannot_keep_its_load_is_named(rocker):
    p = run(three_pads(rocker, 1.4), load=1500.0, direction=1.0, pivots=3e8)
    assert p.status == ("pads 3 cannot keep their load", "idle pads 3")
    assert_equilibrium(p)
    # it would carry there, alone: its journal stands nearer than the edge of carrying, and the film opens both ways
    film = p.equilibrium.films[2]
    search = Search(p.setup, 1500.0 * np.array([math.cos(1.0), math.sin(1.0)]), SPEED)
    assert search.start_from(p.equilibrium)
    assert search.margins()[2] > _NEAR
    assert film.preload_distance + film.normal @ p.position <= 0.0


def test_forces_are_as_accurate_as_asked_for_after_a_few_iterations(rocker):
    p = run(rocker)
    films = p.equilibrium.films
    push = sum(f.forces.force[0] * f.normal + f.forces.force[1] * f.tangent for f in films)
    assert np.hypot(push[0], push[1] + 5000.0) < 5000.0 * p.setup.accuracy == pytest.approx(5e-4)
    assert 1 < p.equilibrium.iterations < 20


def test_one_law_per_pad(rocker):
    stiffness = [1e9, 5e8, 8e8, 3e8, 2e9]
    laws = [constant_pivot(k) for k in stiffness]
    p = run(rocker, pivots=laws)
    np.testing.assert_allclose(p.deflection, p.pad_load / stiffness, rtol=1e-6, atol=1e-13)


@pytest.mark.slow
def test_sixty_random_bearings():
    outcome = random_bearings.run(random_bearings.draw(60, seed=11), turn_every=12)
    assert outcome.converged >= 59
    assert outcome.wrong == []
    assert outcome.asymmetry < 1e-6
    assert outcome.converged + sum(outcome.statuses.values()) == 60


def test_a_hot_ring_without_preload_carries_on_all_pads():
    # heated, central pivots carry beyond zero: an independent program finds all five pads loaded, preloading each other
    angles = [math.radians(-54.0 + 72.0 * k) for k in range(5)]
    bearing = ring(angles, (0.155476, 0.143519), 1.07298, (95.935e-6, 95.935e-6), (0.05392, 38.545))
    point = {"load": 4094.6, "direction": -1.8745, "speed": 912.77, "pivots": 9.1884e8}
    p = run(bearing, **point)
    assert p.idle_pads == ()
    assert p.pad_load.min() > 0.5 * p.load  # light load: they push one another
    assert_equilibrium(p)
    np.testing.assert_allclose(p.k, run(bearing, **point, mesh=(160, 12)).k, atol=1e-3 * p.kyy)
    warm = run(bearing, **point, start=predict(bearing, 8000.0, 0.5, 700.0, pivots=9.1884e8))
    np.testing.assert_allclose(warm.k, p.k, atol=1e-4 * p.kyy)


@pytest.mark.slow
def test_a_heated_film_carries_on_a_wedge_that_opens():
    # three pads without preload, the load almost on one of them: heat alone balances the other
    angles = [2.0 * math.pi / 3.0 * k for k in range(3)]
    bearing = ring(angles, (0.207696, 0.215088), 1.745329, (85.13593e-6, 85.13593e-6), (0.0324235, 38.791))
    p, fine, heavier = (
        predict(bearing, load, 1.79937, 577.7065, pivots=1.948773e8, mesh=mesh)
        for load, mesh in ((13473.0, (40, 4)), (13473.0, (80, 8)), (20210.0, (40, 4)))
    )
    assert p.idle_pads == fine.idle_pads == (3,)
    film = p.equilibrium.films[0]
    assert film.forces.force[0] > 4000.0
    assert film.tangent @ p.equilibrium.position + film.pivot_radius * film.tilt < 0.0  # the wedge
    close(fine.h, p.h, 1e-4)
    warm = predict(bearing, 13473.0, 1.79937, 577.7065, pivots=1.948773e8, mesh=(40, 4), start=heavier)
    close(warm.h, p.h, 1e-6)
    between = predict(bearing, 13473.0, math.pi / 3.0, 577.7065, pivots=1.948773e8, mesh=(40, 4))
    assert between.converged


@pytest.mark.slow
def test_where_no_set_of_pads_finds_rest_that_is_named():
    # four pads without preload: where one idles the journal comes so near that it would carry, and carrying pushes off
    angles = [math.pi / 2.0 * k for k in range(4)]
    bearing = ring(angles, (0.12706343, 0.12509399), 1.223715, (74.85854e-6, 74.85854e-6), (0.02813447, 45.716114))
    p = predict(bearing, 18524.038, -2.0754574, 1316.3273, pivots=2.755724547e9, mesh=(40, 4))
    assert not p.converged
    assert "no set of pads finds rest" in p.status


@pytest.mark.slow
def test_soft_pivots_carry_to_the_end_of_a_heated_curve():
    # heat balances a film down to a wedge that opens and carries nothing; what a pivot gives keeps that stable
    angles, oil = [math.tau * k / 4 for k in range(4)], (0.0415357, 30.1723)
    bearing = ring(angles, (0.214712, 0.257307), math.radians(81.42), (116.0559e-6, 116.0559e-6), oil)
    case = {"pivots": 2.115937e9, "thermal": "adiabatic"}
    lighter, p, heavier = (predict(bearing, 14577.55 * x, math.pi / 4.0, 486.1686, **case) for x in (0.6, 1.0, 1.5))
    assert lighter.idle_pads == p.idle_pads == ()
    assert heavier.idle_pads == (3, 4)
    assert 0.0 < p.pad_load[3] < 0.01 * p.load
    assert "pads 3, 4 on the edge of carrying" in p.status
    for start in (lighter, heavier):
        warm = predict(bearing, 14577.55, math.pi / 4.0, 486.1686, start=start, **case)
        close(warm.h, p.h, 1e-4)


@pytest.mark.slow
def test_of_two_mirror_images_the_last_pad_idles_and_the_other_is_named():
    angles, oil = [math.tau * k / 6 for k in range(6)], (0.0672554, 30.4977)
    bearing = ring(angles, (0.1178982, 0.0788828), math.radians(36.14), (114.6207e-6, 114.6207e-6), oil)
    for mesh in ((40, 4), (96, 8)):
        p = predict(bearing, 598.6525, math.pi / 6.0, 456.4751, pivots=1.979934e8, thermal="adiabatic", mesh=mesh)
        assert p.status == ("another equilibrium exists", "idle pads 5")
        assert p.status[0].pads == (4,)


def test_a_pad_lets_go_where_the_shaft_leans_before_its_straight_curve_does():
    # ends that lean off by a tenth of the clearance: a pad idles where a straight shaft would load it
    angles = [math.radians(72.0 * k - 90.0) for k in range(5)]
    size, oil = (0.1005729, 0.08307), (0.0275, 45.47)
    bearing = ring(angles, size, math.radians(57.82), (73.87e-6, 69.24e-6), oil, 0.464)
    load = 3349.0, math.radians(150.0), 267.8
    leaning = [[Effect("misalignment", angle=angle, direction=0.0)] for angle in np.linspace(1e-5, 7e-4, 8)]
    path = [predict(bearing, *load, pivots=6e8, effects=effects) for effects in leaning]
    assert all(p.converged for p in path)
    assert [p.idle_pads for p in path] == [(1, 2)] * 2 + [(1, 2, 3)] * 6
    assert path[1].pad_load[2] < 0.5 * path[0].pad_load[2]
    steps = np.diff([p.position for p in path], axis=0)
    assert np.abs(steps).max() < 2e-6
    assert np.all(np.linalg.norm(np.diff(steps, axis=0), axis=1) < 0.5e-6)  # it goes on where the pad lets go


CURVE = MeasuredPivot(np.array([0.0, 500.0, 2000.0, 6000.0]), np.array([0.0, 2e-6, 5e-6, 1e-5]))


class Own(FormulaPivot):
    """A law of somebody's own, which happens to be known otherwise."""


OWN = Own(constant_pivot(5e8).numbers, "own")


def laws(bearing):
    kirk = formula_pivot(bearing.pivot)
    return [kirk, RIGID_PIVOT, constant_pivot(5e8), CURVE, ScaledPivot(ScaledPivot(CURVE, 2.0), 0.4)]


@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_laws_as_numbers_say_what_the_laws_say(request, name):
    given = laws(request.getfixturevalue(name))
    rows, curves = encoded(given)
    for law, row, curve in zip(given, rows, curves, strict=True):
        for load in (-5.0, 0.0, 1e-6, 3.0, 500.0, 5900.0, 6000.0, 9000.0, 1e7):
            assert deflection(row, curve, load) == pytest.approx(law.deflection(max(load, 0.0)), rel=1e-13, abs=1e-30)
            if load > 0.0:
                assert compliance(row, curve, load) == pytest.approx(1.0 / law.stiffness(load), rel=1e-13)


def test_a_law_of_ones_own_is_asked_step_by_step(rocker):
    rows, _ = encoded([OWN, constant_pivot(5e8)])
    assert rows[0, 0] == OTHER != rows[1, 0]
    ask_laws([OWN, constant_pivot(5e8)], rows, np.array([3000.0, 10.0]))
    np.testing.assert_allclose(rows[0, 1:3], [3000.0 / 5e8, 1.0 / 5e8])
    assert encoded([OWN])[0][0, 1] == 0.0  # what was asked stays where it was asked for
    for thermal in ("isothermal", "adiabatic", "tehd"):
        own, known = (run(rocker, direction=-1.3, pivots=laws, thermal=thermal) for laws in ([OWN] * 5, 5e8))
        close(own.h, known.h, 1e-6)


def anderson(states: np.ndarray, images: np.ndarray) -> np.ndarray:
    """Type II mixing by numpy: the image whose residual, mixed with the earlier ones, is least."""
    residuals = images - states
    changes = (residuals[-1] - residuals[:-1]).T
    mix = np.linalg.lstsq(changes, residuals[-1], rcond=None)[0]
    return images[-1] - mix @ (images[-1] - images[:-1])


def test_mixing_is_andersons():
    rng = np.random.default_rng(4)
    states, images = rng.normal(size=(2, DEPTH + 1, 30))
    for count in range(2, DEPTH + 2):
        expected = anderson(states[:count], images[:count])
        np.testing.assert_allclose(mixed(images, images - states, count), expected, rtol=1e-6)
    np.testing.assert_array_equal(mixed(images, images - states, 1), images[0])


def test_two_side_pads_that_only_carry_together_are_found_from_a_neighbour_without_them():
    # hot films of no preload: each pad alone would push the journal to where it loses its load
    angles = np.radians([-90.0, 0.0, 90.0, 180.0])
    bearing = ring(angles.tolist(), (0.1, 0.06), math.radians(70.0), (1e-4, 1e-4), (0.03, 45.0))
    point = {"load": 2000.0, "speed": 600.0, "pivots": "rigid"}
    turned = predict(bearing, load_direction=-math.pi / 2 + 0.4, **point)
    assert turned.idle_pads == (3, 4)
    cold = predict(bearing, load_direction=-math.pi / 2, **point)
    warm = predict(bearing, load_direction=-math.pi / 2, start=turned, **point)
    assert cold.idle_pads == warm.idle_pads == (3,)
    close(warm.h, cold.h, 1e-5)


@pytest.mark.parametrize(("preload", "load", "direction"), [(0.1, 8750.0, -0.5), (0.05, 5000.0, -0.3)])
def test_a_pad_near_its_fold_that_only_a_frozen_film_calls_unstable_carries(spherical, preload, load, direction):
    pads = (replace(p, pad_clearance=p.assembled_clearance / (1.0 - preload)) for p in spherical.pads)
    bearing = spherical.with_pads(tuple(pads))
    point = {"direction": direction * math.pi, "speed": 2 * math.pi * 500.0}
    p = run(bearing, load=load, **point)
    assert p.idle_pads == ()
    # the heated film holds it: a little more load moves the journal a little further, along the same branch
    near = [run(bearing, load=s * load, **point).position for s in (0.998, 1.002)]
    np.testing.assert_allclose(0.5 * (near[0] + near[1]), p.position, rtol=2e-3, atol=1e-12)
    assert 0.0 < float(np.hypot(*(near[1] - near[0]))) < 1e-6


def test_a_loaded_pad_whose_pivot_is_behind_the_middle_is_in_no_doubt(rocker, monkeypatch):
    # its wedge is flatter than that of its fold, as is what comes back from there; but that carries less than the fold
    def asked(*arguments):
        raise AssertionError("asked whether a pad is stable that carries many times the load at its fold")

    monkeypatch.setattr(search, "heat_impedance", asked)
    behind = changed_pads(rocker, pivot_offset=0.6)
    assert run(behind, load=8000.0, speed=2 * math.pi * 60, pivots="rigid").idle_pads == ()
