"""Pivot laws: the printed formulas, tangents by differences, measured curves and their cubics, files."""

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import tpjb_ident as ti
from model.bearing import BearingError, Pivot
from model.conditions import pads_of
from model.interpolation import rising_cubics
from model.measured_pivot import FormulaPivot, MeasuredPivot
from model.pad.pivot import ROCKER as BY_ROCKER
from model.pivots import (
    BEYOND_TEST,
    RIGID_PIVOT,
    ScaledPivot,
    constant_pivot,
    formula_pivot,
    load_pivots,
    measured_pivots,
    pivot_laws,
    pressed_beyond,
)
from model.setup import Setup

E, NU = 206e9, 0.3
ROCKER = Pivot("rocker", E, NU, contact_length=39.6e-3, housing_diameter=132.0e-3, pivot_diameter=119.6e-3)
SPHERE = Pivot("spherical", E, NU, sphere_diameter=0.4)
LOADS = [50.0, 500.0, 2000.0, 4375.0, 8750.0]


def printed_rocker(w: float) -> float:
    """Eq. (16), as printed [N/m]."""
    gap = 132.0e-3 - 119.6e-3
    inside = math.pi * E * 39.6e-3 * gap / (4 * w * (1 - NU**2))
    return math.pi * E * 39.6e-3 / (2 * (1 - NU**2) * (2 / 3 + math.log(inside)))


def printed_sphere(w: float) -> float:
    """Eq. (17), as printed [N/m]."""
    return w / (9 * w**2 * (1 - NU**2) ** 2 / (2 * E**2 * 0.4)) ** (1 / 3)


@pytest.mark.parametrize("w", LOADS)
def test_secants_are_the_printed_formulas(w):
    for pivot, printed in ((ROCKER, printed_rocker), (SPHERE, printed_sphere)):
        law = formula_pivot(pivot)
        assert law.secant(w) == pytest.approx(printed(w), rel=1e-12)
        assert law.deflection(w) == pytest.approx(w / printed(w), rel=1e-12)


@pytest.mark.parametrize("w", LOADS)
@pytest.mark.parametrize(
    "law",
    [
        formula_pivot(ROCKER),
        formula_pivot(SPHERE),
        constant_pivot(7e8),
        ScaledPivot(formula_pivot(ROCKER), 0.38),
        MeasuredPivot(np.array([0, 1e3, 3e3, 5e3]), np.array([0, 2e-6, 5e-6, 7.5e-6])),
    ],
    ids=["rocker", "sphere", "constant", "scaled", "measured"],
)
def test_tangent_is_the_derivative(law, w):
    step = 1e-4 * w
    slope = (law.deflection(w + step) - law.deflection(w - step)) / (2 * step)
    assert law.stiffness(w) == pytest.approx(1.0 / slope, rel=1e-5)
    assert law.vibration_stiffness(w) == law.stiffness(w)


def test_kirk_secant_deflects_alike_but_vibrates_with_the_secant():
    for pivot in (ROCKER, SPHERE):
        kirk, secant = formula_pivot(pivot), formula_pivot(pivot, secant_vibrations=True)
        assert secant.name == "kirk-secant"
        for w in LOADS:
            assert secant.deflection(w) == kirk.deflection(w)
            assert secant.stiffness(w) == kirk.stiffness(w)  # Newton needs the true slope
            assert secant.vibration_stiffness(w) == kirk.secant(w)


def test_rigid_pivots_give_nothing_and_no_load_moves_none_of_finite_stiffness():
    assert formula_pivot(Pivot("rigid")) == RIGID_PIVOT
    assert RIGID_PIVOT.deflection(1e9) == 0.0
    assert math.isinf(RIGID_PIVOT.stiffness(1.0))
    for law in (formula_pivot(ROCKER), formula_pivot(SPHERE), constant_pivot(1e9)):
        assert law.deflection(0.0) == 0.0
        assert 0 < law.stiffness(0.0) < math.inf


def test_rocker_formula_is_held_beyond_its_physics():
    law = FormulaPivot((BY_ROCKER, 1e9, 1e4, 1.0), "kirk")
    loads = np.linspace(10.0, 1e6, 400)
    deflection = [law.deflection(w) for w in loads]
    assert (np.diff(deflection) > 0).all()
    assert all(law.stiffness(w) > 0 for w in loads)


def test_measured_curve_goes_through_its_points_and_stays_monotone():
    load = np.array([0.0, 500.0, 1000.0, 2000.0, 4000.0])
    points = np.array([0.0, 2.0, 2.6, 4.1, 6.0]) * 1e-6
    law = MeasuredPivot(load, points)
    np.testing.assert_allclose([law.deflection(w) for w in load], points, rtol=1e-12)
    fine = [law.deflection(w) for w in np.linspace(0, 4000, 500)]
    assert (np.diff(fine) > 0).all()
    # on it goes with the last tangent
    beyond = law.deflection(5000.0) - law.deflection(4000.0)
    assert beyond == pytest.approx(1000.0 / law.stiffness(4000.0), rel=1e-9)


@pytest.mark.parametrize(
    ("load", "points", "message"),
    [
        ([0, 1, 1], [0, 1, 2], "rise strictly"),
        ([0, 1, 2], [0, 2, 1], "rise strictly"),
        ([0, 1, math.nan], [0, 1, 2], "load goes from 1 to nan"),
        ([1.0], [1.0], "1-D"),
        ([0, 1, 2], [0, 1], "alike"),
        ([-1, 1, 2], [-2, 1, 2], "rise strictly from zero: load goes from 0 to -1"),
    ],
)
def test_impossible_curves_are_refused(load, points, message):
    with pytest.raises(ValueError, match=message):
        MeasuredPivot(np.array(load, float), np.array(points, float))


def test_choices(rocker):
    assert [law.name for law in pivot_laws("kirk", rocker)] == ["kirk"] * 5
    assert pivot_laws("rigid", rocker)[0] == RIGID_PIVOT
    assert pivot_laws("kirk-secant", rocker)[0].vibration_stiffness(4375.0) == pytest.approx(printed_rocker(4375.0))
    assert pivot_laws(5e8, rocker) == (constant_pivot(5e8),) * 5
    one = constant_pivot(1e9)
    assert pivot_laws(one, rocker) == (one,) * 5
    assert "0.38" in ScaledPivot(one, 0.38).name
    mixed = (one, RIGID_PIVOT, one, RIGID_PIVOT, one)
    assert pivot_laws(mixed, rocker) == mixed


@pytest.mark.parametrize("choice", ["kerk", 0.0, -1.0, math.inf, math.nan, [constant_pivot(1.0)], "missing.toml"])
def test_bad_choices_are_refused(rocker, choice):
    with pytest.raises(BearingError, match="pivot"):
        pivot_laws(choice, rocker)


def pivots_file(*pads: str, schema: str = "tpjb-pivots/1") -> str:
    return "".join([f'schema = "{schema}"\n', *pads])


def pad_table(number: int, force: str = "[500.0, 1000.0]", deflection: str = "[1e-6, 2e-6]") -> str:
    return f"[[pads]]\npad = {number}\nforce_N = {force}\ndeflection_m = {deflection}\n"


def test_file_is_read_pad_by_pad(tmp_path, rocker):
    path = tmp_path / "pivots.toml"
    path.write_text(pivots_file(*(pad_table(k) for k in (3, 1, 2, 5, 4))), encoding="utf-8")
    laws = pivot_laws(path, rocker)
    assert len(laws) == 5
    assert laws[0].deflection(750.0) == pytest.approx(1.5e-6)
    again = pivot_laws(str(path), rocker)
    assert [law.deflection(1234.0) for law in again] == [law.deflection(1234.0) for law in laws]
    assert again != laws  # curves compare by identity, without an error about arrays
    assert len({*laws, *laws}) == 5


@pytest.mark.parametrize("factor", [1.0, 0.5])
@pytest.mark.parametrize(("loads", "pads"), [((4e3, 4e3), ()), ((4e3, 12e3), (2,)), ((9e3, 12e3), (1, 2))])
def test_a_prediction_says_which_pivots_are_pressed_harder_than_in_their_dry_tests(loads, pads, factor):
    table = {"force_N": [500.0, 6000.0], "deflection_m": [1e-6, 9e-6]}
    laws = measured_pivots([table | {"pad": 1, "valid_to_N": 5000.0}, table | {"pad": 2}], "dry")
    laws = [ScaledPivot(law, factor) if factor < 1.0 else law for law in laws]
    conditions = pressed_beyond([*laws, RIGID_PIVOT], np.array([*loads, 1e6]))
    assert [condition.pads for condition in conditions] == ([pads] if pads else [])
    assert pads_of(BEYOND_TEST, conditions) == pads


def test_predict_names_the_pads_that_press_measured_pivots_beyond_their_dry_tests(rocker, tmp_path):
    """It said nothing, where `compare` did."""
    path = tmp_path / "pivots.toml"
    path.write_text(pivots_file(*(pad_table(k) for k in range(1, 6))), encoding="utf-8")
    prediction = ti.predict(rocker, load=6000.0, speed=140.0, pivots=path)
    (beyond,) = (condition for condition in prediction.status if "dry tests" in condition)
    assert beyond.pads == tuple(np.flatnonzero(prediction.pad_load > 1000.0) + 1)
    assert 1 in beyond.pads
    assert beyond.severity == "warning"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema = 1 2", "cannot be read"),
        (pivots_file(pad_table(1), schema="tpjb-pivots/9"), "schema"),
        (pivots_file(), "no \\[\\[pads\\]\\]"),
        (pivots_file(*(pad_table(k) for k in (1, 2, 4, 5))), "Measure pad #3"),
        (pivots_file(*(pad_table(k) for k in range(1, 7))), "needs 1 to 5"),
        (pivots_file(pad_table(1, force="[2.0, 1.0]")), "pad 1: .* rise strictly from zero: load goes from 2 to 1"),
        (pivots_file(pad_table(1) + "stiffness_N_per_m = [-5e8, 6e8]\n"), "stiffness_N_per_m: entry 1 is -5"),
        (pivots_file(pad_table(1) + "stiffness_N_per_m = [5e8, 0.0]\n"), "stiffness_N_per_m: entry 2 is 0"),
        (pivots_file(pad_table(1, deflection="[-1e-6, 2e-6]")), "deflection goes from 0 to -1e-06"),
        (pivots_file(pad_table(1, force='["a", "b"]')), "pad 1"),
        (pivots_file("[[pads]]\npad = 1\n"), "force_N"),
        (pivots_file('[[pads]]\npad = "one"\n'), "must be a number from 1"),
        (pivots_file("[[pads]]\npad = true\n"), "must be a number from 1"),
        (pivots_file(pad_table(1) + pad_table(1)), "pad 1: has two"),
        (pivots_file(pad_table(1, force='["500", "1000"]')), "force_N: '500' is no number"),
        (pivots_file(pad_table(1, force="[true, 1000.0]")), "force_N: True is no number"),
        (pivots_file(pad_table(1, deflection="[nan, 2e-6]")), "deflection_m: nan is no number"),
        (pivots_file(pad_table(1, force=f"[1.0, 1{400 * '0'}]")), "too large to convert"),
        (pivots_file(pad_table(1) + "valid_too_N = 900.0\n"), "pad 1: 'valid_too_N' is not known. Did you mean"),
        (pivots_file(pad_table(1) + "valid_to_N = '900'\n"), "valid_to_N: '900' is no number"),
        (pivots_file(pad_table(1) + "valid_from_N = 900\nvalid_to_N = 800\n"), "valid from 900 to 800 N"),
        (pivots_file(pad_table(1) + "valid_from_N = -5\n"), "valid from -5"),
        ('schema = "tpjb-pivots/1"\nincludes_housing = "no"\n' + pad_table(1), "must be true or false"),
        ('schema = "tpjb-pivots/1"\ninclude_housing = false\n' + pad_table(1), "is not known. Did you mean"),
    ],
)
def test_broken_files_say_what_and_where(tmp_path, text, message):
    path = tmp_path / "pivots.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BearingError, match=message):
        load_pivots(path, 5)


def test_a_list_of_numbers_is_no_list_of_laws_and_the_message_says_what_is(rocker):
    """It said "need one pivot law per pad (5), got 5 entries"."""
    with pytest.raises(BearingError, match=r"need 5 pivot laws, one per pad, such as constant_pivot.*; got \[500"):
        pivot_laws([5e8] * 5, rocker)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3, 9])
def test_cubics_are_those_of_scipy(seed, count):
    x, y = np.sort(np.random.default_rng(seed).normal(size=(2, count)), axis=1)
    np.testing.assert_allclose(rising_cubics(x, y), PchipInterpolator(x, y).c, rtol=1e-9, atol=1e-12)


def test_a_set_up_has_as_many_pivots_as_pads(rocker):
    with pytest.raises(BearingError, match=r"one pivot law per pad \(5\), got 4"):
        Setup(rocker, pivot_laws("rigid", rocker)[:4])
