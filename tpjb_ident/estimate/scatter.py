"""How much runs differ beyond their records' noise, and which of them stand apart.

Blocks carry a bisquare weight on the campaign's scale, in points where enough good runs remain: one bad run of five is
found because the other points say what is usual. The scatter of the force from run to run has four components
found by moments and pooled over all points, taken as alike as far as the runs do not tell them
apart; a point whose runs differ clearly more than the others' has scatter of its own.

A bearing that is stiffer in one run than in another shows a force in phase with the motion and along the spring force,
one with more damping a force a quarter of a turn ahead along the damping force. A load that is turned shows across
them, in proportion to the motion, however soft the bearing is along it. As one scatter, what is right on average would
be too little for stiffness and too much for damping.

The covariance N of a block is circular: it holds the mean of the four. What they differ from it by is real, and is made
up for in the block's real rows: with the patterns p of the components, their covariance is I + sum (s^2 - mean) p p^T,
and its inverse root brings them back to unit variance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr, fdtrc, fdtri

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.estimate.equation import adjoint, totals

#: In phase with the motion along the spring force and across it, ahead of it along the damping force and across it.
COMPONENTS = 4
#: Which components move stiffness and mass of a point, and which its damping.
PHASES = slice(0, 2), slice(2, 4)
#: Which act across the spring force, or the damping force.
ACROSS = slice(1, 4, 2)
#: A scatter across the force is at most so many times its size: where stiffness and mass cancel there is none along.
_LARGEST = 10.0
#: A component has at least this share of the mean scatter: keeps rows of computed records solvable.
_LEAST = 0.02


@dataclass(frozen=True)
class AlongForce:
    """What the force equations of blocks say of every component."""

    chi_square: FloatArray  #: (n, 4)
    information: FloatArray  #: (n, 4): what a scatter of variance one adds to it
    J_h: FloatArray  #: (n, 4, numbers): their rows


@dataclass(frozen=True)
class ForceScatter:
    """Directions of the components in the real rows of blocks, n of them with k rows."""

    basis: FloatArray  #: (n, k, 4): orthonormal
    patterns: FloatArray  #: (n, 4, 4): of the components, of relative size one, in the basis
    root: FloatArray  #: (n, 4, 4): inverse root of the rows' covariance in the basis
    size: FloatArray  #: (n, 4): of a scatter of one, over the film's force

    @staticmethod
    def of(patterns: ComplexArray, motion: ComplexArray, h: ComplexArray, variance: FloatArray) -> ForceScatter:
        """Components of complex patterns (n, k / 2, 2) of the size of the film's force along X and Y.

        `motion` (n, 2) [m], `h` (n, 2, 2) [N/m], `variance` (n, 4).
        """
        force = np.einsum("nij,nj->ni", h, motion)
        usual = np.linalg.norm(h, axis=(1, 2)) * np.linalg.norm(motion, axis=1) / np.sqrt(2)
        size = np.ones((len(force), COMPONENTS))
        ratio = usual / np.maximum(np.linalg.norm(force, axis=1), 1e-300)
        size[:, ACROSS] = np.minimum(ratio, _LARGEST)[:, None]
        phase = np.exp(0.5j * np.angle(np.sum(motion**2, axis=1)))[:, None]
        spring, damper = (_directions(part) for part in ((force / phase).real, (force / phase).imag))
        columns = patterns @ np.concatenate([spring, 1j * damper], axis=2) * phase[:, None]
        basis, triangle = np.linalg.qr(np.concatenate([columns.real, columns.imag], axis=1))
        mean = variance.mean(axis=1, keepdims=True)
        excess = np.maximum(variance * size**2, _LEAST * mean) - mean
        covariance = np.eye(COMPONENTS) + (triangle * excess[:, None, :]) @ adjoint(triangle)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        return ForceScatter(basis, triangle, root, size)

    def white(self, rows: FloatArray) -> FloatArray:
        """Rows (n, k, ..) brought to unit variance."""
        move = (self.root - np.eye(COMPONENTS)) @ (adjoint(self.basis) @ rows)
        return rows + self.basis @ move

    def along(self, r: FloatArray, J_h: FloatArray) -> AlongForce:
        """What white rows r (n, k) and their columns J_h (n, k, numbers) have along the components."""
        white = self.root @ self.patterns
        length = np.maximum(np.linalg.norm(white, axis=1), 1e-300)
        rows = adjoint(white / length[:, None]) @ adjoint(self.basis)
        return AlongForce((rows @ r[:, :, None])[:, :, 0] ** 2, (self.size * length) ** 2, rows @ J_h)


def _directions(vectors: FloatArray) -> FloatArray:
    """Unit vectors along and across vectors (n, 2) as columns, (n, 2, 2)."""
    size = np.linalg.norm(vectors, axis=1)
    unit = np.where(size[:, None] > 0, vectors / np.maximum(size, 1e-300)[:, None], [1.0, 0.0])
    return np.stack([unit, np.stack([-unit[:, 1], unit[:, 0]], axis=1)], axis=2)


#: Real force equations of a block.
FORCE_ROWS = 4.0
#: Degrees of freedom that the mean of all components counts as in each of them: simulated with runs that differ in
#: stiffness, in all of H, in gains of the axes or in every number, 3 to 8 directions; 4 leaves stiffness too narrow.
_ALIKE = 1.0
#: Spare equations that tell a scatter, at least.
_LEAST_SPARE = 0.5
#: Distance over its usual size at which a block has no weight.
_NO_WEIGHT = 3.0
#: Probability of chance below which a run of few has no weight.
_IMPROBABLE = 1e-4
#: A block counts as good from this weight on; good runs that a point keeps, at least, and the share of its runs.
_GOOD, _MIN_GOOD, _SHARE = 0.3, 4, 0.7
#: Probability of chance below which a point's runs differ more than the others'.
_CHANCE = 1e-3
#: Smallest reduced chi-square that the others are credited with.
_LEAST_CHI = 0.3
#: Scatter of the force that a good rig has from run to run (oil a little warmer), and the freedom that it counts as.
_USUAL, _USUAL_FREEDOM = 5e-4, 4.0
#: Step from which a point may have a scatter of its own.
_OWN_FROM = 6
#: Leverage of a block, at most, in the judgement of its distance.
_MAX_LEVERAGE = 0.8


@dataclass(frozen=True)
class Residuals:
    """What the solve leaves of the blocks, (n,) each."""

    chi_square: FloatArray
    rows: FloatArray  #: real equations beyond the unknown motion
    leverage: FloatArray  #: share of them that the point's numbers take
    force: FloatArray  #: (n, 4): chi-square of the force equations along every component of the scatter
    information: FloatArray  #: (n, 4): what a scatter of the force of variance one adds to it
    spent: FloatArray  #: (n, 4): degrees of freedom that the point's numbers take of it


@dataclass(frozen=True)
class Scatter:
    """Relative variance of the force from run to run by component, and the blocks' weights."""

    variance: FloatArray  #: (P, 4)
    weights: FloatArray  #: (n,)
    pooled: FloatArray  #: (4,)
    spare: FloatArray  #: (4,): degrees of freedom of the pooled variances
    separate: BoolArray  #: (P,): points with a scatter of their own
    separate_spare: FloatArray  #: (P,): degrees of freedom of a point's own: a run has one fault
    judges: bool = True  #: whether blocks that stand apart lose their weight
    follows: bool = True  #: whether it is found in the solve
    usual: float = _USUAL**2  #: what a good rig has: counts where few runs tell
    together: bool = False  #: whether blocks are judged all together: what they have in common is no point's

    @staticmethod
    def none(points: int, blocks: int) -> Scatter:
        """No scatter, all blocks count."""
        none = np.zeros(points, dtype=bool)
        zero = np.zeros((points, COMPONENTS))
        return Scatter(zero, np.ones(blocks), np.zeros(COMPONENTS), np.zeros(COMPONENTS), none, np.zeros(points))

    def freedom(self, point: int, components: slice) -> float:
        """Degrees of freedom of the mean of some components of a point, Welch and Satterthwaite."""
        if self.separate[point]:
            return max(float(self.separate_spare[point]), 1.0)
        share = self.variance[point, components] / max(self.variance[point, components].sum(), 1e-300)
        degrees = np.maximum(np.minimum(self.spare[components] + _ALIKE, self.spare.sum()), 1.0)
        return float(1 / max(float(np.sum(share**2 / degrees)), 1e-12))

    def fixed(self, groups: int, weights: FloatArray) -> Scatter:
        """Pooled scatter for other groups of the same blocks, with weights (n,); both stay."""
        none, unit = np.zeros(groups, dtype=bool), np.ones(groups)
        variance = np.tile(self.pooled, (groups, 1))
        return Scatter(variance, weights, self.pooled, self.spare, none, unit, judges=False, follows=False)

    def updated(self, group: IntArray, fit: Residuals, solvable: BoolArray, count: int) -> Scatter:
        """Weights after the first step, scatter from the third on.

        `group` (n,): point of every block, `solvable` (P,).
        """
        if not self.follows:
            return self
        weights = self.weights
        if count != 1 and self.judges:
            weights = self._weights(np.zeros_like(group) if self.together else group, fit, solvable[group])
        if count < 3:
            return replace(self, weights=weights)
        points = len(solvable)
        used = weights > 0.05
        # where too few good runs remain all count in full, and nothing has to be made up for
        corrected = np.where(weights < 1.0, weights / _expected(fit.rows), 1.0)
        chi = totals(group, corrected[:, None] * fit.force, points)
        rows = totals(group, used, points)[:, None]
        information = totals(group, corrected[:, None] * fit.information, points)
        spare = np.where(solvable[:, None], rows - totals(group, used[:, None] * fit.spent, points), 0.0)
        usable = (spare > _LEAST_SPARE) & (information > 0)
        gain = np.where(usable, information * spare / np.maximum(rows, 1.0), 1.0)
        unusual = _unusual(
            np.sum(chi * usable, axis=1), np.sum(spare * usable, axis=1), np.asarray(usable.any(axis=1)), self.separate
        )
        pooled, freedom = self._pooled(chi, spare, gain, usable & ~unusual[:, None])
        # weights come to rest before a point's runs are said to differ more than the others'
        separate = unusual if count >= _OWN_FROM else self.separate
        variance = np.tile(pooled, (points, 1))
        excess = _alike(np.maximum(self.variance + np.where(usable, (chi - spare) / gain, 0.0), 0.0), spare)
        variance[separate] = np.maximum(excess[separate], pooled)
        runs = totals(group, used, points)
        separate_spare = np.maximum(runs - 2.0, 1.0)
        return replace(
            self,
            variance=variance,
            weights=weights,
            pooled=pooled,
            spare=freedom,
            separate=separate,
            separate_spare=separate_spare,
        )

    def _pooled(
        self, chi: FloatArray, spare: FloatArray, gain: FloatArray, usable: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """Variances that all points share (4,), by moments, and their degrees of freedom."""
        if not usable.any():
            return np.maximum(self.pooled, self.usual), np.zeros(COMPONENTS)
        freedom, excess, weight = (np.sum(values * usable, axis=0) for values in (spare, chi - spare, gain))
        moment = np.maximum(0.0, self.pooled + excess / np.maximum(weight, 1e-300))
        moment = _alike(moment, freedom)
        # what a good rig has is added where few runs tell: a mean of both would shrink what they show
        usual = _USUAL_FREEDOM / (_USUAL_FREEDOM + freedom.sum()) * self.usual
        return moment + usual, freedom

    def _weights(self, group: IntArray, fit: Residuals, judged: BoolArray) -> FloatArray:
        freedom = fit.rows * (1 - np.minimum(fit.leverage, _MAX_LEVERAGE))
        distance = fit.chi_square / np.maximum(freedom, 1.0)
        usual = max(1.0, np.median(distance[judged])) if judged.any() else 1.0
        points = int(group.max(initial=0)) + 1
        runs = totals(group, np.ones(len(group)), points)
        freedom_of_others = 2 * np.maximum(runs - 2, 0.0).sum()
        # few runs know little of what is usual among them: then only the improbable has no weight
        improbable = float(fdtri(FORCE_ROWS, max(freedom_of_others, 1.0), 1 - _IMPROBABLE))
        limit = max(_NO_WEIGHT**2, improbable)
        weights = np.maximum(1 - distance / usual / limit, 0.0) ** 2
        good = totals(group, weights > _GOOD, points)
        few = good < np.maximum(_MIN_GOOD, _SHARE * runs)
        return np.where(few[group], 1.0, weights)


def _alike(moment: FloatArray, freedom: FloatArray) -> FloatArray:
    """Variances of the components (.., 4) of some freedom, drawn towards their mean."""
    weight = freedom + 1e-9
    mean = np.sum(weight * moment, axis=-1, keepdims=True) / np.sum(weight, axis=-1, keepdims=True)
    return (freedom * moment + _ALIKE * mean) / (freedom + _ALIKE)


def mixed_dof(total: FloatArray, repeat: FloatArray, dof_repeat: float, dof_between: FloatArray) -> FloatArray:
    """Welch-Satterthwaite degrees of freedom of variances made of two parts.

    `total`, `repeat` (8,), `dof_between` (8,).
    """
    between = np.maximum(total - repeat, 0.0)
    spread = repeat**2 / max(dof_repeat, 1.0) + between**2 / dof_between
    with np.errstate(divide="ignore", invalid="ignore"):  # no spread at all: the next line says what then
        dof = total**2 / spread
    return np.where(np.isfinite(dof), np.maximum(dof, 1.0), max(dof_repeat, 1.0))


def _expected(rows: FloatArray) -> FloatArray:
    """Mean of weight times chi-square over its degrees of freedom `rows` (n,), where nothing stands apart."""
    k = np.maximum(rows, 1.0)
    limit = k * _NO_WEIGHT**2
    first = chdtr(k + 2, limit)
    second = (k + 2) * chdtr(k + 4, limit)
    third = (k + 2) * (k + 4) * chdtr(k + 6, limit)
    return first - 2 * second / limit + third / limit**2


def _unusual(chi: FloatArray, spare: FloatArray, usable: BoolArray, before: BoolArray) -> BoolArray:
    """Points (P,) whose chi-square is improbable beside the others', the worst first; those of `before` stay so."""
    separate = before & usable
    for _ in range(int(usable.sum()) // 2):
        usual = usable & ~separate
        if usual.sum() < 2:
            break
        ratio = np.where(usual, chi / np.maximum(spare, 1.0), -1.0)
        worst = np.argmax(ratio)
        remaining = usual.copy()
        remaining[worst] = False
        all_spare = spare[remaining].sum()
        typical = max(chi[remaining].sum() / max(all_spare, 1.0), _LEAST_CHI)
        if float(fdtrc(spare[worst], max(all_spare, 1.0), ratio[worst] / typical)) >= _CHANCE:
            break
        separate[worst] = True
    return separate
