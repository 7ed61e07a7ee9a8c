"""A compliant structure bends the displacements of all dry tests in one pattern, exchanged channels in another."""

import math

import numpy as np
import pytest

from tpjb_ident.pivot.dry_record import PadDirection
from tpjb_ident.pivot.refusals import structure_behind

PADS = np.radians([270.0, 342.0, 54.0, 126.0, 198.0])
LIMIT = math.radians(30.0)


def seen(compliance, pivot=2e-9, mirror=None):
    """Slopes along the pads and directions of the displacements behind a 2 x 2 compliance."""
    slopes, moved = [], []
    for angle in PADS:
        normal = np.array([math.cos(angle), math.sin(angle)])
        shift = compliance @ normal + pivot * normal
        shift = shift if mirror is None else mirror @ shift
        along, across = shift @ normal, shift @ [-normal[1], normal[0]]
        slopes.append(along)
        moved.append(PadDirection(math.atan2(across, along), 1e-3))
    return slopes, moved


@pytest.mark.parametrize("direction", [-70.0, 0.0, 20.0, 90.0])
def test_a_spring_of_one_direction_is_found_with_its_size(direction):
    axis = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction))])
    found = structure_behind(PADS, *seen(4e-9 * np.outer(axis, axis)), LIMIT)
    assert found is not None
    assert found.compliance == pytest.approx(4e-9)
    assert math.cos(2 * (found.direction - math.radians(direction))) == pytest.approx(1.0)


def test_exchanged_probes_are_no_structure():
    swapped = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert structure_behind(PADS, *seen(np.zeros((2, 2)), mirror=swapped), LIMIT) is None


def test_three_pads_are_too_few():
    slopes, moved = seen(4e-9 * np.diag([1.0, 0.0]))
    assert structure_behind(PADS[:3], slopes[:3], moved[:3], LIMIT) is None
