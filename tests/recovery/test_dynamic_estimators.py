"""Recovery of a known H by every estimator: accuracy, bias, coverage in the study's situation.

With fixed seeds; a table of every method in every case is in `tests/studies/RESULTS.md`.
Fewer replicates than its 400 leave a Monte-Carlo error of 1/sqrt(2 n) on an RMSE.
"""

import numpy as np
import pytest

from tests.rigs.estimator_cases import H_TRUE, OMEGA, TRUE, Case, draw, score
from tpjb_ident.estimators.estimate import estimate_dynamic_stiffness

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
