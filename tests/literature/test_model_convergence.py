"""Observed order of mesh convergence of pressure, load, position, K and C: two, as the scheme's analysis promises."""

import numpy as np
import pytest

from tests.literature.mesh_convergence import CASES, MESHES, NAMES, Case, errors, orders, overall_order, table


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[c.name for c in CASES])
def test_second_order_in_everything(case: Case):
    values = table(case, MESHES[:4])
    order = overall_order(values)
    assert (order > 1.7).all(), dict(zip(NAMES, order, strict=True))
    # single halvings scatter with where the film's edges fall between nodes, their median does not
    assert np.median(orders(values)) > 1.8
    at_80_by_8 = dict(zip(NAMES, errors(values)[2], strict=True))
    assert at_80_by_8.pop("p max") < 3e-3  # highest nodal value
    assert max(at_80_by_8.values()) < 1.5e-3, at_80_by_8


def test_order_of_a_known_sequence():
    mesh = np.array([20.0, 40.0, 80.0, 160.0])
    values = np.column_stack([3.0 + 5.0 / mesh**2, 2.0 - 7.0 / mesh])
    np.testing.assert_allclose(orders(values), [[2.0, 1.0], [2.0, 1.0]])
    np.testing.assert_allclose(overall_order(values), [2.0, 1.0])
    np.testing.assert_allclose(errors(values)[:, 0], 5.0 / mesh**2 / 3.0, rtol=1e-4)
