"""Tables, bands and pivots.toml in limits that are known exactly: laws without any error of their own."""

import math
import tomllib

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from tpjb_ident.conditions import Condition
from tpjb_ident.pivot.curve import EXTRAPOLATION_SPREAD, Hysteresis, PivotCurve, PivotSteps, measure_loop
from tpjb_ident.pivot.dry_record import PadDirection
from tpjb_ident.pivot.fit import _loop
from tpjb_ident.pivot.law_fit import LawFit
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.tables import load_grid, pads_table, pivot_table, pivots_text, table_loads, write_pivots

REFERENCE, SCALE = 2000.0, 4e-9


def law(name="linear", contact=False, errors=(0.0, 0.0, 0.0), scale=SCALE, friction=0.0, shape=()):
    """A fit with stated standard errors of zero reading, friction and ln scale."""
    theta = [2e-5, friction, math.log(scale), *shape, *((3e-6, math.log(500.0)) if contact else ())]
    covariance = np.zeros((len(theta), len(theta)))
    covariance[:3, :3] = np.diag(np.square(errors))
    return LawFit(LAWS[name], REFERENCE, contact, np.array(theta), covariance, 0.0, 5.0, 10)


def curve(fits=None, weights=(1.0,), **changes):
    load = np.linspace(400.0, 5000.0, 10)
    steps = PivotSteps(load, SCALE * load, np.full(10, 1e-8), 0 * load, 0 * load, np.ones(10, dtype=int), np.ones(10))
    fields = {
        "pad": 1, "angle": -np.pi / 2, "steps": steps, "fits": fits or (law(),), "weights": np.array(weights),
        "onset_load": 0.0, "onset_load_se": 0.0, "valid_from": 400.0, "valid_to": 5000.0,
        "load_direction": PadDirection(0.02, 0.001), "displacement_direction": PadDirection(0.1, 0.01),
    }  # fmt: skip
    return PivotCurve(**(fields | changes))


INSIDE = np.array([400.0, 1000.0, 5000.0])
ROCKER = law("hertz-line", shape=(0.1,))


def test_stiffness_is_the_slope_of_the_deflection_and_secant_is_load_over_it():
    one, step = curve((ROCKER,)), 0.1
    loads = np.array([50.0, 250.0, 1000.0, 2000.0, 4000.0, 8000.0])
    slope = 2 * step / (one.deflection(loads + step) - one.deflection(loads - step))
    assert one.stiffness(loads) == pytest.approx(slope, rel=1e-5)
    assert one.secant(loads) == pytest.approx(loads / one.deflection(loads), rel=1e-12)
    assert np.all(one.stiffness(loads) > one.secant(loads))


@pytest.mark.parametrize("bad", [-1.0, -1e-9, np.nan, [100.0, -5.0]])
def test_impossible_loads_are_refused(bad):
    for quantity in (curve().stiffness, curve().secant, curve().deflection, curve().is_extrapolated):
        with pytest.raises(ValueError, match="load must be zero or positive"):
            quantity(bad)


def test_a_law_without_error_has_no_band_among_the_points_and_a_logarithmic_one_beyond():
    one = curve()
    np.testing.assert_array_equal(one.relative_stiffness_se(INSIDE), 0.0)
    for far in (5000.0 * math.e, 400.0 / math.e):
        assert one.relative_stiffness_se(far) == pytest.approx(EXTRAPOLATION_SPREAD)
    assert one.relative_stiffness_se(5000.0 * math.e**3) == pytest.approx(3 * EXTRAPOLATION_SPREAD)
    lo, hi = one.secant_band(5000.0 * math.e, 0.9)
    assert hi / lo == pytest.approx(math.exp(2 * 1.6448536269514722 * EXTRAPOLATION_SPREAD))
    # the band at no load at all is that at a millionth of the largest
    assert one.relative_stiffness_se(0.0) == pytest.approx(EXTRAPOLATION_SPREAD * math.log(400.0 / 5e-3))


def test_an_error_of_the_scale_is_that_of_the_stiffness():
    one = curve((law(errors=(1e-7, 0.01, 0.03)),))
    np.testing.assert_allclose(one.relative_stiffness_se(INSIDE), 0.03, rtol=1e-12)
    # and moves all loads alike; beyond the points each has an error of its own
    np.testing.assert_allclose(one.relative_stiffness_covariance(INSIDE), 0.03**2, rtol=1e-9)
    joint = one.relative_stiffness_covariance(far := np.array([1000.0, 4000.0, 15000.0]))
    np.testing.assert_allclose(np.sqrt(np.diag(joint)), one.relative_stiffness_se(far), rtol=1e-12)
    lo, hi = one.stiffness_band(INSIDE)
    np.testing.assert_allclose(np.log(hi * SCALE), 1.959963984540054 * 0.03, rtol=1e-9)
    np.testing.assert_allclose(lo * hi, SCALE**-2.0, rtol=1e-12)
    np.testing.assert_allclose(one.secant_band(INSIDE), one.stiffness_band(INSIDE), rtol=1e-12)


def test_laws_that_disagree_widen_the_band_by_their_distance():
    two = curve((law(), law(scale=1.1 * SCALE)), (0.8, 0.2))
    np.testing.assert_allclose(two.relative_stiffness_se(INSIDE), math.sqrt(0.2) * math.log(1.1), rtol=1e-9)
    sphere = curve((law(), law("hertz-point")), (0.5, 0.5))
    # tangent and secant of a sphere: u^(1/3) and 2/3 u^(1/3) of a linear pivot's
    for secant, factor in ((False, 1.0), (True, 1.5)):
        band = (sphere.secant_band if secant else sphere.stiffness_band)(INSIDE)
        apart = np.log(factor / np.cbrt(INSIDE / REFERENCE))
        by_hand = 1.959963984540054 * np.sqrt(0.5) * np.abs(apart)
        np.testing.assert_allclose(0.5 * np.log(band[1] / band[0]), by_hand, rtol=1e-9)


def test_the_band_of_readings_is_that_of_the_points():
    """Straight law: a relative error of the scale times the deflection; the zero's error moves every reading."""
    one = curve((law(errors=(2e-7, 0.0, 0.01)),))
    value, lo, hi = one.reading_band(INSIDE)
    np.testing.assert_allclose(value, SCALE * INSIDE, rtol=1e-9)
    half = 1.959963984540054 * np.hypot(2e-7, 0.01 * SCALE * INSIDE)
    np.testing.assert_allclose(hi - value, half, rtol=1e-9)
    np.testing.assert_allclose(value - lo, half, rtol=1e-9)
    two = curve((law(), law(scale=1.1 * SCALE)), (0.8, 0.2))
    value, lo, hi = two.reading_band(INSIDE.reshape(3, 1))
    assert value.shape == (3, 1)
    by_hand = 2 * 1.959963984540054 * math.sqrt(0.2) * 0.1 * SCALE * INSIDE
    np.testing.assert_allclose((hi - lo)[:, 0], by_hand, rtol=1e-9)
    # a load that reaches the pivot is what friction left of the applied one
    held = curve((law(friction=0.04),))
    np.testing.assert_allclose(held.reading_band(INSIDE)[0], SCALE * INSIDE, rtol=1e-9)
    # the way into contact belongs to the readings; their band grows on beyond the points
    lost = curve((law(contact=True, errors=(0.0, 0.0, 1e-4)),), onset_load=2000.0, valid_from=2000.0)
    loads = np.array([500.0, 2500.0, 5000.0, 7500.0])
    value, lo, hi = lost.reading_band(loads)
    np.testing.assert_allclose(value, SCALE * loads - 3e-6 * np.exp(-loads / 500.0), rtol=1e-9)
    np.testing.assert_allclose(0.5 * (hi - lo), 1.959963984540054e-4 * SCALE * loads, rtol=1e-6)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.5, 1.5, math.nan])
def test_a_coverage_that_is_none_is_refused(level):
    for band in (curve().stiffness_band, curve().secant_band):
        with pytest.raises(ValueError, match="level must lie between 0 and 1"):
            band(1000.0, level)


def test_deflections_have_the_shape_of_the_loads_and_the_points_end_somewhere():
    one = curve()
    assert one.deflection(INSIDE.reshape(3, 1)).shape == (3, 1)
    assert one.is_extrapolated([399.9, 400.0, 5000.0, 5000.1]).tolist() == [True, False, False, True]


def test_a_curve_says_its_contact_loop_and_status():
    loop = Hysteresis(0.0123, 0.001, 0.0456, 0.002, (500.0, 4500.0))
    text = str(curve((law(contact=True), law()), (0.6, 0.4), onset_load=812.0, onset_load_se=31.0, hysteresis=loop))
    assert "linear (60 %), ln scale = -19.34 (se 0), contact gap [m] = 3e-06" in text
    assert "tangent stiffness at 2500 N: 2.5e+08 N/m (95 %: 2." in text
    assert "holds from 400 to 5000 N; load +1.15 deg (se 0.06 deg) from the pad" in text
    assert "fully in contact from 812 N (se 31 N)" in text
    assert "loop from 500 to 4500 N: 0.0123 J (se 0.001), loss factor 0.0456 (se 0.002)" in text
    assert "status: bad-steps: 1 left out" in str(curve(status=(Condition("bad-steps", "1 left out"),)))
    assert str(curve()).startswith("pad 1 at -90 deg: linear (100 %)")
    assert "contact" not in str(curve())
    assert "status" not in str(curve())
    assert len(curve().steps) == 10


@pytest.mark.parametrize(
    ("largest", "step"),
    [(5000.0, 250.0), (3000.0, 200.0), (2010.0, 100.0), (9000.0, 500.0), (14_000.0, 1000.0), (800.0, 50.0)],
)
def test_tables_stand_at_round_loads(largest, step):
    grid = load_grid([curve(valid_to=0.5 * largest), curve(valid_to=largest)])
    np.testing.assert_allclose(np.diff(grid), step, rtol=1e-9)
    assert grid[0] == step
    assert 1.6 * largest - step < grid[-1] <= 1.6 * largest * (1 + 1e-9)


def test_the_printed_formula_stands_beside_what_was_measured():
    one = curve((law(errors=(0.0, 0.0, 0.02)),), onset_load=1000.0, valid_from=1000.0, pad=2)
    loads = np.array([500.0, 1000.0, 6000.0])
    frame = pivot_table([one], loads, lambda pad, load: (5e4 * pad * load, 3e5 * load))
    np.testing.assert_array_equal(frame["pad"], 2)
    np.testing.assert_array_equal(frame.force_N, loads)
    np.testing.assert_array_equal(frame.contact_complete, [False, True, True])
    np.testing.assert_array_equal(frame.extrapolated, [True, False, True])
    np.testing.assert_allclose(frame.deflection_m, SCALE * loads)
    for kind, printed in (("secant", 1e5 * loads), ("tangent", 3e5 * loads)):
        name = "secant" if kind == "secant" else "stiffness"
        lo, hi = (one.secant_band if kind == "secant" else one.stiffness_band)(loads)
        np.testing.assert_array_equal(frame[f"{name}_N_per_m_lo"], lo)
        np.testing.assert_array_equal(frame[f"{name}_N_per_m_hi"], hi)
        np.testing.assert_allclose(frame[f"{name}_N_per_m"], 1 / SCALE, rtol=1e-9)
        np.testing.assert_allclose(frame[f"formula_{kind}_N_per_m"], printed)
    assert not [name for name in pivot_table([one]).columns if name.startswith("formula")]


def test_tables_of_nothing_are_refused(tmp_path):
    target = tmp_path / "pivots.toml"
    target.write_text("old")
    with pytest.raises(ValueError, match="at least one"):
        write_pivots(target, [], "a")
    assert target.read_text() == "old"
    with pytest.raises(ValueError, match="at least one PivotCurve"):
        pivot_table([])
    for loads in ([0.0], [-1.0], [math.nan], [100.0, 0.0]):
        with pytest.raises(ValueError, match="loads must be positive"):
            pivot_table([curve()], np.array(loads))


def test_one_row_tells_all_of_a_pad():
    loop = Hysteresis(0.5, 0.05, 0.02, 0.004, (500.0, 4500.0))
    fits = (law(contact=True), law("hertz-point"), law())
    status = (Condition("misfit", "a"), Condition("samples-lost"))
    made = curve(fits, (0.5, 0.2, 0.3), hysteresis=loop, status=status, runs=("p-1", "p-2"), relative_calibration=0.004)
    row = pads_table([made]).iloc[0]
    assert row.law == "linear"
    assert (row.valid_from_N, row.valid_to_N) == (400.0, 5000.0)
    assert (row.loop_energy_J, row.loop_energy_J_se) == (0.5, 0.05)
    assert (row.loss_factor, row.loss_factor_se) == (0.02, 0.004)
    assert row.load_off_pad_deg_se == pytest.approx(math.degrees(0.001))
    assert row.displacement_off_pad_deg == pytest.approx(math.degrees(0.1))
    assert row.displacement_off_pad_deg_se == pytest.approx(math.degrees(0.01))
    plain = pads_table([curve(onset_load=1800.0)]).iloc[0]
    assert (plain.onset_N, plain.status, bool(plain.includes_housing)) == (1800.0, "ok", True)
    assert math.isnan(plain.loop_energy_J)
    assert plain.load_off_pad_deg == pytest.approx(math.degrees(0.02))
    assert (row.runs, row.status, row.relative_calibration) == ("p-1, p-2", "misfit: a; samples-lost", 0.004)


@pytest.mark.parametrize("source", ['campaign "A"\n', 'a "b" \\ c', "tab\t and \x7f", "µ 日本"])
def test_toml_carries_the_tangent_and_any_name(tmp_path, source):
    one = curve((ROCKER,))
    path = write_pivots(tmp_path / "pivots.toml", [curve((ROCKER,), pad=2), one], source)
    found = tomllib.loads(path.read_text())
    assert found["schema"] == "tpjb-pivots/1"
    assert found["source"] == source
    assert found["includes_housing"] is True
    assert [p["pad"] for p in found["pads"]] == [1, 2]
    pad = found["pads"][0]
    assert (pad["valid_from_N"], pad["valid_to_N"]) == (400.0, 5000.0)
    assert pad["force_N"][0] == pad["deflection_m"][0] == 0.0
    assert pad["force_N"][-1] >= 10_000.0
    law = PchipInterpolator(pad["force_N"], pad["deflection_m"])
    loads = np.linspace(200.0, 10_000.0, 997)
    assert law(loads) == pytest.approx(one.deflection(loads), rel=1e-5)
    assert 1.0 / law.derivative()(loads) == pytest.approx(one.stiffness(loads), rel=1e-3)
    assert list(tmp_path.iterdir()) == [path]


def test_the_toml_reaches_from_next_to_nothing_to_far_beyond():
    loads = table_loads(curve())
    assert loads[0] == 0.0
    assert loads[1] == pytest.approx(2.5)
    assert 50_000.0 < loads[-1] < 75_000.0
    np.testing.assert_allclose(loads[2:] / loads[1:-1], loads[2] / loads[1], rtol=1e-12)
    pad = tomllib.loads(pivots_text([curve()], "x"))["pads"][0]
    lengths = {len(pad[name]) for name in ("force_N", "deflection_m", "stiffness_N_per_m", "stiffness_relative_se")}
    assert lengths == {len(loads)}
    assert all(type(v) is float for name in ("force_N", "stiffness_N_per_m") for v in pad[name])
    assert pad["stiffness_relative_se"][0] == 0.0
    assert pad["stiffness_N_per_m"][0] == pad["stiffness_N_per_m"][1] == pytest.approx(2.5e8)


def test_the_loop_of_a_straight_law_is_what_friction_takes_up_and_gives_back_down():
    """2 mu s F between the branches, whatever zero reading and way into contact both share."""
    for contact in (False, True):
        loop = measure_loop(law(contact=contact, friction=0.02, errors=(1e-6, 0.003, 0.0)), 200.0, 1000.0)
        assert loop.load_range == (200.0, 1000.0)
        assert loop.energy == pytest.approx(0.02 * SCALE * (1000.0**2 - 200.0**2), rel=1e-9)
        assert loop.energy_se == pytest.approx(0.003 * SCALE * (1000.0**2 - 200.0**2), rel=1e-9)
        assert loop.loss_factor_se / loop.energy_se == pytest.approx(loop.loss_factor / loop.energy)
        assert "loop from 200 to 1000 N" in str(loop)
    straight = measure_loop(law(friction=0.02), 200.0, 1000.0)
    stored = math.pi / 4 * 800.0 * 0.98 * SCALE * 800.0
    assert straight.loss_factor == pytest.approx(straight.energy / stored)
    assert straight.energy_se == 0.0


@pytest.mark.parametrize(
    ("load", "branch"),
    [
        ([0.0, 1000.0, 500.0], [1, 1, -1]),
        ([500.0, 1000.0, 0.0], [1, -1, -1]),
        ([0.0, 500.0, 900.0, 600.0], [1, 1, -1, -1]),
        ([0.0, 500.0, 900.0, 500.0], [1, 1, -1, -1]),
    ],
)
def test_no_loop_without_two_branches_over_common_loads(load, branch):
    loads, nothing = np.array(load), np.zeros(len(load))
    steps = PivotSteps(loads, SCALE * loads, nothing, nothing, nothing, np.array(branch), np.ones(len(load)))
    assert _loop(steps, law()) is None
