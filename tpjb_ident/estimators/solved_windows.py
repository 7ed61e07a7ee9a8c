"""The default method on windows alone: the campaign's own solve, for a single operating point.

The windows of a direction become one block with the covariance of its noise. Noise of the displacements cannot pull H
towards zero there, directions that differ by more than their repeats show as scatter, and one that stands apart from
the others loses its weight: `tpjb_ident.estimate.solve`, without terms.
"""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.estimate.arrowhead import Shape
from tpjb_ident.estimate.equation import Rig, Sensor, stacked
from tpjb_ident.estimate.noise import unbiased_noise
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.solve import Solver
from tpjb_ident.estimate.window_means import Readings, attenuation, window_means
from tpjb_ident.estimators.r_matrix import PhasorTable, TableFit

#: Fewer spare repeats than this cannot give a 4x4 complex covariance worth using.
_MIN_SPARE_REPEATS = 8.0
#: Rows of a table: displacement and force along X and Y, straight, without uncertainty.
_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
_QUANTITIES = ("displacement", "displacement", "force", "force")
_RIG = Rig(tuple(Sensor(quantity, quantity) for quantity in _QUANTITIES), mass=0.0, mount="unknown")


def solved_windows(table: PhasorTable, start: ComplexArray, weights: FloatArray) -> TableFit | None:
    """Solve from a start of H (2, 2) with window weights (n,); None where repeats are too few for a noise."""
    z = np.concatenate([table.D, table.F], axis=1)
    present = np.ones((table.n_directions, 4), dtype=bool)
    # a table has no times: its windows tell of no drift, nor what of their scatter is motion
    means = window_means(z, table.direction, np.zeros(len(z)), Readings([""] * 4, np.zeros((4, 4))), weights, present)
    if means is None or means.spare < _MIN_SPARE_REPEATS:
        return None
    noise = unbiased_noise(means.noise, means.spare)
    rows: list[dict[str, object]] = []  # a block a direction that has windows
    for g in np.flatnonzero(means.count > 0):
        row = {"run": g, "omega": 1.0, "z": means.mean[g], "noise": noise / means.count[g], "dof": means.spare}
        rows.append(row | {"present": np.ones(4, dtype=bool), "along": _AXES})
    names = [str(g) for g in range(len(means.count))]
    blocks = stacked([OperatingPoint(0.0, excitation=1.0)], names, 4, rows)
    # what scatter a good rig has is not asked: a table may be computed
    shape = Shape(np.zeros(1, dtype=np.intp), scatter=replace(Scatter.none(1, len(blocks)), usual=0.0))
    solution = Solver(_RIG, blocks, (), start[None], shape).run()
    if not np.isfinite(solution.h).all():
        return None
    run_weights = np.zeros(table.n_directions)
    run_weights[blocks.run] = solution.scatter.weights
    return TableFit(
        solution.h[0],
        means.weights * run_weights[table.direction],
        solution.records[0],
        solution.freedom(0),
        not_locked(means.wandering, table.n_directions),
        float(solution.chi_square[0]),
        attenuation(means.mean[:, :2], means.count, means.noise[:2, :2]),
    )


def not_locked(wandering: int, directions: int) -> tuple[Condition, ...]:
    """Say in how many directions the drive's phase wanders."""
    text = f"drive phase wanders in {wandering} of {directions} directions; their windows were turned to one phase"
    return holding((wandering, "drive-not-locked", text))
