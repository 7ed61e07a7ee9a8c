"""Intervals of effects by their limits: a size, a factor on a logarithmic scale, sizes by pad."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tpjb_ident.diagnosis.verdict.decide import parameters_of


def fit(values, amplitudes, errors, names, basis=()):
    free = [SimpleNamespace(name=name, unit="m") for name in names]
    candidate = SimpleNamespace(free=free, basis=basis, fixed={})
    fault = SimpleNamespace(name="x", candidate=candidate, values=values)
    return SimpleNamespace(faults=[fault], amplitudes=[np.array(amplitudes)], errors=[np.array(errors)])


def test_a_size_has_a_limit_on_either_side():
    (size,) = parameters_of(fit(lambda a: {"s": a[0]}, [3.0], [0.5], ["s"]), 0).values()
    assert (size.value, size.unit) == (3.0, "m")
    assert (size.lo, size.hi) == pytest.approx((3.0 - 0.98, 3.0 + 0.98))


@pytest.mark.parametrize("sign", [1.0, -1.0])  # of a parameter that falls where its amplitude rises
def test_a_factor_has_its_limits_on_its_own_scale(sign):
    (factor,) = parameters_of(fit(lambda a: {"f": math.exp(sign * a[0])}, [0.0], [0.1], ["f"]), 0).values()
    assert (factor.lo, factor.hi) == pytest.approx((math.exp(-0.196), math.exp(0.196)))


def test_sizes_by_pad_that_share_amplitudes_have_theirs():
    basis = ((1.0, 0.0), (0.0, 2.0))

    def values(amplitudes):
        return dict(zip(("p1", "p2"), np.asarray(basis).T @ amplitudes, strict=True))

    found = parameters_of(fit(values, [1.0, 2.0], [0.1, 0.1], ["p1", "p2"], basis), 0)
    assert (found["p1"].lo, found["p1"].hi) == pytest.approx((1.0 - 0.196, 1.0 + 0.196))
    assert (found["p2"].lo, found["p2"].hi) == pytest.approx((4.0 - 0.392, 4.0 + 0.392))
