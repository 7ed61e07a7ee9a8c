"""What goes with an answer, and what is handed from step to step: intervals, refusals, speeds, points, instruments."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.phasors import phasor_cases
from tests.phasors.phasor_cases import H, complex_normal
from tests.phasors.phasor_cases import place as at
from tests.seeds import first_quick
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.window_means import aligned
from tpjb_ident.estimators.estimate import (
    METHODS,
    estimate_dynamic_stiffness,
    estimate_table,
    instrumental_fit,
    solved_windows,
)
from tpjb_ident.estimators.r_matrix import phasor_table, real_rows
from tpjb_ident.phasors.frequency import FIRST_LOOK, MAX_DEPARTURE, shaft_speed
from tpjb_ident.runs.point_data import finite_mean, gather, point_data, point_of

OMEGA = 160.0


def windows(seed, g=6, n=12, noise=0.02, coincident=()):
    """Displacements [m] and forces [N], H of order one; directions in `coincident` lie elsewhere."""
    rng = np.random.default_rng(seed)
    D = np.repeat(complex_normal(rng, g, 2), n, axis=0)
    label = np.repeat(np.arange(g), n)
    F = D @ H.T + noise * complex_normal(rng, g * n, 2) + 5.0 * np.isin(label, coincident)[:, None]
    return D + noise * complex_normal(rng, g * n, 2), F, label


@pytest.mark.parametrize(("method", "efficiency"), first_quick(("mm", 0.95), ("ols", 1.0), ("iv", 1 / 1.5)))
def test_the_interval_allows_for_the_methods_efficiency(method, efficiency):
    """The scatter of the solve, over the efficiency of the robust ones."""
    D, F, label = windows(1)
    reference = np.repeat(complex_normal(np.random.default_rng(1), 6, 2), 12, axis=0)  # D without its noise
    est = estimate_dynamic_stiffness(D, F, OMEGA, label, method, reference=reference if method == "iv" else None)
    table = phasor_table(D, F, label, reference if method == "iv" else None)
    if method == "iv":
        table = instrumental_fit(table)[1]
    solved = solved_windows(table, est.h / table.h_scale, est.weights[:, 0])
    np.testing.assert_allclose(est.covariance, solved.covariance * table.h_scale**2 / efficiency, rtol=1e-9)
    np.testing.assert_allclose(est.dof, solved.dof)
    assert est.chi_square == pytest.approx(solved.chi_square)
    assert est.spare_equations == 16


@pytest.mark.parametrize(("method", "n"), [("ols", 12), ("mm", 5), ("mm-eiv", 5)])
def test_without_repeats_the_residuals_tell_the_noise(method, n):
    """s^2 (R^T R)^-1 for each force, of real and imaginary parts; few windows are plain least squares."""
    D, F, _ = windows(3, g=n, n=1)
    est = estimate_dynamic_stiffness(D, F, OMEGA, method=method)
    plain = np.linalg.lstsq(D, F, rcond=None)[0]
    np.testing.assert_allclose(est.h, plain.T, rtol=1e-9)
    residual = F - D @ plain
    np.testing.assert_array_equal(est.dof, 2 * (n - 2))
    for axis in range(2):
        design, _ = real_rows(D, F[:, axis])
        s2 = (np.abs(residual[:, axis]) ** 2).sum() / (2 * (n - 2))
        expected = s2 * np.linalg.inv(design.T @ design)
        rows = np.array([2 * axis, 2 * axis + 1, 4 + 2 * axis, 5 + 2 * axis])
        block = est.covariance[np.ix_(rows, rows)]
        np.testing.assert_allclose(block, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    assert np.isnan(est.chi_square)


def test_directions_that_were_rejected_are_no_spare_equations():
    D, F, label = windows(4, g=8, coincident=(2,))
    est = estimate_dynamic_stiffness(D, F, OMEGA, label)
    assert (est.weights[24:36] == 0.0).all()
    assert est.spare_equations == 4 * (7 - 2)
    np.testing.assert_allclose(est.h, H, atol=0.05)
    D, F, label = windows(4, g=5)
    assert estimate_dynamic_stiffness(D, F, OMEGA, label).spare_equations == 12


@pytest.mark.parametrize("method", METHODS)
def test_answers_without_an_interval_have_the_shape_of_one(method):
    D, F, label = windows(5, g=2, n=1, noise=0.0)
    two = estimate_table(phasor_table(D, F, label, D), OMEGA, method)
    none = estimate_table(phasor_table(D[:1], F[:1], label[:1], D[:1]), OMEGA, method)
    for est in (two, none):
        assert est.covariance.shape == (8, 8)
        assert est.dof.shape == (8,)
        assert np.isnan(est.covariance).all()
        assert np.isnan(est.dof).all()
        assert est.half_width().shape == (8,)
    np.testing.assert_allclose(two.h, H, rtol=1e-9)
    assert "no-residual" in two.status
    np.testing.assert_array_equal(two.weights, np.ones((2, 2)))
    np.testing.assert_array_equal(none.weights, np.zeros((1, 2)))


def test_two_directions_are_used_with_a_word_of_warning():
    D, F, label = windows(5, g=2, noise=2e-3)
    est = estimate_dynamic_stiffness(D, F, OMEGA, label)
    assert "no-spare-direction" in est.status
    np.testing.assert_allclose(est.h, H, atol=0.02)


def test_instruments_that_are_missing_are_named():
    table = phasor_table(*windows(6))
    found = estimate_table(table, OMEGA, "iv")
    assert found.status == ("no-reference",)
    assert np.isnan(found.h).all()
    with pytest.raises(ValueError, match="needs reference phasors"):
        instrumental_fit(table)


def test_a_share_of_two_fifths_may_be_rejected():
    """Below a weight of 0.3 a window counts as rejected; two of five is the limit."""
    for bad, named in ((24, False), (25, True)):
        D, F, label = windows(7, g=6, n=10, noise=1e-3)
        F[np.random.default_rng(1).permutation(60)[:bad]] += 40.0 * complex_normal(np.random.default_rng(2), bad, 2)
        est = estimate_dynamic_stiffness(D, F, OMEGA, label, "mm")
        assert int((est.weights[:, 0] < 0.3).sum()) == bad
        assert ("many-windows-rejected" in est.status) is named
        if named:
            (told,) = [c for c in est.status if c == "many-windows-rejected"]
            assert "42 %" in told.detail


@pytest.mark.parametrize(("ratio", "named"), [(29.0, False), (31.0, True)])
def test_displacements_along_nearly_one_line_are_named(ratio, named):
    angle = np.arange(8) * np.pi / 4
    D = np.stack([np.cos(angle), np.sin(angle) / ratio], axis=1) + 0j
    est = estimate_dynamic_stiffness(D, D @ H.T, OMEGA, method="ols")
    assert est.condition == pytest.approx(ratio)
    assert ("ill-conditioned" in est.status) is named


@pytest.mark.parametrize("method", ["mm", "mm-eiv", "iv"])
@pytest.mark.parametrize("noise", [1e-3, 0.1])
def test_computed_windows_whose_motion_varies_are_taken(method, noise):
    """F = H D to the last digit, and a drive that neither follows exactly: the noise of (D, F) is singular."""
    rng = np.random.default_rng(4)
    drive = np.repeat(complex_normal(rng, 5, 2), 6, axis=0)
    D = drive + noise * complex_normal(rng, 30, 2)
    reference = drive if method == "iv" else None
    est = estimate_dynamic_stiffness(D, D @ H.T, OMEGA, np.repeat(np.arange(5), 6), method, reference=reference)
    np.testing.assert_allclose(est.h, H, rtol=1e-7)
    assert np.isfinite(est.covariance).all()
    assert est.standard_error.max() < 1e-3 * noise


def test_what_does_not_fit_together_is_refused_and_what_is_missing_left_out():
    D, F, label = windows(9, g=3, n=4)
    with pytest.raises(ValueError, match="one label per window: 12 windows, 11 labels"):
        phasor_table(D, F, label[:-1])
    with pytest.raises(ValueError, match=r"reference must be \(12, 2\) like D, got \(11, 2\)"):
        phasor_table(D, F, label, D[:-1])
    for wrong in (F[:-1], F[:, :1], F[0]):
        with pytest.raises(ValueError, match=r"D and F must both be \(n, 2\)"):
            phasor_table(D, wrong)
    reference = D.copy()
    D[0, 0], F[5, 1], reference[11, 1] = np.nan, np.inf, np.nan
    table = phasor_table(D, F, label, reference)
    np.testing.assert_array_equal(np.flatnonzero(~table.valid), [0, 5, 11])
    assert (len(table), table.n_directions) == (9, 3)
    for given, found, scale in ((D, table.D, table.d_scale), (F, table.F, table.f_scale)):
        np.testing.assert_allclose(found * scale, given[table.valid])
        assert np.median(np.linalg.norm(found, axis=1)) == pytest.approx(1.0)
    assert table.h_scale == table.f_scale / table.d_scale
    # every window a direction of its own; nothing at all, and nothing but zeros
    assert phasor_table(D[1:5], F[1:5]).n_directions == 4
    empty = phasor_table(D[:0], F[:0])
    assert (len(empty), empty.n_directions, empty.h_scale) == (0, 0, 1.0)
    assert phasor_table(0 * D[1:5], F[1:5]).d_scale == 1.0


def test_a_wandering_direction_is_turned_and_the_others_kept():
    """Phases of chance in the last direction: its windows come to one phase, whatever struck ones say."""
    rng = np.random.default_rng(10)
    pattern = complex_normal(rng, 3, 4)
    label = np.repeat(np.arange(3), 8)
    turn = np.where(label == 2, np.exp(2j * np.pi * rng.random(24)), 1.0)
    z = pattern[label] * turn[:, None]
    z[16] = 50.0
    weights = np.where(np.arange(24) == 16, 0.0, 1.0)
    found, wandering = aligned(z, label, weights)
    assert wandering == 1
    np.testing.assert_array_equal(found[:16], z[:16])
    np.testing.assert_allclose(found[17:], np.tile(found[17], (7, 1)), atol=1e-12)
    assert abs(np.vdot(found[17], pattern[2])) == pytest.approx(np.linalg.norm(pattern[2]) ** 2)
    assert z[17, 0] == pattern[2, 0] * turn[17]
    # three windows tell a phase, two do not
    few = np.where((label == 2) & (np.arange(24) > 19), 0.0, weights)
    assert aligned(z, label, few)[1] == 1
    few[17] = 0.0
    same, none = aligned(z, label, few)
    assert none == 0
    assert same is z


NORMAL = 1.959963984540054  # of 95 %


def stiff(h=H, **more):
    return phasor_cases.stiff(h, 50.0, np.diag(np.arange(1.0, 9.0) ** 2), **more)


def test_a_stiffness_says_its_parts_and_their_errors():
    est = stiff()
    np.testing.assert_array_equal(est.k, H.real)
    np.testing.assert_array_equal(est.c, H.imag / 50.0)
    np.testing.assert_array_equal(est.vector, [*H.real.ravel(), *H.imag.ravel()])
    np.testing.assert_array_equal(est.standard_error, np.arange(1, 9))
    assert est.direct == (1.75, 0.8)
    assert stiff(np.diag([-2.0 + 1j, 4.0 - 3j])).direct == (3.0, 2.0)
    text = str(est)
    assert text.startswith("dynamic stiffness at 7.958 Hz, mm\n  kxx  2.0000e+00 +- 2.0e+00 N/m    cxx  1.4000e-02")
    assert "kyy  1.5000e+00 +- 7.8e+00 N/m    cyy  1.8000e-02 +- 3.1e-01 N s/m" in text
    assert str(stiff(status=(Condition("misfit", "why"),))).endswith("\n  misfit: why")


def test_an_interval_is_students_with_what_is_systematic_added_as_squares():
    np.testing.assert_allclose(stiff().half_width(), NORMAL * np.arange(1, 9))
    # Student's t with one degree of freedom: tan of 0.475 pi
    np.testing.assert_allclose(stiff(dof=1.0).half_width(), math.tan(0.475 * math.pi) * np.arange(1, 9), rtol=1e-9)
    both = stiff(systematic=np.diag(np.full(8, 9.0)))
    np.testing.assert_allclose(both.half_width(), NORMAL * np.hypot(np.arange(1, 9), 3.0))
    np.testing.assert_allclose(both.half_width(systematic=False), NORMAL * np.arange(1, 9))
    np.testing.assert_allclose(both.interval().hi - both.vector, both.half_width())
    np.testing.assert_allclose(both.vector - both.interval().lo, both.half_width())
    np.testing.assert_allclose(both.interval(0.5, False).hi - both.vector, 0.6744897501960817 * np.arange(1, 9))
    for level in (0.0, 1.0, -0.1, np.nan):
        with pytest.raises(ValueError, match="level must lie in"):
            both.half_width(level)


def tachometer(values, nominal=20.0):
    asked = []

    def speed(start, stop):
        asked.append((start, stop))
        return None if values is None else SimpleNamespace(values=2 * math.pi * np.asarray(values))

    return SimpleNamespace(point=OperatingPoint(5e3, 0.0, 2 * math.pi * nominal), speed=speed, asked=asked)


def test_a_shaft_turns_as_its_tachometer_says_unless_that_cannot_be():
    run = tachometer([20.1, 20.3, np.nan])
    assert shaft_speed(run) == (pytest.approx(20.2), ())
    assert run.asked == [(0, FIRST_LOOK)]
    assert shaft_speed(tachometer(None)) == (20.0, ())
    for off, believed in ((0.99, True), (1.01, False), (-1.01, False)):
        measured, said = shaft_speed(tachometer([20.0 * (1 + off * MAX_DEPARTURE)]))
        assert measured == pytest.approx(20.0 * (1 + off * MAX_DEPARTURE) if believed else 20.0)
        assert said == (() if believed else ("tach off set point",))
    assert "tachometer says 19 Hz, set point 20 Hz" in shaft_speed(tachometer([18.999]))[1][0].detail
    assert shaft_speed(tachometer([np.nan]))[1] == ("tach off set point",)
    # of a shaft at rest a twentieth of a hertz is as good as nothing
    assert shaft_speed(tachometer([0.04], 0.0)) == (0.0, ())
    assert shaft_speed(tachometer([0.06], 0.0))[0] == 0.0


def test_runs_are_grouped_by_their_set_points_in_order():
    lines = [
        (at(6e3), (25.0,)),
        (at(), (25.3,)),
        (at(), (24.6, 40.0004)),
        (at(6e3), (25.1,)),
        (at(speed=20.0), (25.0,)),
    ]
    still, runs = np.zeros((1, 2, 2)), []
    for k, (point, driven) in enumerate(lines):
        found = SimpleNamespace(driven=driven)
        runs.append(SimpleNamespace(run=k, point=point, lines=found, displacement=still, force=still))
    points = gather(runs)
    assert [(p.point.static_load, p.point.shaft_speed_hz, p.point.excitation_hz) for p in points] == [
        (5e3, 20.0, 25.0), (5e3, 22.0, 25.0), (5e3, 22.0, 40.0), (6e3, 22.0, 25.0),
    ]  # fmt: skip
    assert [p.names for p in points] == [(4,), (1, 2), (2,), (0, 3)]
    assert [p.lines for p in points] == [(0,), (0, 0), (1,), (0, 0)]
    # a drive that missed its set point is found by every run for itself
    missed = [(at(), (24.299,)), (at(), (24.3,)), (at(), (24.301,)), (at(), (24.4,)), (at(6e3), (24.3,))]
    for k, (run, (point, driven)) in enumerate(zip(runs, missed, strict=True)):
        run.run, run.point, run.lines = k, point, SimpleNamespace(driven=driven)
    assert [p.names for p in gather(runs)] == [(0, 1, 2), (3,), (4,)]
    # within a fiftieth a line is that of the set point; beyond, one of its own, to the millihertz
    for frequency, own in ((25.49, 25.0), (25.51, 25.51), (24.51, 25.0), (24.48915, 24.489)):
        assert point_of(at(), frequency).excitation_hz == pytest.approx(own, abs=1e-9)


def test_windows_of_a_point_follow_their_runs():
    rng = np.random.default_rng(1)

    def run(name, n):
        blocks = [complex_normal(rng, n, 2, 2) for _ in range(2)]
        means = {quantity: rng.standard_normal((n, 2)) for quantity in ("displacement", "force")}
        return SimpleNamespace(
            run=name, lines=SimpleNamespace(driven=(25.0, 25.0)),
            displacement=blocks[0], force=blocks[1], means=means.get,
        )  # fmt: skip

    a, b = run("a", 3), run("b", 2)
    data = point_data(at(), [(a, 1), (b, 0)])
    np.testing.assert_array_equal(data.D, np.concatenate([a.displacement[:, 1], b.displacement[:, 0]]))
    np.testing.assert_array_equal(data.F, np.concatenate([a.force[:, 1], b.force[:, 0]]))
    np.testing.assert_array_equal(data.run_index, [0, 0, 0, 1, 1])
    assert data.lines == (1, 0)
    assert data.omega == at().excitation
    a.means("displacement")[1, 0] = np.nan
    np.testing.assert_allclose(data.mean_positions[0], a.means("displacement")[[0, 2]].mean(axis=0))
    np.testing.assert_allclose(data.mean_loads, [r.means("force").mean(axis=0) @ [1, 1j] for r in (a, b)])
    assert np.isnan(finite_mean(np.full((2, 2), np.nan))).tolist() == [True, True]


def test_what_instruments_leave_of_the_force_is_orthogonal_to_them():
    """Weighted sums of the references with F - H D vanish; the explained windows leave the same."""
    rng = np.random.default_rng(2)
    drive = np.repeat(complex_normal(rng, 6, 2), 10, axis=0)
    D = drive @ complex_normal(rng, 2, 2) + 0.3 * complex_normal(rng, 60, 2)
    F = D @ H.T + 0.2 * complex_normal(rng, 60, 2)
    F[:6] += 20.0
    table = phasor_table(D, F, np.repeat(np.arange(6), 10), drive)
    fit, explained = instrumental_fit(table)
    left = table.F - table.D @ fit.h.T
    np.testing.assert_allclose(table.reference.conj().T @ (fit.weights[:, None] * left), 0.0, atol=1e-8)
    assert np.abs(table.D.conj().T @ (fit.weights[:, None] * left)).max() > 0.01
    np.testing.assert_allclose(explained.F - explained.D @ fit.h.T, left, atol=1e-12)
    moved = table.D - explained.D
    np.testing.assert_allclose(table.reference.conj().T @ (fit.weights[:, None] * moved), 0.0, atol=1e-8)
    assert np.linalg.matrix_rank(np.concatenate([explained.D, table.reference], axis=1), tol=1e-9) == 2
    assert (fit.weights[:6] == 0.0).all()
    assert explained.reference is table.reference
