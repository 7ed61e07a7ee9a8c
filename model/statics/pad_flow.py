"""What enters and leaves the film of a pad: flows, side leakage, temperatures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.arrays import BoolArray, FloatArray
from model.bearing import Oil
from model.film.mesh import FilmWork
from model.statics.pad_film import PadFilm


class PadFlow(NamedTuple):
    """One pad's oil.

    Attributes
    ----------
    inflow, outflow, leakage : float
        Through the leading edge, the trailing edge, and both sides [m^3/s].
    inlet, outlet : float
        Temperature at the leading edge, and flow-weighted at the trailing edge [degC].
    """

    inflow: float
    outflow: float
    leakage: float
    inlet: float
    outlet: float


def pad_flow(film: PadFilm, oil: Oil) -> PadFlow:
    """Oil of a pad in a solved equilibrium; NaN where it has no film."""
    entering, leaving = through_flow(film)
    outlet = outlet_temperature(film)
    sides = film.inlet if film.idle else _side_temperature(film)
    return PadFlow(
        entering / float(oil.density(film.inlet)),
        leaving / float(oil.density(outlet)),
        side_flow(film) / float(oil.density(sides)),
        film.inlet,
        outlet,
    )


def through_flow(film: PadFilm) -> tuple[float, float]:
    """What passes the leading edge and the trailing edge [kg/s].

    Of a ruptured film its streaks leave, not the full film of `FilmWork.flow_x`.
    """
    if film.resting is not None:
        return film.resting.flow, film.resting.flow
    if film.forces is None:
        return math.nan, math.nan
    both = 2.0 if film.grid.first == 0 else 1.0
    return both * float(film.work.flow_x[0].sum()), both * float(leaving_flow(film.work).sum())


def side_flow(film: PadFilm) -> float:
    """What leaves over both sides [kg/s]."""
    if film.forces is None:
        return 0.0 if film.resting is not None else math.nan
    entering, leaving, across = film.work.flow_x[0], leaving_flow(film.work), film.work.flow_z
    # through the last faces, and what the half cells at the edge itself lose along the arc
    total = float(across[:, -1].sum() + entering[-1] - leaving[-1])
    if film.grid.first == 0:
        return 2.0 * total
    return total + float(-across[:, 0].sum() + entering[0] - leaving[0])


def _side_temperature(film: PadFilm) -> float:
    flow, edge = film.work.flow_z[:, -1], film.work.temperature[:, -1]
    return float((flow * edge).sum() / flow.sum()) if flow.sum() > 0.0 else film.inlet


def outlet_temperature(film: PadFilm) -> float:
    """Flow-weighted temperature at the trailing edge [degC]; an idle pad's film heats up by shear alone."""
    if film.resting is not None:
        return film.resting.outlet
    if film.forces is None:
        return film.inlet
    return flow_weighted(film, film.work.temperature[None])[0]


def flow_weighted(film: PadFilm, fields: FloatArray) -> list[float]:
    """Mean of every field at the trailing edge, weighted by the flow that leaves there."""
    flow = leaving_flow(film.work)
    values: list[float] = (fields[:, -1] @ flow / float(flow.sum())).tolist()
    return values


def leaving_flow(work: FilmWork) -> FloatArray:
    """Mass flow through the trailing edge, per line of the mesh, (nz + 1,) [kg/s]: of a ruptured film its streaks."""
    before, behind = work.thickness[-2], work.thickness[-1]
    streaks = striation(work)[-2] * np.minimum(1.0, 2.0 * before / (before + behind))
    return np.asarray(work.flow_x[-1] * np.where(_ruptured(work)[-2], streaks, 1.0))


def _ruptured(work: FilmWork) -> BoolArray:
    """Where the film is ruptured, its edges as the nodes beside them: there p = 0 says nothing."""
    ruptured = work.ruptured.copy()
    ruptured[-1] = ruptured[-2]
    ruptured[:, -1] = ruptured[:, -2]
    lines = len(work.unknown) // (len(ruptured) - 2)
    if lines < ruptured.shape[1] - 1:  # z = -L/2 is an edge, not a line of symmetry
        ruptured[:, 0] = ruptured[:, 1]
    return ruptured


def striation(work: FilmWork) -> FloatArray:
    """Share of the gap that oil fills: 1, or h_rupture / h downstream of where a line's film ruptured."""
    share = np.ones_like(work.thickness)
    ruptured, h = _ruptured(work), work.thickness
    for i in np.flatnonzero(ruptured.any(axis=1)):
        if i > 0:
            behind = share[i - 1] * np.minimum(1.0, h[i - 1] / h[i])
            share[i] = np.where(ruptured[i], behind, 1.0)
    return share
