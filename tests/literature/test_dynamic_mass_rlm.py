"""The RLM path against R's MASS::rlm: coefficients and scale on a stacked real system of Eq. (15).

Source: Venables & Ripley's MASS (7.3-58.2 under R 4.2.2), run with acc = 1e-15; Huber 1.345, bisquare
4.685, Hampel 2/4/8, scale MAD/0.6745 or Huber's proposal 2. The numbers stand in data/mass_rlm.json.
"""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from statsmodels.robust.scale import HuberScale

from tests.rigs.estimator_cases import Case, draw
from tpjb_ident.estimators.r_matrix import phasor_table, real_rows
from tpjb_ident.estimators.rlm import RlmSettings, solve_rlm

REFERENCE = json.loads((Path(__file__).parent / "data" / "mass_rlm.json").read_text(encoding="utf-8"))


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
    fit = solve_rlm(
        np.array(REFERENCE["X"]),
        np.array(REFERENCE["y"]),
        RlmSettings(norm, scale, max_iterations=2000, tolerance=1e-15),
    )
    expected = REFERENCE["results"][run]
    np.testing.assert_allclose(fit.params, expected["coefficients"], rtol=0, atol=1e-12)
    assert fit.scale == pytest.approx(expected["scale"], rel=1e-11)
    assert fit.conditions == ()


def test_the_usual_mad_constant_differs_by_what_it_should():
    X, y = np.array(REFERENCE["X"]), np.array(REFERENCE["y"])
    own = solve_rlm(X, y, RlmSettings("huber", "mad", 2000, 1e-15))
    mass = REFERENCE["results"]["psi.huber"]
    assert own.scale / mass["scale"] == pytest.approx(0.6745 / 0.6744897501960817, rel=1e-5)
    assert 0 < np.abs(own.params - mass["coefficients"]).max() < 1e-6


R_PROGRAM = """
library(MASS)
d <- read.csv(commandArgs(TRUE)[1])
for (psi in c("psi.huber", "psi.bisquare", "psi.hampel")) {
  fit <- rlm(as.matrix(d[, 1:4]), d$y, psi = get(psi), acc = 1e-15, maxit = 2000)
  cat(format(c(coef(fit), fit$s), digits = 17), "\n")
}
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("Rscript") is None, reason="R is not installed (Debian: r-base-core, r-cran-mass)")
@pytest.mark.parametrize("seed", [1, 2])
def test_fresh_systems_agree_with_the_installed_r(seed: int, tmp_path: Path):
    sample = draw(Case("force", 0.2), seed, 0)
    table = phasor_table(sample.D, sample.F, sample.direction)
    X, y = real_rows(table.D, table.F[:, seed % 2])
    np.savetxt(tmp_path / "d.csv", np.column_stack([X, y]), "%.17g", delimiter=",", header="a,b,c,d,y", comments="")
    (tmp_path / "fit.R").write_text(R_PROGRAM)
    done = subprocess.run(["Rscript", tmp_path / "fit.R", tmp_path / "d.csv"], capture_output=True, text=True)
    if "no package called" in done.stderr:
        pytest.skip("R has no package MASS")
    assert done.returncode == 0, done.stderr
    for norm, line in zip(("huber", "tukey", "hampel"), done.stdout.splitlines(), strict=True):
        *coefficients, scale = map(float, line.split())
        fit = solve_rlm(X, y, RlmSettings(norm, mass_scale, max_iterations=2000, tolerance=1e-15))
        np.testing.assert_allclose(fit.params, coefficients, rtol=0, atol=1e-12)
        assert fit.scale == pytest.approx(scale, rel=1e-11)
