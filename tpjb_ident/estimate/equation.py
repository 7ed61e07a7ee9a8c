"""The measurement equation z = T B(h) u: what probes, cells, accelerometers and the housing make of the true motion.

Rows are the sensors and two equations of the housing; columns the true displacement d and the housing's acceleration a,
free in every block::

    probe j           (  n_j^T       ,  0         )
    cell j            (  n_j^T h     , -m n_j^T   )       F_cell = F_oil - m a, Eq. (13); h with the bare rig's
    accelerometer j   (  0           ,  n_j^T     )
    housing, cells    (  w^2 C h     ,  I - w^2 m C )     a + w^2 C F_cell = 0: it stands on its cells
    housing, floating (-w^2 (kappa + C h), I      )       a = w^2 d: it hangs, and the shaft gives way by C

With C the compliance of the cells, [c_xx c_xy; c_xy c_yy] (1 - i loss), or of the shaft under a floating housing, whose
kappa is one but for wrong sensors. Where no accelerometer tells and the manifest does not say, kappa is not known: 0 of
a housing that stands still, 1 of one that floats.
"""

from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Rig

#: Equations of the housing.
HOUSING_ROWS = 2
#: Unknowns of a block: d and a, X and Y each.
UNKNOWNS = 4


@dataclass
class State:
    """The last iterate of the solve, for one set of blocks (n of them, m sensors, P points)."""

    h: ComplexArray  #: (P, 2, 2), N/m: at the set points
    slope: ComplexArray  #: (P, 2, 2), N/m: dH / d ln W
    slope_known: np.ndarray  #: (P,) bool
    compliance: ComplexArray  #: (2, 2), m/N: of the cells under the housing, or of a floating one's shaft
    floating: ComplexArray  #: (2, 2): kappa
    factor: ComplexArray  #: (n, m): T
    shift: ComplexArray  #: (n, m + 2): s, what does not go with the motion
    u: ComplexArray  #: (n, 4): true motion
    bare: ComplexArray  #: (n, 2, 2), N/m: the rig beside the film
    parameters: dict[str, FloatArray] = field(default_factory=dict)  #: by term

    def at_run(self, blocks: Blocks) -> ComplexArray:
        """H of every block at its run's own load, what the rig carries beside the film with it, (n, 2, 2)."""
        known = self.slope_known[blocks.point][:, None, None]
        change = blocks.miss.real[:, None, None] * self.slope[blocks.point]
        return self.h[blocks.point] + np.where(known, change, 0.0) + self.bare

    def reading(self, rig: Rig, blocks: Blocks) -> ComplexArray:
        """T B u, (n, m + 2)."""
        return np.einsum("nri,ni->nr", with_factor(self.factor, motion_matrix(rig, blocks, self)), self.u)


def motion_matrix(rig: Rig, blocks: Blocks, state: State) -> ComplexArray:
    """B of every block, (n, m + 2, 4)."""
    n, m = blocks.z.shape
    B = np.zeros((n, m + HOUSING_ROWS, UNKNOWNS), complex)
    h, along = state.at_run(blocks), blocks.along
    probes, cells, accelerometers = (rig.of(q) for q in ("displacement", "force", "acceleration"))
    B[:, probes, :2] = along[:, probes]
    B[:, cells, :2] = along[:, cells] @ h
    B[:, cells, 2:] = -rig.mass * along[:, cells]
    B[:, accelerometers, 2:] = along[:, accelerometers]
    B[:, m:] = housing_rows(rig, blocks, state, h)
    B[:, :m][~blocks.present] = 0.0
    return B


def housing_rows(rig: Rig, blocks: Blocks, state: State, h: ComplexArray) -> ComplexArray:
    """Rows of the housing, (n, 2, 4); `h` (n, 2, 2) of the runs."""
    square = (blocks.omega**2)[:, None, None]
    if rig.mount == "cells":
        moved, own = square * (state.compliance @ h), square * rig.mass * state.compliance
    else:
        moved, own = -square * (state.floating + state.compliance @ h), np.zeros_like(h)
    return np.concatenate([moved, np.eye(2) - own], axis=2)


def with_factor(factor: ComplexArray, B: ComplexArray) -> ComplexArray:
    """T B; `factor` (n, m) on the sensors' rows of B (n, m + 2, ..)."""
    result = B.copy()
    m = factor.shape[1]
    result[:, :m] *= factor.reshape(factor.shape + (1,) * (B.ndim - 2))
    return result


def film_columns(rig: Rig, blocks: Blocks, state: State) -> ComplexArray:
    """d(T B u) / d(h_xx, h_xy, h_yx, h_yy), complex, (n, m + 2, 4): h at the set point moves h at the run's load."""
    n = len(blocks)
    h = state.h[blocks.point]
    known = blocks.miss.real * state.slope_known[blocks.point]
    size = np.where(h.real == 0.0, 1.0, h.real)
    power = np.clip(state.slope[blocks.point].real / size, -2.0, 2.0)
    growth = 1 + known[:, None, None] * power
    return film_change_rows(rig, blocks, state, entry_changes(growth.reshape(n, 4)))


def entry_changes(size: ComplexArray | FloatArray) -> ComplexArray:
    """Changes of H by single entries xx, xy, yx, yy, over and over, `size` (n, k) each, (n, k, 2, 2)."""
    entries = np.tile(np.eye(4).reshape(4, 2, 2), (size.shape[1] // 4, 1, 1))
    return np.asarray(size[:, :, None, None] * entries, complex)


def entry_sizes(h: ComplexArray) -> ComplexArray:
    """Sizes of the eight numbers of H (n, 2, 2), those of Im h times i, (n, 8)."""
    return np.concatenate([np.abs(h.real), 1j * np.abs(h.imag)], axis=1).reshape(len(h), 8)


def film_change_rows(rig: Rig, blocks: Blocks, state: State, changes: ComplexArray) -> ComplexArray:
    """Changes of H (n, k, 2, 2) in the readings, by their forces at the motion, (n, m + 2, k)."""
    return film_force_rows(rig, blocks, state, np.einsum("nkij,nj->nik", changes, state.u[:, :2]))


def film_force_rows(rig: Rig, blocks: Blocks, state: State, force: ComplexArray) -> ComplexArray:
    """Forces of the film (n, 2, ..) as the cells read them and the housing answers, (n, m + 2, ..)."""
    n, m = blocks.z.shape
    rows = np.zeros((n, m + HOUSING_ROWS, *force.shape[2:]), complex)
    cells = rig.of("force")
    seen = blocks.along[:, cells] * (state.factor * blocks.present)[:, cells, None]
    rows[:, cells] = np.einsum("nja,na...->nj...", seen, force)
    square = (blocks.omega**2).reshape((-1,) + (1,) * (force.ndim - 1))
    sign = 1.0 if rig.mount == "cells" else -1.0
    rows[:, m:] = sign * square * np.einsum("ij,nj...->ni...", state.compliance, force)
    return rows
