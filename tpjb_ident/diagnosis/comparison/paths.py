"""Paths: what every fault does to the prediction over all sizes that a rig may have, laid once per campaign."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.comparison.unknowns import Place, derivatives, path_changes
from tpjb_ident.diagnosis.forward.workers import Map

#: A typical size in widths of the prior.
_NEAR = 1.0 / 3.0
#: Amplitudes of a path at which a score is asked for.
_POINTS = 41


@dataclass(frozen=True)
class Path:
    """Change of the prediction by one fault: cubic pieces along one amplitude, or straight columns for several.

    Pieces that rise where their ends rise (Fritsch & Carlson, SIAM J. Numer. Anal. 17 (1980) 238): a pad that comes out
    of contact lets K and C jump, at another amplitude for every load, and one polynomial through all of it is wrong
    everywhere.
    """

    fault: Fault
    columns: FloatArray = field(repr=False)  #: (n, c): straight ones, or changes at the nodes, then derivatives there
    nodes: FloatArray | None = field(default=None, repr=False)  #: amplitudes that the model was asked at; rising

    @functools.cached_property
    def pieces(self) -> CubicHermiteSpline:
        """Weights of the columns between the nodes."""
        return CubicHermiteSpline(self.nodes, *np.split(np.eye(self.columns.shape[1]), 2))

    def _inside(self, amplitudes: FloatArray, nodes: FloatArray) -> FloatArray:
        """The first amplitude of each, between the ends: beyond them a path goes on straight, (t,)."""
        return np.clip(amplitudes[:, 0], nodes[0], nodes[-1])

    def weights(self, amplitudes: FloatArray) -> FloatArray:
        """Of the columns in the change at amplitudes (t, k), (t, c)."""
        if self.nodes is None:
            return amplitudes
        inside = self._inside(amplitudes, self.nodes)
        excess = amplitudes - inside[:, None]
        return np.asarray(self.pieces(inside) + excess * self.pieces(inside, 1))

    def slopes(self, amplitudes: FloatArray) -> FloatArray:
        """Of the columns in the derivatives at amplitudes (t, k), (t, c, k)."""
        if self.nodes is None:
            return np.tile(np.eye(amplitudes.shape[1]), (len(amplitudes), 1, 1))
        return np.asarray(self.pieces(self._inside(amplitudes, self.nodes), 1)[:, :, None])

    @property
    def neutral_slope(self) -> FloatArray:
        """Derivatives where nothing happens yet, (n, k)."""
        return np.asarray(self.columns @ self.slopes(np.zeros((1, len(self.fault.width))))[0])

    def tried(self, pull: FloatArray, square: FloatArray) -> FloatArray:
        """Amplitudes to look at, (t, k): a grid, or the likeliest ones of straight columns.

        `pull` (c,) and `square` (c, c): columns' products with the residual and with each other.
        """
        _, width, low, high = self.fault.prior
        if self.nodes is not None:
            return np.linspace(np.maximum(low, -width), np.minimum(high, width), _POINTS)
        return np.clip(np.linalg.solve(square + np.diag(1.0 / width**2), pull), low, high)[None, :]


def lay_paths(run: Map, problem: Problem) -> tuple[Path, ...]:
    """Lay the path of every fault to a typical size on one side; one pad's or sensor's own number is known straight.

    Those without an equilibrium anywhere are left out.
    """
    baseline = np.zeros(len(problem.nuisances))
    curved = [f for f in problem.faults if len(f.width) == 1]
    straight = [f for f in problem.faults if f not in curved]
    columns = problem.scaled(problem.columns)
    towards = np.sign(columns.T @ (problem.measured - problem.scaled(problem.base)))
    begun, sizes = [], []
    for fault in curved:
        if fault.own < 0:
            path, side = Path(fault, columns[:, :0], np.zeros(1)), 1.0
        else:
            path = path_through(fault, [(1.0, columns[:, fault.own])])
            # what a number of the whole bearing does bends, and straight on it misleads
            side = 0.0 if problem.nuisances[fault.own].place else float(towards[fault.own])
        begun.append(path)
        sizes.append(side * _NEAR * float(fault.width[0]))
    paths = [path for path in lengthened(run, ((), baseline), begun, sizes, 1) if path.columns.size]
    jobs = [((f,), np.append(np.zeros(len(f.width)), baseline), tuple(range(len(f.width)))) for f in straight]
    for fault, derived in zip(straight, run(derivatives, jobs), strict=True):
        valid = [column for column in derived if column is not None]
        if len(valid) == len(fault.width):
            paths.append(Path(fault, np.column_stack(valid)))
    return tuple(paths)


def _wanted(fault: Fault, size: float) -> list[float]:
    """Typical amplitudes on both sides as far as bounds allow, and the end towards which a size goes beyond them.

    With the middle: at its end, a bound perhaps, an effect is extreme, and the piece before it would follow that.
    """
    _, width, low, high = fault.prior[:, 0].tolist()
    side = math.copysign(width, size)
    near, back, end = np.clip([_NEAR * side, -_NEAR * side, side], low, high).tolist()
    outer = [0.5 * (near + end), end] if abs(size) > _NEAR * width else []
    return [node for node in dict.fromkeys([near, back, *outer]) if node]


def lengthened(
    run: Map, place: Place, paths: Sequence[Path], sizes: Sequence[float], most: int = 9
) -> tuple[Path, ...]:
    """Paths from a place with what a size asks for: typical sizes on both sides, and the end beyond; 0: as it is.

    What is known of a path counts from the baseline, and not from another place.
    """
    out, asked = list(paths), []
    for i, (path, size) in enumerate(zip(paths, sizes, strict=True)):
        if size and path.nodes is not None:
            changes = {} if place[0] else {node: path.columns[:, k] for k, node in enumerate(path.nodes) if node}
            nodes = [node for node in _wanted(path.fault, size) if node not in changes]
            asked.append((i, changes, (path.fault, nodes)))
    parts = [asked[k :: run.opened.count] for k in range(run.opened.count)]
    jobs = []
    for part in parts:
        jobs.append((place, [job for _, _, job in part], most))
    for part, rows in zip(parts, run(path_changes, jobs), strict=True):
        for (i, changes, (fault, _)), row in zip(part, rows, strict=True):
            if changes or row:
                out[i] = path_through(fault, [*changes.items(), *row])
    return tuple(out)


def path_through(fault: Fault, changes: Sequence[tuple[float, FloatArray]]) -> Path:
    """Lay a path through what the model said at some amplitudes, counted from the neutral one; changes (n,) each."""
    rows = sorted([(0.0, np.zeros_like(changes[0][1])), *changes], key=lambda row: row[0])
    nodes, values = np.array([node for node, _ in rows]), np.array([change for _, change in rows])
    return Path(fault, np.hstack([values.T, PchipInterpolator(nodes, values, axis=0).derivative()(nodes).T]), nodes)
