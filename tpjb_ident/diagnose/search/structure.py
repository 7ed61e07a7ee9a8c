"""Structure: is what a model leaves more than noise, and where.

After a fit the whitened residual is projected on named groups of patterns (`directions`) and on every effect that is
not in the model (a score, or Lagrange-multiplier, test each). The smallest p-value counts; its own distribution comes
from a parametric bootstrap of the residual, so that the number of tests and their overlap cost what they should.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnose.search.directions import Direction

#: Draws of the parametric bootstrap.
DRAWS = 1000
#: Share of a pattern beside the fitted effects below which nothing is left to test.
MOSTLY_ABSORBED = 0.03


@dataclass(frozen=True)
class GroupTest:
    """One group of patterns against the residual.

    Attributes
    ----------
    label : str
    statistic : float
        Squared length of the whitened residual in the group's span, over the variance scale.
    dof : int
    p : float
        As if it were the only test.
    """

    label: str
    statistic: float
    dof: int
    p: float

    @property
    def excess(self) -> float:
        """What it has above expectation, in standard deviations of the pattern."""
        return float(np.sqrt(max(self.statistic - self.dof, 0.0)))


@dataclass(frozen=True)
class Structure:
    """Result of `residual_structure`.

    Attributes
    ----------
    tests : tuple of GroupTest
        Smallest p first.
    p : float
        Of the smallest of them, all tests considered.
    scale : float
        Variance of the rough part of the residual over what was stated.
    """

    tests: tuple[GroupTest, ...] = field(repr=False)
    p: float
    scale: float

    @property
    def words(self) -> str:
        """Where it shows most."""
        return self.tests[0].label if self.tests else ""


@dataclass(frozen=True)
class Patterns:
    """Whitened, orthonormal spans of groups, ready for many residuals.

    Attributes
    ----------
    labels : tuple of str
    spans : tuple of (n, m) ndarray
        Orthonormal, in the whitened space of the elements used, what the model can absorb projected off.
    rough : (n, r) ndarray
        Orthonormal complement of everything smooth: what is left there is noise.
    """

    labels: tuple[str, ...]
    spans: tuple[FloatArray, ...] = field(repr=False)
    rough: FloatArray = field(repr=False)


def patterns(
    factor: FloatArray, rows: BoolArray, groups: Sequence[Direction], singles: Sequence[Direction], jacobian: FloatArray
) -> Patterns:
    """Prepare the spans.

    Parameters
    ----------
    factor : (n, n) ndarray
        Cholesky factor of the covariance of the elements used.
    rows : (N,) ndarray of bool
        Which elements those are.
    groups, singles : sequence of Direction
        Generic patterns, tested by group and together; effects not in the model, each tested by itself.
    jacobian : (N, k) ndarray
        Of the fitted amplitudes.
    """
    from scipy.linalg import solve_triangular

    def white(columns: FloatArray) -> FloatArray:
        return np.asarray(solve_triangular(factor, columns[rows], lower=True))

    absorbed = _orthonormal(white(jacobian))
    spans = [_left(absorbed, white(g.columns)) for g in groups]
    together = _orthonormal(np.column_stack(spans)) if spans else np.zeros((len(factor), 0))
    alone = [_left(absorbed, white(s.columns)) for s in singles]
    labels = [g.label for g in groups] + ["all patterns together"] + [s.label for s in singles]
    smooth = _orthonormal(np.column_stack([absorbed, together, *alone]))
    full, _ = np.linalg.qr(smooth, mode="complete")
    rough = full[:, smooth.shape[1] :]
    table = [(label, s) for label, s in zip(labels, [*spans, together, *alone], strict=True) if s.shape[1]]
    return Patterns(tuple(label for label, _ in table), tuple(s for _, s in table), rough)


def residual_structure(found: Patterns, residual: FloatArray, limits: tuple[float, float]) -> Structure:
    """Test a whitened residual.

    Parameters
    ----------
    found : Patterns
    residual : (n,) ndarray
        Whitened with the factor that `patterns` was given.
    limits : tuple of float
        Of the variance scale.
    """
    from scipy.stats import chi2

    scale = rough_scale(found, residual[:, None], limits)
    dof = np.array([s.shape[1] for s in found.spans])
    own = _statistics(found, residual[:, None]) / scale
    p = chi2.sf(own, dof[:, None])[:, 0]
    draws = np.random.default_rng(20190761).standard_normal((len(residual), DRAWS))
    drawn = _statistics(found, draws) / rough_scale(found, draws, limits)
    # among tests of one size the largest statistic has the smallest p: one tail per size is enough
    null = np.min([chi2.sf(drawn[dof == d].max(axis=0), d) for d in np.unique(dof)], axis=0)
    rank = (1.0 + np.sum(null <= p.min())) / (DRAWS + 1.0)
    table = zip(found.labels, own[:, 0], dof, p, strict=True)
    tests = sorted((GroupTest(n, float(t), int(d), float(q)) for n, t, d, q in table), key=_most_telling)
    return Structure(tuple(tests), _beyond(float(rank), float(p.min()), len(p)), float(scale[0]))


def _most_telling(test: GroupTest) -> tuple[float, float]:
    return test.p, -test.statistic / test.dof


def rough_scale(found: Patterns, residuals: FloatArray, limits: tuple[float, float]) -> FloatArray:
    """Variance of the rough part of whitened residuals (n, m) over the stated one, within limits, (m,)."""
    count = found.rough.shape[1]
    if count < 10:
        return np.ones(residuals.shape[1])
    return np.clip(np.sum((found.rough.T @ residuals) ** 2, axis=0) / count, *limits)


def _beyond(rank: float, smallest: float, count: int) -> float:
    """Bootstrap p-value; where no draw goes as far, what Bonferroni allows at the most."""
    return rank if rank > 2.0 / (DRAWS + 1.0) else min(rank, smallest * count)


def _statistics(found: Patterns, residuals: FloatArray) -> FloatArray:
    return np.array([np.sum((s.T @ residuals) ** 2, axis=0) for s in found.spans])


def _left(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Orthonormal span of what columns keep beside a basis; those that it holds all but wholly are dropped."""
    rest = columns - basis @ (basis.T @ columns)
    kept = np.linalg.norm(rest, axis=0) > MOSTLY_ABSORBED * np.linalg.norm(columns, axis=0)
    return _orthonormal(rest[:, kept])


def _orthonormal(columns: FloatArray) -> FloatArray:
    """Orthonormal basis of a span; directions that are within rounding of the others are dropped."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 1e-9] / size[size > 1e-9]
    if not kept.shape[1]:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(kept, full_matrices=False)
    return np.asarray(u[:, s > 1e-3 * s[0]])
