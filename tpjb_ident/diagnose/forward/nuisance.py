"""Nuisances: what is always free within its certificate or tolerance, and never a finding by itself.

An effect counts only if it explains more than these can. They enter the covariance as N diag(s^2) N^T, with N the
change of the observation vector per unit of each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.effects import Effect
from model.setup import Setup
from tpjb_ident.diagnose.forward.forward import Forward
from tpjb_ident.diagnose.observations.gap import centre_shifts
from tpjb_ident.diagnose.observations.observe import Observations

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Certificates:
    """One standard deviation of every known-unknown.

    Attributes
    ----------
    probe_axes : tuple of float
        Directions of the two probes [rad].
    probe_gain : tuple of float
        Relative, per probe.
    cell_gain : float
        Relative, per cell.
    viscosity : float
        Relative.
    supply_temperature : float
        [K]
    assembled_clearance, pad_clearance : float
        Of the drawing [m].
    thermometer : float
        Zero of every pad's temperature sensor [K].
    centre : float
        How far the polygon's centre may lie from the bearing's [m]: it is a choice where pads stand unequal.
        Without a polygon, that of the probes' zero.
    coherent_stiffness : float
        How far two programs may be apart in one coefficient at all points alike, relative.
    coherent_dry : float
        The same of all dry compliances.
    pad_dry : float
        Of one pad's dry compliances together: incomplete contact and friction bend a whole curve.
    """

    probe_axes: tuple[float, float] = (math.pi / 4, 3 * math.pi / 4)
    probe_gain: tuple[float, float] = (0.005, 0.005)
    cell_gain: float = 0.002
    viscosity: float = 0.01
    supply_temperature: float = 0.3
    assembled_clearance: float = 0.5e-6
    pad_clearance: float = 1.0e-6
    thermometer: float = 0.2
    centre: float = 10e-6
    coherent_stiffness: float = 0.004
    coherent_dry: float = 0.01
    pad_dry: float = 0.015


@dataclass(frozen=True)
class Nuisances:
    """Named columns with their standard deviations.

    Attributes
    ----------
    names : tuple of str
    columns : (n, m) ndarray
        Change of the observation vector per one standard deviation.
    """

    names: tuple[str, ...]
    columns: FloatArray


def nuisances(forward: Forward, effects: Sequence[Effect], base: FloatArray, known: Certificates) -> Nuisances:
    """Columns at a model with effects; `base` is what it predicts."""
    names: list[str] = []
    columns: list[FloatArray] = []
    for name, change in _changes(known):
        names.append(name)
        columns.append(forward(effects, change) - base)
    elements = forward.elements
    shifts = centre_shifts(elements)
    for axis, letter in enumerate("xy"):
        names.append(f"centre {letter}")
        columns.append(shifts[:, axis] * known.centre)
    for observable in ("kxx", "kyy", "cxx", "cyy"):
        names.append(f"model {observable}")
        mine = np.array([e.observable == observable for e in elements])
        columns.append(np.where(mine, base, 0.0) * known.coherent_stiffness)
    compliances = np.array([e.observable == "dry_compliance" for e in elements])
    names.append("model dry")
    columns.append(np.where(compliances, known.coherent_dry, 0.0))
    pads = np.array([e.place("pad") for e in elements])
    warm = np.array([e.observable == "pad_temperature" for e in elements])
    for pad in sorted(set(pads[warm])):
        names.append(f"thermometer of pad {pad:.0f}")
        columns.append(np.where(warm & (pads == pad), known.thermometer, 0.0))
    for pad in sorted(set(pads[compliances])):
        names.append(f"dry test of pad {pad:.0f}")
        columns.append(np.where(compliances & (pads == pad), known.pad_dry, 0.0))
    return Nuisances(tuple(names), np.column_stack(columns))


def _changes(known: Certificates):  # type: ignore[no-untyped-def]
    for i, (axis, gain) in enumerate(zip(known.probe_axes, known.probe_gain, strict=True)):
        yield f"gain of probe {i + 1}", _probe(known.probe_axes, axis, gain)
    for i, letter in enumerate("xy"):
        yield f"gain of cell {letter}", _cell(i, known.cell_gain)
    yield "viscosity", _oil(known.viscosity)
    yield "supply temperature", lambda s: s.change(supply_change=s.supply_change + known.supply_temperature)
    yield (
        "assembled clearance",
        lambda s: s.change_pads(
            lambda k, p: replace(p, assembled_clearance=p.assembled_clearance + known.assembled_clearance)
        ),
    )
    yield (
        "pad clearance",
        lambda s: s.change_pads(lambda k, p: replace(p, pad_clearance=p.pad_clearance + known.pad_clearance)),
    )


def _probe(axes: tuple[float, float], axis: float, gain: float):  # type: ignore[no-untyped-def]
    rows = np.array([[math.cos(a), math.sin(a)] for a in axes])
    scale = np.diag([1.0 + gain * (a == axis) for a in axes])
    turned = np.linalg.solve(rows, scale @ rows)
    return lambda s: s.change(instruments=s.instruments.read_displacement(lambda omega: turned))


def _cell(i: int, gain: float):  # type: ignore[no-untyped-def]
    scale = np.eye(2)
    scale[i, i] += gain
    return lambda s: s.change(instruments=s.instruments.read_cells(scale))


def _oil(change: float):  # type: ignore[no-untyped-def]
    def one(s: Setup) -> Setup:
        oil = replace(s.bearing.oil, viscosity_40=s.bearing.oil.viscosity_40 * (1.0 + change))
        return s.change(bearing=replace(s.bearing, oil=oil))

    return one


def whitener(observations: Observations, columns: FloatArray) -> FloatArray:
    """Cholesky factor of the covariance for inference: identification, fine tolerance, nuisances."""
    total = observations.covariance + np.diag(observations.fine**2) + columns @ columns.T
    scale = np.sqrt(np.diag(total))
    return scale[:, None] * np.linalg.cholesky(total / np.outer(scale, scale))
