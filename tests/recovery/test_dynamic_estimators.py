"""Recovery of a known H: by every estimator (accuracy, bias, coverage in the study's situation), from whole campaigns.

With fixed seeds; a table of every method in every case is in `tests/studies/RESULTS.md`, the sample campaigns are in
`test_golden.py`. Fewer replicates than its 400 leave a Monte-Carlo error of 1/sqrt(2 n) on an RMSE.
"""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import RigPlan, RigTruth, VirtualRig, operating_points, write_campaign
from tests.rigs.closed_form import vector
from tests.rigs.estimator_cases import H_TRUE, OMEGA, TRUE, Case, draw, score
from tpjb_ident.estimators.estimate import estimate_dynamic_stiffness
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.terms.mains import MainsEquations

SEED = 61


#: Not one replicate of any breaks down. Of the second of many replicates an RMSE of 1.0 without a scatter of the runs,
#: which is asked for here and costs 1.5 % of efficiency.
CASES = [
    (Case("forcesys", 0.4), 20, 1.1, 2.5, np.inf, (88, 100)),
    (Case("force", 0.3), 20, 1.0, 2.5, np.inf, (88, 100)),
    (Case("forcesys", 0.3), 20, 1.0, 2.5, np.inf, (88, 100)),
    (Case("lev", 0.4), 20, 1.1, 2.5, np.inf, (88, 100)),
    (Case("gain", 0.2), 20, 1.1, 2.5, np.inf, (88, 100)),
    (Case(), 60, 1.0, 0.77, 0.3, (92, 99)),
    (Case("lev", 0.3), 60, 1.02, 0.77, 0.3, (92, 99)),
    (Case(relx=0.2), 60, 3.5, 0.77, 0.6, (92, 99)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "n", "rmse", "deviations", "bias", "coverage"),
    CASES,
    ids=lambda value: value.name if isinstance(value, Case) else str(value),
)
def test_default_method_keeps_its_targets_of_error_bias_and_coverage(case, n, rmse, deviations, bias, coverage):
    result = score(case, "mm-eiv", n, SEED)
    assert result.rmse <= rmse * (1 + deviations / np.sqrt(2 * n))
    assert result.worst < 4 * rmse
    assert np.abs(result.bias).max() <= bias
    assert coverage[0] <= result.coverage <= coverage[1]


@pytest.mark.slow
@pytest.mark.parametrize("directions", [3, 4, 5, 8])
def test_intervals_hold_with_one_window_per_direction(directions: int):
    result = score(Case(directions=directions, windows=1), "mm-eiv", 150, SEED)
    assert 89.5 <= result.coverage <= 98.5  # target 92-98; 150 replicates of 8 correlated entries leave 1 %


@pytest.mark.slow
def test_rlm_fails_where_the_paper_used_it():
    """The figure to beat: a tenth of the windows with probe glitches ruin every M-estimator on stacked rows."""
    case = Case("lev", 0.1)
    assert score(case, "rlm:huber", 4, SEED).rmse > 40
    assert score(case, "mm-eiv", 4, SEED).rmse < 1.5
    assert score(case, "iv", 4, SEED).rmse < 1.5


@pytest.mark.slow
def test_noise_on_the_displacements_biases_regressions_but_not_the_default():
    case = Case(relx=0.2)
    assert score(case, "ols", 20, SEED).bias[1] < -8
    assert score(case, "mm", 12, SEED).bias[1] < -8
    assert abs(score(case, "mm-eiv", 12, SEED).bias[1]) < 2
    assert abs(score(case, "iv", 12, SEED).bias[1]) < 2
    sample = draw(case, SEED, 0)
    est = estimate_dynamic_stiffness(sample.D, sample.F, OMEGA, sample.direction)
    # single windows: the weaker direction (y) has a noise share of about 12 %
    assert est.attenuation[0] == pytest.approx(0.12, abs=0.03)


def test_a_wandering_drive_phase_is_noticed_and_does_no_harm():
    case = Case()
    locked = draw(case, SEED, 1)
    turn = np.exp(2j * np.pi * np.random.default_rng(0).random(len(locked.D)))[:, None]
    est = estimate_dynamic_stiffness(locked.D * turn, locked.F * turn, OMEGA, locked.direction)
    assert "drive-not-locked" in est.status
    reference = estimate_dynamic_stiffness(locked.D, locked.F, OMEGA, locked.direction)
    assert "drive-not-locked" not in reference.status
    assert np.linalg.norm(est.h - H_TRUE) < 0.02 * np.linalg.norm(H_TRUE)


def _runs_that_differ(seed: int, directions: int = 6, windows: int = 6):
    """Repeats far better than the runs agree: K of every run is off by a little of its own, C is not."""
    rng = np.random.default_rng([seed, directions])
    angle = np.arange(directions) * np.pi / directions
    phase = np.exp(2j * np.pi * rng.random(directions))[:, None]
    direct, cross = np.diag([1e8, 4e8]), np.array([[0, 2e8], [2e8, 0]])
    D, F = [], []
    for f in 500 * np.stack([np.cos(angle), np.sin(angle)], axis=1) * phase:
        off = 0.004 * rng.standard_normal() * direct + 0.003 * rng.standard_normal() * cross
        wobble = rng.standard_normal((windows, 4)) + 1j * rng.standard_normal((windows, 4))
        D.append(np.linalg.solve(H_TRUE + off, f) + 2e-9 * wobble[:, :2])
        F.append(f + 0.2 * wobble[:, 2:])
    return np.concatenate(D), np.concatenate(F), np.repeat(np.arange(directions), windows)


@pytest.mark.slow
@pytest.mark.parametrize(("directions", "method"), [(6, "mm-eiv"), (6, "ols"), (4, "mm-eiv")])
def test_intervals_hold_when_runs_differ_by_more_than_their_repeats(directions: int, method: str):
    inside = []
    for seed in range(90):
        D, F, label = _runs_that_differ(seed, directions)
        est = estimate_dynamic_stiffness(D, F, OMEGA, label, method=method)
        lo, hi = est.interval()
        inside.append((lo <= TRUE) & (hi >= TRUE))
        assert est.weights.min(axis=1).mean() > 0.6  # no run is thrown out for being itself
    assert np.mean(inside) >= 0.91
    assert np.mean(inside, axis=0).min() > 0.85


DIRECT = [0, 3, 4, 7]


def bearing_like(point):
    """H that depends on load, load direction and frequency about as a tilting-pad bearing's does."""
    w, omega = point.static_load / 5000.0, point.excitation
    f = omega / (2 * np.pi * 25)
    k = np.diag([6e7 * w**0.5, 1.8e8 * w**0.9]) * f**0.1
    c = np.diag([4.5e5 * w**-0.1, 5e5 * w**0.1]) * f**-0.15
    turn = 0.7 * (point.static_load_direction + np.pi / 2)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return R @ (k + 1j * omega * c) @ R.T + np.array([[0, 3e6], [-2e6, 0]])


@pytest.mark.slow
def test_random_intervals_hold_on_fresh_campaigns(tmp_path):
    inside, errors = [], []
    base = RigTruth.constant(np.diag([2e8, 4e8]), np.diag([4e5, 6e5]))
    for seed in range(101, 103):
        points = operating_points([(2500.0, 25.0), (5000.0, 10.0), (5000.0, 25.0), (5000.0, 50.0), (8750.0, 25.0)])
        rig = VirtualRig(replace(base, stiffness=bearing_like), RigPlan(dynamic=points), seed=seed)
        path = tmp_path / f"{seed}.h5"
        write_campaign(path, rig)
        for p in identify(load_campaign(path), IdentifySettings(methods=())).points:
            truth = vector(bearing_like(p.point))
            lo, hi = p.stiffness.interval(0.95, systematic=False)
            inside.append((lo <= truth) & (truth <= hi))
            limit = 0.06 if p.point.excitation_hz == 50 else 0.01  # on the mains two answers can remain
            errors.append(np.abs(p.stiffness.vector[DIRECT] / truth[DIRECT] - 1) / limit)
    # 80 entries, eight of a point share their runs: two standard deviations are about 6 %
    assert 0.9 <= np.mean(inside) <= 0.999
    assert np.max(errors) < 1


@pytest.mark.slow
def test_angles_of_a_known_disturbance_are_found_among_many_minima():
    """Six runs, two probes with mains of known size and unknown phase: H is found, the interval holds."""
    omega = 2 * np.pi * 50
    h = np.array([[7.5e7 + 1j * omega * 4.2e5, 5e6], [2e5, 1.9e8 + 1j * omega * 4.6e5]])
    truth = vector(h)
    probes = np.array([[1, 1], [-1, 1]]) / np.sqrt(2)
    patterns = 0.0375e-6 * np.linalg.pinv(probes).T.astype(complex)
    angle = np.arange(6) * np.pi / 6
    close, plain = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        force = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.exp(2j * np.pi * rng.random(6))[:, None]
        force = 500 * force * (1 + 5e-4 * rng.standard_normal((6, 1)))
        disturbed = np.linalg.solve(h, force.T).T + np.exp(2j * np.pi * rng.random((6, 2))) @ patterns
        problem = MainsEquations(disturbed, force, patterns, 1e-3 * np.linalg.norm(force, axis=1))
        best = problem.solve()[0]
        close.append(np.linalg.norm(problem.entries(best.x) - truth) / np.linalg.norm(truth))
        naive = np.linalg.lstsq(disturbed, force, rcond=None)[0].T
        plain.append(np.linalg.norm(naive - h) / np.linalg.norm(h))
    assert np.median(close) < 0.25 * np.median(plain)
