"""What is handed from step to step, by hand: stiffness with its intervals, speeds, points of runs, instruments."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.phasors import phasor_cases
from tests.phasors.phasor_cases import H, complex_normal
from tests.phasors.phasor_cases import place as at
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.estimate import instrumental_fit
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.phasors.frequency import FIRST_LOOK, MAX_DEPARTURE, shaft_speed
from tpjb_ident.runs.point_data import finite_mean, gather, point_data, point_of

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
    assert shaft_speed(tachometer([0.04], 0.0)) == (pytest.approx(0.04), ())
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
