"""What a campaign lacks must not pass for physics: no clearance sweep, two directions only, mains on the excitation."""

from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.diagnosis.rocker_case import rocker_setup
from tpjb_ident.diagnosis.campaign import unknown_centre
from tpjb_ident.diagnosis.forward import forward
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import _mains_on_excitation, observe
from tpjb_ident.estimators.stiffness import DynamicStiffness


def point(*quality: str, load: float = 5000.0):
    h = np.array([[1e8 + 2e7j, 1e6], [-1e6, 3e8 + 4e7j]])
    return SimpleNamespace(
        point=OperatingPoint(load, -1.5, 138.0, 157.0),
        stiffness=DynamicStiffness(h, 157.0, np.eye(8) * 1e10, np.full(8, 20.0), "mm-eiv", np.ones((6, 2))),
        temperatures={},
        quality=quality,
    )


def test_without_a_polygon_the_centre_may_lie_anywhere_near_the_probes_zero():
    near = SimpleNamespace(points=[SimpleNamespace(position=np.array([3e-5, 4e-5]))])
    far = SimpleNamespace(points=[SimpleNamespace(position=np.array([3e-3, 4e-3]))])
    assert unknown_centre(near) == pytest.approx(1e-3)
    assert unknown_centre(far) == pytest.approx(15e-3)


def test_a_point_struck_by_mains_is_left_out_unless_it_was_corrected():
    assert _mains_on_excitation(point("mains on excitation line"))
    assert not _mains_on_excitation(point("mains on excitation line", "mains corrected"))
    seen = observe(SimpleNamespace(points=(point(), point("mains on excitation line", load=6000.0))))
    assert {e.place("load") for e in seen.elements} == {5000.0}
    only = observe(SimpleNamespace(points=(point("mains on excitation line"),)))
    assert len(only.elements) == 8  # nothing better is there


def test_two_directions_widen_the_covariance_by_what_runs_differ_by():
    plain, two = (observe(SimpleNamespace(points=(point(*q),))) for q in ((), ("no-spare-direction",)))
    more = np.diag(two.covariance - plain.covariance)
    np.testing.assert_allclose(more, (Deciding.unseen * np.repeat([2e8, 3e7], 4)) ** 2, rtol=1e-6)


@pytest.mark.parametrize("as_read", [None, (np.array([7e-5, 9e-5]), np.array([0.01, 1.48]))])
def test_a_polygon_is_observed_as_the_probes_read_it(as_read):
    sides = {"clearance_pushed": np.array([8e-5, 8e-5]), "fitted_angle": np.array([0.0, 1.5])}
    errors = {"clearance_pushed_se": np.full(2, 1e-7), "fitted_angle_se": np.full(2, 1e-3)}
    polygon = SimpleNamespace(**sides, **errors, angles=np.array([0.0, 1.5]), push_load=300.0, as_read=as_read)
    seen = observe(SimpleNamespace(points=(point(),)), polygon=polygon)
    pushed, fitted = as_read or sides.values()
    np.testing.assert_allclose(seen.value[-4:], [*pushed, *(fitted - polygon.angles)], atol=1e-15)


def test_load_and_heat_are_raised_only_where_no_solved_neighbour_is_known(monkeypatch):
    asked, place = [], (5000.0, -1.5, 138.0)

    def unsolved(*_, patient, near):
        asked.append((patient, near))
        raise forward.NoEquilibriumError("none")

    monkeypatch.setattr(forward, "solve_as_it_runs", unsolved)
    for known, near in (({}, False), ({place: object()}, False), ({place: object()}, True)):
        with pytest.raises(forward.NoEquilibriumError):
            forward.ModelCache(start=known).copy(near).ask(rocker_setup(), place, (), (0.75,) * 5)
    assert asked == [(True, False), (False, False), (False, True)]
