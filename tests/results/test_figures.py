"""Figures and flags of a point with values that can be written down: coherence, orbits, reasons, patterns, signs."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from tests.phasors import phasor_cases
from tests.phasors.phasor_cases import H
from tpjb_ident.estimators.estimate import MIN_COHERENCE, REJECTED_WEIGHT
from tpjb_ident.identification.point import disagreement
from tpjb_ident.results.point_result import amplitude, coherence, directional_pattern, flags, rejected_windows
from tpjb_ident.runs.point_data import PointData


def run(name, direction=0.5, n=4, lost=None, acceleration="yes", mass=30.0):
    lost_d, lost_f = lost or (np.zeros(n), np.zeros(n))
    mean = np.tile([3.0, -4.0], (n, 1))
    places = {"displacement": [0], "force": [1], "acceleration": [2] if acceleration else []}
    return SimpleNamespace(
        run=name, direction=direction, start=10.0 + 0.5 * np.arange(n), conditions=(), housing_mass=mass, length=0.5,
        span=None, pick=places.get, lost=np.stack([lost_d, lost_f], axis=1), means=lambda quantity: mean,
    )  # fmt: skip


def data_of(D, runs=None, per_run=4, h=H):
    D = np.asarray(D, dtype=complex)
    index = np.repeat(np.arange(len(D) // per_run), per_run)
    runs = runs or tuple(run(f"r{k}", n=per_run) for k in range(len(D) // per_run))
    point = SimpleNamespace(excitation=160.0, static_load=5.0, static_load_direction=-math.pi / 2)
    return PointData(point, tuple(runs), (0,) * len(runs), D, D @ h.T, index)


def stiff(h=H, error=1e-3, **more):
    return phasor_cases.stiff(h, covariance=error**2 * np.eye(8), **more)


def test_coherence_is_the_explained_share_of_the_worse_axis():
    D = np.array([[1.0, 0.0], [0.0, 1.0j], [1.0, 1.0], [5.0, 5.0]])
    F = D @ H.T
    off = np.array([[0.3j, 0.0], [0.0, 0.1], [0.2, 0.4], [9.0, 9.0]])
    weights = np.array([1.0, 0.5, 0.25, 0.0])
    total = (weights[:, None] * np.abs(F + off) ** 2).sum(axis=0)
    left = (weights[:, None] * np.abs(off) ** 2).sum(axis=0)
    assert coherence(D, F + off, H, weights) == pytest.approx(np.min(1 - left / total))
    assert coherence(D, F, H, weights) == pytest.approx(1.0)
    F[3], D[3, 1] = np.nan, np.nan
    assert coherence(D, F, H, np.ones(4)) == pytest.approx(1.0)
    assert math.isnan(coherence(D, F, H, np.zeros(4)))
    assert math.isnan(coherence(D, F, np.full((2, 2), np.nan), np.ones(4)))


@pytest.mark.parametrize(
    ("z", "largest"),
    [((3.0, 0.0), 3.0), ((3.0, 4.0), 5.0), ((3.0j, 4.0j), 5.0), ((3.0, 4.0j), 4.0), ((2.0, -2.0j), 2.0)],
)
def test_the_amplitude_is_the_major_half_axis_of_the_orbit(z, largest):
    """A straight line has the root of the sum of squares, a circle its radius; the phase does not matter."""
    D = np.concatenate([np.tile(np.array(z) * np.exp(0.4j), (4, 1)), 0.1 * np.ones((4, 2))])
    assert amplitude(data_of(D), np.ones(8)) == pytest.approx(largest)
    # the largest mean of a run: windows without weight or phasor do not enter
    D[0], D[1, 0] = 100.0, np.nan
    weights = np.r_[0.0, np.ones(7)]
    assert amplitude(data_of(D), weights) == pytest.approx(largest)
    assert amplitude(data_of(D), np.r_[np.zeros(4), np.ones(4)]) == pytest.approx(0.1 * math.sqrt(2.0))
    weighted = np.array([[1.0, 0.0], [5.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert amplitude(data_of(weighted), np.array([0.5, 0.25, 0.5, 0.5])) == pytest.approx((1.5 + 1.25) / 1.75)


def test_every_rejected_window_has_its_reason():
    D = np.tile([[1.0, 0.5j]], (16, 1))
    lost = np.array([0.0, 0.51, 0.0, 0.49]), np.array([0.0, 0.0, 0.72, 0.0])
    runs = (run("a", lost=lost), run("b", None), run("c", 1.0), run("d", 2.0))
    data = data_of(D, runs)
    data.D[6] *= 1.5
    data.F[7, 0] += 2.0 * np.linalg.norm(data.F[4])
    data.D[12, 1] = np.nan
    weights = np.ones(16)
    weights[[1, 2, 6, 7, 8, 9, 10, 11, 12]] = REJECTED_WEIGHT - 0.01
    weights[3] = REJECTED_WEIGHT
    found = rejected_windows(data, H, weights)
    assert [(v.run, v.time) for v in found] == [
        ("a", 10.5), ("a", 11.0), ("b", 11.0), ("b", 11.5), *(("c", 10.0 + 0.5 * k) for k in range(4)), ("d", 10.0),
    ]  # fmt: skip
    assert [v.reason for v in found] == [
        "51 % of the displacement samples missing or glitched",
        "72 % of the force samples missing or glitched",
        "displacement phasor 50.0 % away from its repeats",
        "force phasor 200.0 % away from its repeats",
        *["whole run disagrees with the other directions"] * 4,
        "missing values",
    ]
    assert [v.direction for v in found[:2]] == [0.5, 0.5]
    assert math.isnan(found[2].direction)
    assert found[0].weight == REJECTED_WEIGHT - 0.01
    none = rejected_windows(data, np.full((2, 2), np.nan), weights)
    assert {v.reason for v in none[2:8]} == {"the point has no answer"}
    assert rejected_windows(data, H, np.ones(16)) == ()


def flagged(data=None, est=None, figure=1.0):
    return flags(data or data_of(np.ones((8, 2))), est or stiff(), figure)


def test_flags_are_raised_beyond_their_limits_only():
    assert flagged() == ()
    assert flagged(figure=MIN_COHERENCE) == ()
    low = flagged(figure=MIN_COHERENCE - 1e-3)
    assert low == ("low-coherence",)
    assert "coherence 0.899 < 0.9" in low[0].detail
    assert flagged(figure=math.nan) == ("low-coherence",)
    lost = stiff(np.full((2, 2), np.nan))
    bare = data_of(np.ones((8, 2)), (run("a", acceleration=None), run("b", acceleration=None)))
    assert flagged(bare) == ("inertia-not-corrected",)
    light = data_of(np.ones((8, 2)), (run("a", acceleration=None, mass=1.0), run("b", acceleration=None)))
    assert flagged(light) == ("inertia-negligible",)
    assert flagged(bare, lost, figure=math.nan) == ()


@pytest.mark.parametrize(("missing", "named"), [(4, ()), (5, ("windows-missing",))])
def test_a_tenth_of_the_windows_may_be_missing(missing, named):
    D = np.ones((40, 2), dtype=complex)
    D[2 : 2 + missing * 7 : 7, 1] = np.nan
    found = flagged(data_of(D))
    assert found == named
    assert "".join(c.detail for c in found) == (f"{missing} of 40 windows gave no phasors" if named else "")


def test_runs_without_any_window_are_named():
    D = np.ones((16, 2), dtype=complex)
    data = data_of(D)
    data.D[4:8] = np.nan
    data.F[12:16, 0] = np.nan
    (found,) = flagged(data)
    assert found == "run-without-data"
    assert found.detail == "no usable window in r1, r3"


def fed(h, error=1e-3):
    return "negative-damping" in flagged(est=stiff(h, error))


def test_a_film_feeds_the_motion_where_its_damping_takes_no_power():
    """The power of a motion along a line is omega / 2 of d^T C d: that of the damping's symmetric part."""
    damping = np.diag([1.0, 1.0])
    assert not fed(1j * damping)
    assert not fed(5.0 * np.eye(2) + 1j * damping)
    assert fed(1j * np.diag([1.0, -0.1]))
    # coupled damping beyond the direct ones; gyroscopic forces do no work
    assert fed(1j * np.array([[1.0, 1.2], [1.2, 1.0]]))
    assert not fed(1j * np.array([[1.0, 0.8], [0.8, 1.0]]))
    assert not fed(1j * np.array([[1.0, 1.2], [-1.2, 1.0]]))
    # a symmetric stiffness does none either; that an antisymmetric one feeds a circular orbit is a matter of stability
    assert not fed(np.array([[0.0, 3.0], [3.0, 0.0]]) + 1j * damping)
    assert not fed(np.array([[0.0, 3.0], [-3.0, 0.0]]) + 1j * damping)
    for factor, named in ((2.9, False), (3.1, True)):
        assert fed(1j * np.diag([1.0, -factor * 0.1]), 0.1) is named


@pytest.mark.parametrize(
    ("turn", "skew", "named"),
    [
        (0.0, 0.0, ()),
        (1.0, 0.0, ()),
        (5.0, 0.0, ("damping-hardly-symmetric",)),
        (15.0, 0.0, ("damping-not-symmetric",)),
        (0.0, 0.2, ()),
    ],
)
def test_probes_that_stand_elsewhere_turn_stiffness_and_damping_alike(turn, skew, named):
    """The inertia of a seal makes damping skew, and stiffness otherwise."""
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    aside = skew * np.array([[0.0, -1.0], [1.0, 0.0]])
    film = np.array([[2.0, 0.1], [0.1, 3.0]]) + 0.2 * aside + 1j * (np.array([[0.6, 0.1], [0.1, 0.9]]) + aside)
    assert flagged(est=stiff(film @ np.array([[cos, -sin], [sin, cos]]))) == named


def pattern(hits, n=10, runs=6, missing=0):
    D = np.ones((n * runs, 2), dtype=complex)
    weights = np.ones(n * runs)
    for k, count in enumerate(hits):
        weights[n * k : n * k + count] = REJECTED_WEIGHT - 0.01
    data = data_of(D, per_run=n, runs=tuple(run(f"r{k}", 0.5 if k else None, n=n) for k in range(runs)))
    if missing:
        data.D[-missing:] = np.nan
        weights[-missing:] = 0.0
    return next(iter(directional_pattern(data, weights)), None)


def test_rejected_windows_that_gather_are_named_with_their_run():
    (_, _) = found = pattern([0, 6, 0, 0, 0, 0]), pattern([5, 0, 0, 0, 0, 0])
    assert found[0] == "directional-rejection"
    assert "gather in r1 at 29 deg (6 of 10): look" in found[0].detail
    assert "gather in r0 (5 of 10): look" in found[1].detail
    assert pattern([0] * 6) is None
    assert pattern([2, 2, 2, 2, 2, 2]) is None
    # what gave no phasor at all is no rejection, and no part of a run
    assert pattern([6, 0, 0, 0, 0, 0], missing=10) is not None
    assert pattern([0, 0, 0, 0, 0, 0], missing=10) is None


@pytest.mark.parametrize(("hits", "n", "named"), [(2, 4, False), (3, 4, True), (4, 10, False), (5, 10, True)])
def test_three_windows_and_more_than_two_fifths_make_a_pattern(hits, n, named):
    assert (pattern([hits, 0, 0, 0, 0, 0], n=n) is not None) is named


@pytest.mark.parametrize("others", [2, 3, 4])
def test_a_pattern_is_what_chance_gives_less_than_once_in_a_thousand(others):
    """Against the share rejected in the other runs (half a window more, since that may be none)."""
    for hits in (7, 8, 9, 10):
        share = (5 * others + 0.5) / (5 * 10 + 1.0)
        chance = float(binom.sf(hits - 1, 10, share))
        assert (pattern([hits, *[others] * 5]) is not None) is (chance < 1e-3)


def test_methods_disagree_beyond_both_intervals():
    """Their half widths added as squares; the worst entry is told."""
    best = stiff(error=3e-3)
    room = 1.959963984540054 * math.hypot(3e-3, 4e-3)
    for factor, named in ((0.99, False), (1.5, True)):
        off = np.array([[0.0, 0.0], [0.2 * factor * room, 1j * factor * room]])
        found = disagreement({"mm": stiff(H + off, 4e-3), "best": best}, "best")
        assert found == (("methods-disagree",) if named else ())
    assert found[0].detail == "mm (1.5 times the interval) away from best"
    lost = stiff(np.full((2, 2), np.nan))
    assert disagreement({"mm": lost, "best": best}, "best") == ()
    assert disagreement({"mm": best, "best": lost}, "best") == ()
