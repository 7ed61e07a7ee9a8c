"""The RLM path against R's MASS::rlm: coefficients and scale on a stacked real system of Eq. (15).

Source: Venables & Ripley's MASS (7.3-58.2 under R 4.2.2), run with acc = 1e-15; Huber 1.345, bisquare
4.685, Hampel 2/4/8, scale MAD/0.6745 or Huber's proposal 2. The numbers stand in data/mass_rlm.json.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from statsmodels.robust.scale import HuberScale

from tpjb_ident.estimators.estimate import RlmSettings, solve_rlm

REFERENCE = json.loads((Path(__file__).parent / "data" / "mass_rlm.json").read_text(encoding="utf-8"))
X, Y = np.array(REFERENCE["X"]), np.array(REFERENCE["y"])
#: As MASS::rlm's proposal 2.
PROPOSAL_2 = HuberScale(d=1.345, tol=1e-13, maxiter=500)


def mass_scale(model, residual) -> float:
    """MASS::rlm divides the median by 0.6745, not by the normal quantile."""
    return float(np.median(np.abs(residual)) / 0.6745)


@pytest.mark.parametrize(
    ("run", "norm", "scale"),
    [
        ("psi.huber", "huber", mass_scale),
        ("psi.bisquare", "tukey", mass_scale),
        ("psi.hampel", "hampel", mass_scale),
        ("proposal2", "huber", PROPOSAL_2),
    ],
)
def test_coefficients_and_scale_are_those_of_mass(run: str, norm: str, scale):
    fit = solve_rlm(X, Y, RlmSettings(norm, scale, 2000, 1e-15))
    expected = REFERENCE["results"][run]
    np.testing.assert_allclose(fit.params, expected["coefficients"], rtol=0, atol=1e-12)
    assert fit.scale == pytest.approx(expected["scale"], rel=1e-11)
    assert fit.conditions == ()


def test_the_usual_mad_constant_differs_by_what_it_should():
    own = solve_rlm(X, Y, RlmSettings("huber", "mad", 2000, 1e-15))
    mass = REFERENCE["results"]["psi.huber"]
    assert own.scale / mass["scale"] == pytest.approx(0.6745 / 0.6744897501960817, rel=1e-5)
    assert 0 < np.abs(own.params - mass["coefficients"]).max() < 1e-6
