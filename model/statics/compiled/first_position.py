"""Where the journal stands on tabulated isothermal films: the first guess of the equilibrium."""

from __future__ import annotations

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.loaded_attitude import Branch
from rigdata.arrays import FloatArray, IntArray

#: Share of the load that may be missing.
_GOOD_ENOUGH = 0.002


def first_position(load: FloatArray, normals: FloatArray, distances: FloatArray, branches: list[Branch]) -> FloatArray:
    """Journal position that balances a load on tabulated isothermal films.

    `load` (2,) [N], `normals` (n_pads, 2), `distances` (n_pads,) [m]; gives (2,) [m].
    """
    longest = max(len(b.rigid_approach) for b in branches)
    curves = np.full((len(branches), 2, longest), math.nan)
    for row, branch in zip(curves, branches, strict=True):
        row[0, : len(branch.rigid_approach)] = branch.rigid_approach
        row[1, : len(branch.load)] = branch.load
    lengths = np.array([len(b.rigid_approach) for b in branches])
    room = min(float(b.approach[-1]) - g for b, g in zip(branches, distances, strict=True))
    pads = np.column_stack([normals, distances])
    return balance(np.asarray(load, float), pads, curves[:, 0], curves[:, 1], lengths, room)


@compiled
def balance(
    load: FloatArray, pads: FloatArray, rigid: FloatArray, carried: FloatArray, lengths: IntArray, room: float
) -> FloatArray:
    """Journal position [m] that balances a load on tabulated films.

    `load` (2,) [N], `pads` (n, 3) [m], `rigid, carried` (n, r) [m], `lengths` (n,).
    """
    size = math.hypot(load[0], load[1])
    position = np.zeros(2)
    if size == 0.0:
        return position
    curves = (pads, rigid, carried, lengths)
    x, y = load[0] / size * 0.4 * room, load[1] / size * 0.4 * room
    fx, fy = _missing(x, y, load, curves)
    error = math.hypot(fx, fy)
    step = 1e-4 * room
    for _ in range(60):
        if error < _GOOD_ENOUGH * size:
            break
        ax, ay = _missing(x + step, y, load, curves)
        bx, by = _missing(x - step, y, load, curves)
        cx, cy = _missing(x, y + step, load, curves)
        dx, dy = _missing(x, y - step, load, curves)
        jxx, jyx = (bx - ax) / (2 * step), (by - ay) / (2 * step)
        jxy, jyy = (dx - cx) / (2 * step), (dy - cy) / (2 * step)
        det = jxx * jyy - jxy * jyx
        if abs(det) <= 1e-9 * (jxx**2 + jxy**2 + jyx**2 + jyy**2):
            # nothing carries in some direction: go where the load pushes
            mx, my = 0.1 * room * fx / error, 0.1 * room * fy / error
        else:
            mx, my = (fx * jyy - jxy * fy) / det, (jxx * fy - jyx * fx) / det
            share = min(1.0, 0.2 * room / max(math.hypot(mx, my), 1e-30))
            mx, my = share * mx, share * my
        for halving in range(8):  # a pad that takes up or sheds its load on the way bends the force sharply
            tx, ty = x + mx * 0.5**halving, y + my * 0.5**halving
            gx, gy = _missing(tx, ty, load, curves)
            left = math.hypot(gx, gy)
            if left < error or halving == 7:
                x, y, fx, fy, error = tx, ty, gx, gy, left
                break
    position[0], position[1] = x, y
    return position


@inner
def _missing(
    x: float, y: float, load: FloatArray, curves: tuple[FloatArray, FloatArray, FloatArray, IntArray]
) -> tuple[float, float]:
    """Part of the load that the tabulated films do not carry at a position."""
    pads, rigid, carried, lengths = curves
    fx, fy = load[0], load[1]
    for m in range(pads.shape[0]):
        at = pads[m, 2] + pads[m, 0] * x + pads[m, 1] * y
        if at < rigid[m, 0]:
            continue
        low, high = 0, lengths[m] - 1  # beyond the end: the last slope
        while high - low > 1:
            middle = (low + high) // 2
            if rigid[m, middle] < at:
                low = middle
            else:
                high = middle
        slope = (carried[m, high] - carried[m, low]) / (rigid[m, high] - rigid[m, low])
        force = carried[m, low] + slope * (at - rigid[m, low])
        fx -= pads[m, 0] * force
        fy -= pads[m, 1] * force
    return fx, fy
