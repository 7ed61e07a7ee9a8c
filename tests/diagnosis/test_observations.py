"""What is observed: of tables, points and turned loads, and where a campaign lacks what would tell physics from it."""

import math
from types import SimpleNamespace

import numpy as np
import pint
import pytest

from rigdata.operating_point import OperatingPoint
from rigdata.units import UnitError
from tests.diagnosis.rocker_case import rocker_setup
from tpjb_ident.clearance.locus import Locus, LocusPoint
from tpjb_ident.diagnosis.campaign import unknown_centre
from tpjb_ident.diagnosis.forward import forward
from tpjb_ident.diagnosis.from_python import points_of
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import _mains_on_excitation, moved_by_miss, observe, observe_table
from tpjb_ident.errors import ArgumentError, BadInputError
from tpjb_ident.estimators.stiffness import DynamicStiffness

HEAD = "static_load_N,shaft_speed_Hz,excitation_Hz,kxx_N_per_m,kyy_N_per_m,cyy_Ns_per_m,cyy_Ns_per_m_se"


def table(tmp_path, *lines, head=HEAD):
    path = tmp_path / "read_off.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_values_errors_and_missing_cells(tmp_path):
    seen = observe_table(table(tmp_path, "5000,22,25,6e7,2e8,1e6,2e4", "8750,22,,,4e8,1.4e6,2e4"), 0.05)
    assert [e.observable for e in seen.elements] == ["kxx", "kyy", "cyy", "kyy", "cyy"]
    omega = 2 * math.pi * 25
    assert seen.value[2] == pytest.approx(omega * 1e6)
    assert math.sqrt(seen.covariance[2, 2]) == pytest.approx(max(omega * 2e4, 0.1 * 0.05 * omega * 1e6))
    assert math.sqrt(seen.covariance[1, 1]) == pytest.approx(0.05 * 2e8)
    assert [t.excitation for t in seen.layout.dynamic] == [(omega,), (2 * math.pi * 22,)]
    assert np.allclose([t.direction for t in seen.layout.dynamic], -math.pi / 2)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (("5000,22,25,6e7,2e8,1e6,2e4",), "nothing says how far it holds"),
        (("5000,22,25,,,1e6,2e4", "5000,22,25,,,1e6,2e4"), "second row for the same point"),
        (("-5,22,25,,,1e6,2e4",), "line 2, static_load_N: -5 is below 0"),
        (("0,22,25,,,1e6,2e4",), "must be positive"),
        (("5000,22,25,6e7,,1e6,inf",), "nothing says how far it holds"),
        (("5000,22,25,,,high,2e4",), "is no number"),
        (("5000,22,25,,,,",), "holds no coefficient"),
    ],
)
def test_tables_that_cannot_be_taken_are_refused_with_their_line(tmp_path, lines, said):
    with pytest.raises(BadInputError, match=said):
        observe_table(table(tmp_path, *lines))


class _Known:
    """An identification that knows no point: load misses then move a position round only."""

    points = ()


def round_locus(angles, centre):
    points = []
    for a in angles:
        place = 60e-6 * np.array([math.cos(a + 0.3), math.sin(a + 0.3)]) + centre
        points.append(LocusPoint("r", OperatingPoint(5e3, a, 138.0, 0.0), 5e3, a, place, np.eye(2) * 1e-16))
    return Locus(tuple(points), np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("count", [20, 6, 4])
def test_a_round_locus_turns_with_the_load_wherever_its_centre(count):
    locus = round_locus(2 * np.pi * np.arange(count) / count, np.array([3e-4, -1e-4]))
    for p, moved in zip(locus.points, moved_by_miss(locus, _Known()), strict=True):
        a = p.point.static_load_direction + 0.3
        np.testing.assert_allclose(moved[:, 1], 60e-6 * np.array([-math.sin(a), math.cos(a)]), atol=1e-10)
        assert np.all(moved[:, 0] == 0.0)


U = pint.UnitRegistry(cache_folder=None)


def test_every_combination_in_any_unit():
    points = points_of(
        {"load": U.Quantity([2.5, 5.0], "kN"), "speed": U.Quantity(1320, "rpm"), "excitation": [100.0, 150.0]}
    )
    assert [(p.static_load, p.excitation) for p in points] == [
        (2500.0, 100.0), (2500.0, 150.0), (5000.0, 100.0), (5000.0, 150.0)]  # fmt: skip
    assert points[0].shaft_speed == pytest.approx(2 * math.pi * 22)
    assert points[0].static_load_direction == -math.pi / 2


def test_what_is_wrong_is_named():
    with pytest.raises(UnitError, match="points: load"):
        points_of({"load": U.Quantity(5, "m"), "speed": 138.0, "excitation": 157.0})
    with pytest.raises(ArgumentError, match="Did you mean 'speed'"):
        points_of({"load": 5000.0, "sped": 138.0, "excitation": 157.0})
    with pytest.raises(ArgumentError, match="excitation is missing"):
        points_of({"load": 5000.0, "speed": 138.0})


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
