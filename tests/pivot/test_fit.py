"""The whole way from dry runs to curves, on small records made by hand; and who may be refused on the way."""

import dataclasses
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.problem import RigDataError
from tests.pivot.test_assemble import ANGLES, REACH, SCALE, channel, vectors
from tests.pivot.test_assemble import Run as FirstPad
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.pivot.laws import LAWS

LEVELS = 500.0 * np.arange(1, 9)


class Run(FirstPad):
    """A staircase of eight levels against one pad; `slip` [m] moves everything on the fourth."""

    def __init__(self, pad, seed=1, points_at=None, slip=0.0, name=None, soft=1.0, down=False):
        super().__init__(n=10)
        n, rng = 3200, np.random.default_rng([seed, pad or 0])
        self.id, self.file, self.pad, self.sample_rate = name or f"dry-{pad}", f"dry-{pad}.csv", pad, 500.0
        self.time = np.arange(n) / 500.0
        levels = LEVELS[::-1] if down else LEVELS
        load = np.interp(
            self.time, np.ravel([[0.8 * k, 0.8 * k + 0.2] for k in range(1, 8)]), np.repeat(levels, 2)[1:-1]
        )
        moved = soft * SCALE * load + slip * ((self.time > 2.5) & (self.time < 3.3))
        angle = ANGLES[(points_at or pad) - 1]
        self.force = vectors(angle, load) + rng.standard_normal((n, 2))
        self.displacement = vectors(angle, REACH + moved) + 2e-8 * rng.standard_normal((n, 2))


def campaign(*runs):
    return SimpleNamespace(of_kind=lambda kind: list(runs) if kind == "dry_pivot" else [])


def fit(*runs, **options):
    return fit_pivots(campaign(*runs), ANGLES, **options)


@pytest.fixture(scope="module")
def curves():
    """Pads in no order, the second tested twice, the third twice as soft; the first slipped in one hold."""
    return fit(Run(2), Run(3, soft=2.0), Run(1, slip=2e-6), Run(2, seed=5, name="again", down=True))


def test_every_pad_has_its_curve_in_order(curves):
    assert [curve.pad for curve in curves] == [1, 2, 3]
    assert [curve.runs for curve in curves] == [("dry-1",), ("dry-2", "again"), ("dry-3",)]
    for curve, soft in zip(curves, (1.0, 1.0, 2.0), strict=True):
        assert curve.angle == ANGLES[curve.pad - 1]
        np.testing.assert_allclose(curve.stiffness(np.array([1000.0, 3000.0])), 1 / (soft * SCALE), rtol=0.02)
        assert abs(curve.load_direction.angle) < 0.01
        assert abs(curve.displacement_direction.angle) < 0.05
        assert sum(curve.weights) == pytest.approx(1.0)
    np.testing.assert_allclose(curves[2].steps.load, LEVELS, rtol=5e-3)
    assert len(curves[1].steps.load) == 15  # the hold at the top of the run that comes down is no point
    assert curves[1].hysteresis is not None
    assert curves[2].hysteresis is None


def test_a_hold_that_slipped_takes_no_part(curves):
    assert curves[0].steps.weight[3] == 0.0
    assert curves[0].steps.weight.sum() >= 5.0
    assert "bad-steps" in curves[0].status
    np.testing.assert_array_equal(curves[2].steps.weight, 1.0)
    assert all("refused" not in said.sentence() for curve in curves for said in curve.status)


def test_every_law_is_tried_with_and_without_contact_loss_and_the_likeliest_leads():
    (curve,) = fit(Run(4))
    assert curve.law.name == "linear"
    assert {f.name for f in curve.fits} <= set(LAWS)
    assert any(f.contact for f in curve.fits)


def refused(*runs, **settings):
    with pytest.raises(RigDataError) as caught:
        fit(*runs, **settings)
    return caught.value.problems


def test_all_that_is_wrong_is_told_at_once():
    """A pad that the bearing lacks, and one run that points at another pad than it says."""
    found = refused(Run(1), Run(2, points_at=4, name="lies"), Run(6, points_at=1, name="sixth"))
    assert {p.run for p in found} == {"sixth", "lies"}
    assert any("both point at pad 4" in p.what for p in found)
    (nothing,) = refused()
    assert "has no runs of kind dry_pivot" in nothing.what
    (none,) = refused(Run(6, points_at=1), on_refusal="skip")
    assert "names pad 6, the bearing has pads 1 to 5" in none.what
    (none,) = refused(Run(None, points_at=1, name="nobody"), on_refusal="skip")
    assert "names pad None" in none.what


def test_records_that_are_refused_are_left_out_where_that_is_wished_and_named():
    lies = Run(2, points_at=4, name="lies")
    (curve,) = fit(Run(1), lies, on_refusal="skip")
    (said,) = [s.sentence() for s in curve.status if s == "runs-refused"]
    assert "lies (run lies says pad 2" in said
    (other,) = fit(Run(1), Run(1, seed=3, name="again"), lies, on_refusal="few")
    assert other.runs == ("dry-1", "again")
    # half of them are no accident
    assert {p.run for p in refused(Run(1), lies, on_refusal="few")} == {"lies"}


def test_a_shaft_that_stands_elsewhere_is_refused_too():
    """Its directions are right: only the other runs tell. Every reason of a run counts once."""
    odd = Run(5)
    odd.displacement = odd.displacement + REACH * 0.5 * np.array([-math.sin(ANGLES[4]), math.cos(ANGLES[4])])
    (problem,) = refused(*(Run(pad) for pad in (1, 2, 4)), odd)
    assert problem.run == "dry-5"
    assert "run dry-5: the shaft stands" in problem.what


@dataclasses.dataclass(frozen=True)
class Readings:
    """Readings of a run's channels in memory."""

    channels: dict
    values: dict
    id: str = "p-1"
    file: str = "p.csv"
    sample_rate: float = 100.0

    def record(self, name):
        return SimpleNamespace(values=self.values[name])


@pytest.mark.parametrize(("dead", "left"), [(("X1C",), {"X1A", "X1B"}), ((), {"X1A", "X1B", "X1C"})])
def test_a_dead_probe_is_left_out_where_two_others_tell_the_plane(dead, left):
    axes = {"X1A": 0.25, "X1B": 0.75, "X1C": 0.5}
    rng = np.random.default_rng(2)
    channels = {}
    for name, share in axes.items():
        channels[name] = replace(channel("displacement", share * math.pi), name=name)
    values = {name: np.full(400, 1.2) if name in dead else rng.standard_normal(400) for name in channels}
    assert set(live_run(Readings(channels, values)).channels) == left
    values["X1B"] = values["X1C"] = np.full(400, 1.2)  # then nothing else tells the plane
    with pytest.raises(RigDataError, match="stands still"):
        live_run(Readings(channels, values))
