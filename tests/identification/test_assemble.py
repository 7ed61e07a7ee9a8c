"""From the phasors of all runs to a campaign's coefficients: a campaign made by hand, whole and with lost channels."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from tests.phasors.phasor_cases import OMEGA, WINDOWS, run_phasors
from tpjb_ident.estimators.estimate import REJECTED_WEIGHT
from tpjb_ident.identification.identify import assemble
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.runs.point_data import ExcludedRun, FinishedRuns, digest

LOADS = (3000.0, 8000.0)
CHANNELS = [
    Channel("X1", "displacement", axis=math.radians(45.0), uncertainty=0.01),
    Channel("X2", "displacement", axis=math.radians(135.0), uncertainty=0.01),
    Channel("LH", "force", axis=0.0, uncertainty=0.005),
    Channel("LV", "force", axis=math.pi / 2, uncertainty=0.005),
]

#: Change of the cross-coupled coefficients per radian, relative to the direct ones.
SK, SC = -0.9, -0.3


def law(load: float, turn: float):
    k, c = 2.0e8 * (load / 5e3) ** 0.7, 8.0e7
    return np.array(
        [[0.85 * k + 1j * c, turn * (SK * k + 1j * SC * c)], [turn * (SK * k + 1j * SC * c), 1.15 * k + 1j * c]]
    )


def run_at(name, direction, load, turn, rng, noise):
    """A run whose load points `turn` [rad] aside."""
    spread = rng.standard_normal((WINDOWS, 4)) + 1j * rng.standard_normal((WINDOWS, 4))
    phase = np.exp(2j * np.pi * rng.random())
    F = 500.0 * phase * np.array([np.cos(direction), np.sin(direction)]) + noise * spread[:, :2]
    D = np.linalg.solve(law(load, turn), F.T).T + 1e-9 * noise * spread[:, 2:]
    return run_phasors(name, direction, load, D, F, load * np.array([np.sin(turn), -np.cos(turn)]), CHANNELS)


def five_directions(miss):
    """Five directions at either load; their loads miss their direction by this much, one standard deviation [rad]."""
    rng, made = np.random.default_rng(1), []
    for load, k in itertools.product(LOADS, range(5)):
        made.append(run_at(f"{load:g}-{k}", k * math.pi / 5, load, miss * rng.standard_normal(), rng, noise=0.1))
    return made


@pytest.fixture(scope="module")
def runs():
    return five_directions(0.003)


def found(runs, left_out=(), channels=CHANNELS, progress=None, **settings):
    named = {c.name: c for c in channels}
    campaign = SimpleNamespace(
        id="c", channels=named, of_kind=lambda kind: [], housing_mass=3.0, mass_uncertainty=0.0, mount=None
    )
    chosen = IdentifySettings(**{"methods": ("ols",)} | settings)
    warm = (replace(run, temperatures={1: 300.0 + k * k / 100, 2: 310.0}) for k, run in enumerate(runs))
    finished = FinishedRuns((*map(digest, warm), *left_out))
    return assemble(campaign, finished, chosen, progress or (lambda text, done, total: None))


@pytest.fixture(scope="module")
def result(runs):
    return found(runs)


def test_every_point_has_its_coefficients_and_all_their_errors(result):
    assert [p.point.static_load for p in result.points] == list(LOADS)
    for p in result.points:
        true = law(p.point.static_load, 0.0)
        np.testing.assert_allclose(p.stiffness.h, true, atol=2e-3 * np.abs(true).max())
        assert list(p.by_method) == ["ols", "mm-eiv"]
        assert p.quality == ("inertia-not-corrected",)
        assert p.stiffness is p.by_method["mm-eiv"]
        assert p.load_miss.real.shape == (5,)
        assert p.temperatures[2] == 310.0
        assert p.stiffness.weights.shape == (5 * WINDOWS, 2)
        for est in p.by_method.values():  # how runs and windows scatter is no matter of the method
            np.testing.assert_array_equal(est.systematic, p.stiffness.systematic)
            np.testing.assert_array_equal(est.covariance, p.stiffness.covariance)
    assert [p.temperatures[1] for p in result.points] == pytest.approx([300.06, 300.51])
    assert (result.campaign, result.method, result.conditions) == ("c", "mm-eiv", ())


def test_the_systematic_part_is_that_of_the_gains_and_common_to_all_points(result):
    """One per cent of either probe at 45 degrees, half a per cent of a cell: sqrt(0.5 + 0.25) per cent of kyy."""
    joint = result.systematic
    assert joint.shape == (16, 16)
    for k, p in enumerate(result.points):
        part = joint[8 * k : 8 * k + 8, 8 * k : 8 * k + 8]
        np.testing.assert_allclose(p.stiffness.systematic, part, atol=1e-3 * np.abs(part).max())
        share = math.sqrt(part[3, 3]) / p.stiffness.k[1, 1]
        assert share == pytest.approx(math.sqrt(0.75) / 100, rel=0.15)
    assert joint[3, 11] / math.sqrt(joint[3, 3] * joint[11, 11]) > 0.99


def test_weights_may_be_kept_as_verdicts(runs, result):
    few = found(runs, keep_weights=False)
    for a, b in zip(few.points, result.points, strict=True):
        verdict = a.stiffness.weights
        assert verdict.dtype == bool
        np.testing.assert_array_equal(verdict[:, 0], b.stiffness.weights.min(axis=1) >= REJECTED_WEIGHT)
        np.testing.assert_array_equal(a.stiffness.h, b.stiffness.h)


def test_without_corrections_the_misses_are_told_and_nothing_is_taken_off(runs, result):
    plain = found(runs, correct=False)
    for a, b in zip(plain.points, result.points, strict=True):
        np.testing.assert_array_equal(a.load_miss.real, b.load_miss.real)
        true = law(a.point.static_load, 0.0)
        off = [np.abs(p.stiffness.h - true)[[0, 1], [1, 0]].max() for p in (a, b)]
        assert off[1] < 0.5 * off[0]


def test_progress_and_what_is_missing_are_told(runs):
    said = []
    lost = ExcludedRun("gone", OperatingPoint(5e3, -math.pi / 2, 138.0, OMEGA), ValueError("torn\nand more"))
    bare = [*CHANNELS[:3], Channel("LV", "force", axis=math.pi / 2)]
    made = found(runs[:5], (lost,), bare, lambda *one: said.append(one))
    assert said == [("estimating", 0, 1), ("estimating", 1, 1)]
    assert made.conditions == ("calibration-uncertainty-unstated", "runs-left-out", "point-lost")
    assert "for LV:" in made.conditions[0].detail
    assert "1 of 6 dynamic runs take no part: gone (torn)" in made.conditions[1].detail


@pytest.mark.parametrize("method", ["iv", "mm", "rlm:tukey"])
def test_whatever_the_method_loads_are_brought_to_their_set_points(runs, result, method):
    made = found(runs, method=method, methods=("mm-eiv",))
    assert made.method == method
    for p, other in zip(made.points, result.points, strict=True):
        assert list(p.by_method) == ["mm-eiv", method]
        assert p.stiffness.method == method
        true = law(p.point.static_load, 0.0)
        np.testing.assert_allclose(p.stiffness.h, true, atol=2e-3 * np.abs(true).max())
        assert p.load_miss.real.tolist() == other.load_miss.real.tolist()


def test_windows_that_are_rejected_in_one_direction_are_pointed_out(runs):
    spoilt = runs[2].z.copy()
    spoilt[:3, :, 2:] += 300.0 * np.exp(2j * np.arange(3))[:, None, None]
    odd = replace(runs[2], z=spoilt)
    (p,) = found([*runs[:2], odd, *runs[3:5]]).points
    (told,) = [c for c in p.quality if c == "directional-rejection"]
    assert "gather in 3000-2 at 72 deg (" in told.detail
    assert {w.run for w in p.rejected} == {"3000-2"}
    assert p.outlier_fraction == len(p.rejected) / 30


def test_a_single_run_has_no_coefficients_and_no_error_of_its_place(runs):
    (p,) = found(runs[:1]).points
    assert np.isnan(p.stiffness.h).all()
    assert np.isnan(p.position_se).all()
    assert "fewer-than-two-directions" in p.quality
    assert p.n_records == 1


def test_a_point_gathers_what_its_runs_say(runs):
    moved = []
    for k, run in enumerate(runs[:5]):
        mean = run.mean.copy()
        mean[:, :2] = k * 1e-6 * np.array([-1.0, -3.0]) / math.sqrt(2)
        moved.append(replace(run, mean=mean))
    (p,) = found(moved, methods=("ols", "mm", "iv"), clearance=1e-3).points
    assert list(p.by_method) == ["ols", "mm", "iv", "mm-eiv"]
    assert all(est.method == name for name, est in p.by_method.items())
    np.testing.assert_allclose(p.position, [2e-6, -4e-6])
    spread = np.std([0, 1, 2, 3, 4], ddof=1) / math.sqrt(5)
    np.testing.assert_allclose(p.position_se, 1e-6 * spread * np.array([1, 2]))
    assert (p.n_records, p.n_windows) == (5, 5 * WINDOWS)
    assert p.runs == tuple(run.run for run in moved)
    assert p.static_load_measured == pytest.approx(LOADS[0], rel=0.01)
    assert p.coherence > 0.999
    largest = max(np.linalg.svd(np.stack([z.real, z.imag]))[1][0] for z in (m.displacement[0, 0] for m in moved))
    assert p.amplitude == pytest.approx(largest, rel=1e-2)
    assert p.outlier_fraction == len(p.rejected) / (5 * WINDOWS)
    assert not p.inertia_corrected
    assert p.clearance == 1e-3


@pytest.mark.parametrize("lost", [range(10), range(5, 10), range(1)], ids=["all", "those of a point", "one"])
def test_runs_without_cells_cost_themselves_only(lost):
    runs, cells = five_directions(0.0), np.arange(4) > 1
    for k in lost:
        runs[k] = replace(runs[k], z=np.where(cells, np.nan, runs[k].z))
    made = found(runs)
    for k, point in enumerate(made.points):
        gone = len(set(lost) & set(range(5 * k, 5 * k + 5)))
        assert ("run-without-data" in point.quality) is (gone > 0)
        if gone == 5:
            assert np.isnan(point.stiffness.h).all()
            assert "fewer-than-two-directions" in point.quality
            continue
        true = law(LOADS[k], 0.0)
        np.testing.assert_allclose(point.stiffness.h, true, atol=1e-4 * np.abs(true).max())
        assert gone or point.quality == ("inertia-not-corrected",)
