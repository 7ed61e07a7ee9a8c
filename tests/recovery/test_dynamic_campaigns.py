"""Whole campaigns: share of true coefficients inside the 95 % interval, and how far off the direct ones are.

The virtual rig's truths are drawn here, with seeds; the sample campaigns are in `test_golden.py`.
"""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import RigPlan, RigTruth, VirtualRig, operating_points, write_campaign
from tests.rigs.closed_form import vector
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.terms.mains import MainsEquations

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
