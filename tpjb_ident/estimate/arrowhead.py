"""Normal equations of an arrow: numbers of every point, bordered by the parameters that all points share.

A point's numbers x_p are those of its H and the parameters of terms that are its own. With A_p = J_p^T J_p,
E_p = J_p^T J_t, g_p = J_p^T r summed over a point's blocks (the prior of its own parameters added),
G = J_t^T J_t + Lambda and g = J_t^T r + Lambda (theta_0 - theta) over all blocks::

    S = G - sum_p E_p^T A_p^-1 E_p          d_theta = S^-1 (g - sum_p E_p^T A_p^-1 g_p)
    K_p = -A_p^-1 E_p                       d_x_p = A_p^-1 (g_p - E_p d_theta)
    Cov(theta) = S^-1                       Cov(x_p, x_q) = delta_pq A_p^-1 + K_p S^-1 K_q^T

Time and memory are linear in the points: what one point's own parameter does to another goes through the border, and
is kept as its two factors.

A parameter of which the records tell little (posterior deviation above 0.8 of the prior's) is considered, not
estimated: its value stays, its prior passes into the covariance. Estimated, it would be moved by what the model of the
others leaves out.

A point's numbers may hang on those of its group. K-C, h = K + i omega C, and K-C-M, h = K - omega^2 M + i omega C,
hold for all lines of a load together; a part of a band shares one departure from such a model. Sines, lines of a
multi-sine and of a transform take part alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.estimate.equation import adjoint
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.term import Fitted

#: Posterior over prior deviation above which a parameter is considered.
CONSIDERED = 0.8
#: Smallest eigenvalue of a point's equations, scaled to a diagonal of ones, that tells its numbers apart.
_TOLD = 1e-13
#: Weight that holds a considered number of a point at its mean, over its own.
_HELD = 1e14
#: Numbers of a point: real and imaginary parts of h_xx, h_xy, h_yx, h_yy.
NUMBERS = 8


@dataclass(frozen=True)
class Prior:
    """What is known of parameters beforehand: (q,) of those that all share, (P, L) of those of every point."""

    distance: FloatArray  #: prior mean minus value
    precision: FloatArray  #: Lambda
    always: BoolArray  #: estimated however little the records tell
    never: BoolArray  #: considered whatever they seem to tell: what the equations leave out is no evidence

    def estimated(self, posterior: FloatArray) -> BoolArray:
        """Which are estimated, by their posterior variance if all were."""
        is_learnt = np.sqrt(np.abs(posterior) * self.precision) < CONSIDERED
        return (is_learnt | self.always) & ~self.never


@dataclass
class Sums:
    """Sums of the normal equations over blocks, P points and q shared parameters, without the priors."""

    A: FloatArray  #: (P, n, n), n numbers a point: of H, eight or those of a model over frequency, then L of its own
    E: FloatArray  #: (P, n, q)
    g_h: FloatArray  #: (P, n)
    G: FloatArray  #: (q, q)
    g_t: FloatArray  #: (q,)

    @staticmethod
    def empty(points: int, parameters: int, numbers: int = NUMBERS) -> Sums:
        """All zero."""
        return Sums(
            np.zeros((points, numbers, numbers)),
            np.zeros((points, numbers, parameters)),
            np.zeros((points, numbers)),
            np.zeros((parameters, parameters)),
            np.zeros(parameters),
        )

    def add(self, point: IntArray, weight: FloatArray, r: FloatArray, J: FloatArray, J_t: FloatArray) -> None:
        """Add rows of blocks: `point`, root of the `weight` (n,), `r` (n, k), `J` (n, k, numbers), `J_t` (n, k, q)."""
        r, J, J_t = r * weight[:, None], J * weight[:, None, None], J_t * weight[:, None, None]
        transposed = adjoint(J)
        np.add.at(self.A, point, transposed @ J)
        np.add.at(self.E, point, transposed @ J_t)
        np.add.at(self.g_h, point, np.einsum("nka,nk->na", J, r))
        flat = J_t.reshape(J_t.shape[0] * J_t.shape[1], J_t.shape[2])
        self.G += flat.T @ flat
        self.g_t += flat.T @ r.reshape(-1)

    def drop(self, points: BoolArray, numbers: int) -> None:
        """Leave points (P,) out that have no answer, `numbers` of H each."""
        self.A[points], self.E[points], self.g_h[points] = 0.0, 0.0, 0.0
        self.A[points, :numbers, :numbers] = np.eye(numbers)


def are_told(A: FloatArray) -> BoolArray:
    """Whether the equations of points (P, 8, 8) determine their numbers, (P,)."""
    size = np.sqrt(np.maximum(np.einsum("paa->pa", A), 1e-300))
    scaled = A / (size[:, :, None] * size[:, None, :])
    return np.linalg.eigvalsh(scaled)[:, 0] > _TOLD


@dataclass(frozen=True, repr=False)
class Own:
    """Parameters of every point alone, and what one standard deviation of their priors does."""

    change: FloatArray  #: (P, L): of their values in the step
    deviation: FloatArray  #: (P, L): posterior
    estimated: BoolArray  #: (P, L)
    direct: FloatArray  #: (P, k, L): to the point's numbers of H
    shared: FloatArray  #: (P, q, L): to the shared parameters, and through them to all points


@dataclass(frozen=True, repr=False)
class Step:
    """One step of the solve, and the covariances that go with it; k numbers of H a point."""

    h: FloatArray  #: (P, k)
    theta: FloatArray  #: (q,)
    by_point: Own
    records: FloatArray  #: (P, k, k): that the records leave, the learning of parameters included
    K: FloatArray  #: (P, k, q)
    S: FloatArray  #: (q, q)
    S_inverse: FloatArray  #: (q, q): zero in rows and columns of considered parameters
    estimated: BoolArray  #: (q,)
    precision: FloatArray  #: (q,): Lambda
    joint: FloatArray  #: (q,): distance of the shared parameters from their means, were all estimated
    joint_covariance: FloatArray  #: (q, q)

    def factors(self) -> FloatArray:
        """One standard deviation of every shared parameter's prior, as it moves all points together, (q, P, k)."""
        moved = np.einsum("pak,kq->qpa", self.K, self.S_inverse) * np.sqrt(self.precision)[:, None, None]
        considered = np.flatnonzero(~self.estimated)
        if len(considered):
            through = self.S_inverse @ self.S[:, considered]
            passed = self.K[:, :, considered] - self.K @ through
            moved[considered] = passed.transpose(2, 0, 1) / np.sqrt(self.precision[considered])[:, None, None]
        return moved

    def point_share(self, chosen: BoolArray) -> FloatArray:
        """Covariance (P, k, k) by the priors of the points' own parameters `chosen` (P, L), of all points."""
        local, shared = (part * chosen[:, None, :] for part in (self.by_point.direct, self.by_point.shared))
        across = local @ adjoint(shared) @ adjoint(self.K)
        everywhere = np.einsum("pql,prl->qr", shared, shared)
        through = self.K @ everywhere @ adjoint(self.K)
        return local @ adjoint(local) + across + adjoint(across) + through

    @property
    def deviation(self) -> FloatArray:
        """Posterior standard deviation of every shared parameter, (q,)."""
        posterior = np.sqrt(np.maximum(np.diag(self.S_inverse), 0.0))
        return np.where(self.estimated, posterior, 1 / np.sqrt(self.precision))


def step(sums: Sums, shared: Prior, by_point: Prior) -> Step:
    """Solve the normal equations; the points' own parameters are the last of their numbers."""
    k = sums.A.shape[1] - by_point.precision.shape[1]
    A, g = sums.A.copy(), sums.g_h.copy()
    last = np.arange(k, A.shape[1])
    A[:, last, last] += by_point.precision
    g[:, k:] += by_point.precision * by_point.distance
    G = sums.G + np.diag(shared.precision)
    A_inverse, K, S = _eliminated(A, sums.E, G)
    inverse = np.asarray(np.linalg.inv(S), dtype=float)
    estimated = shared.estimated(np.diag(inverse))
    # from the means: what is considered stands there
    score = sums.g_t + shared.precision * shared.distance + np.einsum("pak,pa->k", K, g) - S @ shared.distance
    joint = inverse @ score, inverse
    is_learnt = by_point.estimated(_variances(A_inverse, K, inverse)[:, k:])
    # what is considered is held at its mean; what it would move is kept apart
    moves, moves_shared = (A[:, :, k:] * ~is_learnt[:, None, :], adjoint(sums.E[:, k:] * ~is_learnt[:, :, None]))
    held = _HELD * A[:, last, last] * ~is_learnt
    A[:, last, last] += held
    g[:, k:] += held * by_point.distance
    A_inverse, K, S = _eliminated(A, sums.E, G)
    S_inverse = np.zeros_like(S)
    chosen = np.ix_(estimated, estimated)
    S_inverse[chosen] = np.linalg.inv(S[chosen])
    g_t = sums.g_t + shared.precision * shared.distance + np.einsum("pak,pa->k", K, g)
    remaining = g_t - S[:, ~estimated] @ shared.distance[~estimated]
    theta = S_inverse @ (estimated * remaining) + np.where(estimated, 0.0, shared.distance)
    x = np.einsum("pab,pb->pa", A_inverse, g) + K @ theta
    posterior = np.sqrt(np.maximum(_variances(A_inverse, K, S_inverse)[:, k:], 0.0))
    root = np.sqrt(by_point.precision)
    pushes = -(moves_shared + adjoint(K) @ moves)
    points = Own(
        x[:, k:],
        np.where(is_learnt, posterior, 1 / root),
        is_learnt,
        _by_prior(is_learnt, A_inverse[:, :k, k:], -(A_inverse @ moves)[:, :k], root),
        S_inverse @ _by_prior(is_learnt, adjoint(K[:, k:]), pushes, root),
    )
    weight = np.concatenate([np.zeros((len(A), k)), by_point.precision * is_learnt], axis=1)
    records = _records(A_inverse, K, S, S_inverse, weight, shared.precision)[:, :k, :k]
    return Step(x[:, :k], theta, points, records, K[:, :k], S, S_inverse, estimated, shared.precision, *joint)


def _by_prior(is_learnt: BoolArray, learnt: FloatArray, passed: FloatArray, root: FloatArray) -> FloatArray:
    """Changes (P, .., L) by one standard deviation of estimated and considered priors; `root` (P, L) of precision."""
    scale = root[:, None, :]
    return np.where(is_learnt[:, None, :], learnt * scale, passed / scale)


def _eliminated(A: FloatArray, E: FloatArray, G: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Inverse of A, K, and S: the border without the points.

    By the points' Cholesky factors: an explicit inverse would lose what S keeps beside G where priors are wide.
    """
    n = A.shape[1]
    white = np.linalg.solve(_root(A), np.concatenate([E, np.broadcast_to(np.eye(n), A.shape)], axis=2))
    E_white, back = np.split(white, [E.shape[2]], axis=2)
    A_inverse = adjoint(back) @ back
    flat = E_white.reshape(len(A) * n, E.shape[2])
    K = -adjoint(back) @ E_white
    return A_inverse, K, G - flat.T @ flat


def _root(A: FloatArray) -> FloatArray:
    """Cholesky factors; where one has none, a point whose weights left it at the edge of what is told, with a ridge."""
    try:
        return np.asarray(np.linalg.cholesky(A), dtype=float)
    except np.linalg.LinAlgError:
        ridge = _TOLD * np.einsum("paa->pa", A)[:, :, None] * np.eye(A.shape[1])
        return np.linalg.cholesky(A + ridge)


def _records(
    A_inverse: FloatArray, K: FloatArray, S: FloatArray, S_inverse: FloatArray, by_point: FloatArray, shared: FloatArray
) -> FloatArray:
    """Covariance (P, n, n) that the records alone leave; `own` (P, n), `shared` (q,) precision of the priors.

    As products throughout: differences of what wide priors leave would lose the records' share.
    """
    weighed = by_point[:, :, None] * K
    learnt = S_inverse @ (S - np.diag(shared) - np.einsum("pak,pal->kl", K, weighed)) @ S_inverse
    alone = A_inverse - A_inverse @ (by_point[:, :, None] * A_inverse)
    across = A_inverse @ weighed @ S_inverse @ adjoint(K)
    return alone + K @ learnt @ adjoint(K) - across - adjoint(across)


def _variances(A_inverse: FloatArray, K: FloatArray, S_inverse: FloatArray) -> FloatArray:
    """Variances of the points' numbers, (P, n)."""
    return np.einsum("paa->pa", A_inverse) + np.einsum("pak,pak->pa", K @ S_inverse, K)


#: Matrices of a model over frequency, four numbers each.
MODELS = {"K-C": 2, "K-C-M": 3}


@dataclass(frozen=True)
class Shape:
    """H = start + columns x for P points in G groups, x the k numbers of a group."""

    group: IntArray  #: (P,): group of every point
    columns: FloatArray | None = None  #: (P, 8, k); None: x is h itself
    count: int = 0  #: groups at least: the last may have no point
    scatter: Scatter | None = None  #: to begin with; None: none, and blocks are judged
    held: Mapping[str, Fitted] = field(default_factory=dict)  #: terms by name, as another solve left them

    @property
    def groups(self) -> int:
        """Number of groups."""
        return max(self.count, int(self.group.max(initial=-1)) + 1)

    @property
    def numbers(self) -> int:
        """Unknowns of a group."""
        return NUMBERS if self.columns is None else self.columns.shape[2]

    def mapped(self, J_h: FloatArray, point: IntArray) -> FloatArray:
        """Columns of the group's numbers (n, rows, k) from those of h (n, rows, 8); `point` (n,)."""
        return J_h if self.columns is None else J_h @ self.columns[point]

    def change(self, x: FloatArray) -> ComplexArray:
        """Change of h (P, 2, 2) by the groups' numbers (G, k)."""
        parts = x[self.group]
        numbers = parts if self.columns is None else np.einsum("pak,pk->pa", self.columns, parts)
        return complex_matrix(numbers)


def complex_matrix(numbers: FloatArray) -> ComplexArray:
    """H (.., 2, 2) of its eight numbers (.., 8)."""
    h = numbers[..., :4] + 1j * numbers[..., 4:]
    return h.reshape(*numbers.shape[:-1], 2, 2)


def real_numbers(h: ComplexArray) -> FloatArray:
    """The eight numbers (.., 8) of H (.., 2, 2)."""
    flat = h.reshape(*h.shape[:-2], 4)
    return np.concatenate([flat.real, flat.imag], axis=-1)


def power_columns(w: FloatArray, count: int) -> FloatArray:
    """Change of the eight numbers of h = K + i w C + (i w)^2 M + .. by the entries of each matrix, (n, 8, 4 count)."""
    powers = (1j * w)[:, None] ** np.arange(count)
    parts = np.stack([powers.real, powers.imag], axis=1)
    return np.einsum("npk,ab->npakb", parts, np.eye(4)).reshape(len(w), NUMBERS, 4 * count)


def remainder(columns: FloatArray, values: FloatArray, root: FloatArray, used: BoolArray | slice) -> FloatArray:
    """What a model, fitted to some of n points, leaves of c sets of numbers of all of them, (n, 8, c).

    `columns` (n, 8, k), `values` (n, 8, c), both weighed by `root` (n, 8, 8), `used` (n,).
    """
    design, rows = root @ columns, root @ values
    return rows - design @ least_squares(design[used], rows[used])


def least_squares(columns: FloatArray, rows: FloatArray) -> FloatArray:
    """Numbers (k, ..) by which columns (n, 8, k) come nearest to rows (n, 8, ..)."""
    k, several = columns.shape[2], rows.shape[2:]
    return np.asarray(np.linalg.lstsq(columns.reshape(-1, k), rows.reshape(-1, *several), rcond=None)[0])


def free_force(D: ComplexArray, F: ComplexArray) -> tuple[Shape, ComplexArray]:
    """A force (4 numbers) of the film for every point by itself, and H to start from: the rig is told of no film.

    `D`, `F` (P, 2): what the points' only runs show [m], [N]; NaN where they show nothing.
    """
    usable = np.isfinite(np.concatenate([D, F], axis=1)).all(axis=1)
    shown = np.where(usable[:, None], D, 1.0)
    size = np.maximum(np.linalg.norm(shown, axis=1), 1e-300)[:, None]
    across = shown.conj() / size
    start = np.where(usable[:, None, None], F[:, :, None] * (across / size)[:, None, :], np.nan)
    forces = np.array([[1.0, 0.0], [0.0, 1.0], [1j, 0.0], [0.0, 1j]])
    columns = np.stack([real_numbers(force[:, None] * across[:, None, :]) for force in forces], axis=2)
    return Shape(np.arange(len(D)), columns), start
