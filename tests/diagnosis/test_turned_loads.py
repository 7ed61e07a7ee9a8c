"""What a load that points aside does to the positions of a locus."""

import math

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tpjb_ident.clearance.locus import Locus, LocusPoint
from tpjb_ident.diagnosis.observations.observe import moved_by_miss


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
