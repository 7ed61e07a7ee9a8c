"""What every bundled effect of `effects.toml` does to a set-up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from model.bearing import Pad
from model.measured_pivot import MeasuredPivot
from model.pivots import PivotLaw, ScaledPivot
from model.setup import Setup
from rigdata.arrays import ComplexArray, FloatArray


def _moved(setup: Setup, name: str, change: float, number: int | None = None) -> Setup:
    """Change a number of every pad, or of one."""

    def moved(k: int, pad: Pad) -> Pad:
        return replace(pad, **{name: getattr(pad, name) + change}) if number in (None, k) else pad

    return setup.change_pads(moved)


def pad_offset(setup: Setup, pad: int, radial_offset: float) -> Setup:
    """The assembled clearance of one pad is Cb + radial_offset."""
    return _moved(setup, "assembled_clearance", radial_offset, pad)


def uneven_pads(setup: Setup, **offsets: float) -> Setup:
    """Cb of pad k plus offset_k, less the part of all offsets that only shifts the bearing as a whole.

    Offsets ``n_k . s`` of the pads at n_k move the bearing by s, and the journal with it: no test tells them from a
    bearing centre that is elsewhere, since positions count from the bearing centre. That part is taken out (least
    squares), so that offsets which differ by a shift are one and the same effect.
    """
    pads = setup.bearing.pads
    clearances = np.array([offsets[f"offset_{k}"] for k in range(1, len(pads) + 1)])
    normals = np.array([[math.cos(p.pivot_angle), math.sin(p.pivot_angle)] for p in pads])
    without_shift = clearances - normals @ np.linalg.lstsq(normals, clearances, rcond=None)[0]
    return setup.change_pads(
        lambda number, pad: replace(pad, assembled_clearance=pad.assembled_clearance + float(without_shift[number - 1]))
    )


def preload_error(setup: Setup, pad_clearance_change: float) -> Setup:
    """Cp of every pad changes by this; Cb stays."""
    return _moved(setup, "pad_clearance", pad_clearance_change)


def pad_bore(setup: Setup, pad: int, pad_clearance_change: float) -> Setup:
    """Cp of one pad changes by this; Cb stays."""
    return _moved(setup, "pad_clearance", pad_clearance_change, pad)


def clearance_error(setup: Setup, assembled_clearance_change: float) -> Setup:
    """Cb of every pad changes by this, cold and running."""
    return _moved(setup, "assembled_clearance", assembled_clearance_change)


def pivot_offset_error(setup: Setup, offset_change: float) -> Setup:
    """The pivots are this share of the arc further from the leading edge than the bearing file says."""
    return _moved(setup, "pivot_offset", offset_change)


def thermal_growth(setup: Setup, clearance_change: float) -> Setup:
    """Cb of every pad changes by this in running conditions; dry tests are cold."""
    return setup.change(clearance_change=setup.clearance_change + clearance_change)


def misalignment(setup: Setup, angle: float, direction: float) -> Setup:
    """The shaft axis is tilted by angle towards direction, about mid-bearing; pads do not follow."""
    return setup.change(misalignment=(angle, direction))


def oil_viscosity(setup: Setup, factor: float) -> Setup:
    """mu_40 times factor."""
    oil = replace(setup.bearing.oil, viscosity_40=setup.bearing.oil.viscosity_40 * factor)
    return setup.change(bearing=replace(setup.bearing, oil=oil))


def viscosity_law(setup: Setup, factor: float) -> Setup:
    """The exponent kappa of mu(T) times factor; mu at the stated supply temperature stays."""
    oil = setup.bearing.oil
    exponent = oil.viscosity_exponent * factor
    viscosity = oil.viscosity_40 * math.exp((oil.viscosity_exponent - exponent) * (40.0 - oil.supply_temperature))
    changed = replace(oil, viscosity_40=viscosity, viscosity_exponent=exponent)
    return setup.change(bearing=replace(setup.bearing, oil=changed))


def supply_temperature(setup: Setup, change: float) -> Setup:
    """Supply temperature plus change."""
    return setup.change(supply_change=setup.supply_change + change)


def starvation(setup: Setup, arc_fraction: float) -> Setup:
    """Every film starts after this fraction of the arc from the leading edge."""
    return setup.change(starvation=arc_fraction)


def fluid_inertia(setup: Setup, added_mass: float) -> Setup:
    """H gets -omega^2 * added_mass * I."""
    return setup.change(added_mass=setup.added_mass + added_mass)


def hot_oil_carryover(setup: Setup, fraction: float) -> Setup:
    """A share lambda of the oil that leaves a pad enters the next one, as far as that takes it in.

    T_in = T_supply + s (T_out before - T_supply) with s = min(1, lambda Q_out before / Q_in), see
    `model.statics.compiled.heat`.
    """
    return setup.change(carryover=fraction)


def heat_loss(setup: Setup, share: float) -> Setup:
    """A share of the dissipation leaves the film at once, into shaft, pads, churned oil."""
    return setup.change(heat_loss=1.0 - (1.0 - setup.heat_loss) * (1.0 - share))


def pad_conduction(setup: Setup, back_convection: float) -> Setup:
    """Switch on the heat paths into pads and journal, the pads' free faces with this film coefficient.

    Zero is the baseline: adiabatic. The journal, and pads that pass heat from hot places of the film to cold ones,
    come with the first watt, so that the effect starts with a small step.
    """
    if back_convection == 0.0:
        return setup
    options = replace(setup.options, conduction=True, isothermal_journal=True)
    return setup.change_pads(lambda number, pad: replace(pad, back_convection=back_convection)).change(options=options)


def pad_bending(setup: Setup, compliance_factor: float) -> Setup:
    """Switch on the pads' computed deformation, times compliance_factor."""
    return setup.change(bending=compliance_factor)


def pivot_flexibility(setup: Setup, stiffness_factor: float) -> Setup:
    """Every pivot deflects delta(W) / stiffness_factor."""
    return setup.change(pivots=tuple(ScaledPivot(law, stiffness_factor) for law in setup.pivots))


def soft_pivot(setup: Setup, pad: int, stiffness_factor: float) -> Setup:
    """The pivot of one pad deflects delta(W) / stiffness_factor."""
    pivots = list(setup.pivots)
    pivots[pad - 1] = ScaledPivot(pivots[pad - 1], stiffness_factor)
    return setup.change(pivots=tuple(pivots))


def pivot_damping(setup: Setup, damping: float) -> Setup:
    """c_eta of Eq. (12)."""
    return setup.change(pivot_damping=setup.pivot_damping + damping)


def pivot_rotation(setup: Setup, rotational_stiffness: float) -> Setup:
    """Tilting is held back by this about each pivot, from the concentric attitude (k_theta of Eq. 12)."""
    return setup.change(rotational_stiffness=setup.rotational_stiffness + rotational_stiffness)


def pivot_rolling(setup: Setup, factor: float) -> Setup:
    """Tilting is held back by k_theta = factor * W_pad * R_H R_b / (R_H - R_b)."""
    return setup.change(rolling=setup.rolling + factor)


def pivot_friction(setup: Setup, coefficient: float) -> Setup:
    """Tilting is held by friction up to coefficient * W_pad * sphere radius."""
    return setup.change(friction=setup.friction + coefficient)


def _add_compliance(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """Put a compliance [m/N] in series with the whole bearing.

    A pivot curve that was measured against the same structure already holds it once; it is taken off there, as far as
    it gives way towards that pad.
    """
    pivots = []
    for law, pad in zip(setup.pivots, setup.bearing.pads, strict=True):
        x, y = math.cos(pad.pivot_angle), math.sin(pad.pivot_angle)
        pivots.append(_alone(law, xx * x * x + 2.0 * xy * x * y + yy * y * y))
    return setup.change(series_compliance=_sum(setup.series_compliance, xx, xy, yy), pivots=tuple(pivots))


def _sum(before: tuple[float, ...], *more: float) -> Any:
    return tuple(a + b for a, b in zip(before, more, strict=True))


def _alone(law: PivotLaw, compliance: float) -> PivotLaw:
    if isinstance(law, ScaledPivot):
        return replace(law, law=_alone(law.law, compliance))
    return law.without_housing(compliance) if isinstance(law, MeasuredPivot) else law


def housing_flexibility(setup: Setup, stiffness: float) -> Setup:
    """A spring, equal in x and y, in series with the whole bearing."""
    return _add_compliance(setup, 1.0 / stiffness, 0.0, 1.0 / stiffness)


def structure_compliance(setup: Setup, stiffness: float, direction: float) -> Setup:
    """A spring along `direction` alone in series with the bearing: inv(H_meas) = inv(H) + e e^T / stiffness."""
    x, y = math.cos(direction), math.sin(direction)
    return _add_compliance(setup, x * x / stiffness, x * y / stiffness, y * y / stiffness)


def series_compliance(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """inv(H_meas) = inv(H) + [[xx, xy], [xy, yy]]; static positions move too, in all kinds of run."""
    return _add_compliance(setup, xx, xy, yy)


def parallel_stiffness(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant stiffness that adds to what the records show, in dynamic tests only."""
    return setup.change(parallel_stiffness=_sum(setup.parallel_stiffness, xx, xy, yx, yy))


def parallel_damping(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant damping that adds to what the records show, in dynamic tests only."""
    return setup.change(parallel_damping=_sum(setup.parallel_damping, xx, xy, yx, yy))


def _misread(setup: Setup, matrix: FloatArray) -> Setup:
    """Displacement readings are a matrix (2, 2) times the truth, at every frequency."""
    return setup.change(instruments=setup.instruments.read_displacement(lambda omega: matrix))


def channel_delay(setup: Setup, delay: float) -> Setup:
    """Displacement channels are recorded this much later than force and acceleration channels."""

    def late(omega: float) -> ComplexArray:
        return np.exp(-1j * omega * delay) * np.eye(2)

    return setup.change(instruments=setup.instruments.read_displacement(late))


def probe_gain(setup: Setup, factor: float) -> Setup:
    """Displacement readings are factor times the truth."""
    return _misread(setup, factor * np.eye(2))


def probe_rotation(setup: Setup, angle: float) -> Setup:
    """Both probes really stand at their stated angle + this."""
    # a probe at theta + angle reads d . e(theta + angle) = (R(-angle) d) . e(theta)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return _misread(setup, turn)


def loadcell_gain(setup: Setup, factor: float) -> Setup:
    """Force readings of the cells are factor times the truth."""
    return setup.change(instruments=setup.instruments.read_cells(factor * np.eye(2)))


def loadcell_crosstalk(setup: Setup, fraction: float) -> Setup:
    """Each cell also reads this fraction of the other axis."""
    return setup.change(instruments=setup.instruments.read_cells(np.array([[1.0, fraction], [fraction, 1.0]])))


def housing_mass(setup: Setup, mass_error: float) -> Setup:
    """True housing mass = stated mass + mass_error."""
    return setup.change(instruments=setup.instruments.weigh_housing(mass_error))


def one_probe_gain(setup: Setup, probe: float, factor: float) -> Setup:
    """Readings of one displacement probe are factor times the truth."""
    rows = np.array([[math.cos(a), math.sin(a)] for a in setup.instruments.probe_axes])
    gains = np.where(np.arange(1, 3) == probe, factor, 1.0)
    return _misread(setup, np.linalg.solve(rows, gains[:, None] * rows))


def one_cell_gain(setup: Setup, cell: float, factor: float) -> Setup:
    """Readings of one load cell (1: X, 2: Y) are factor times the truth."""
    gains = np.where(np.arange(1, 3) == cell, factor, 1.0)
    return setup.change(instruments=setup.instruments.read_cells(np.diag(gains)))


def thermometer_offset(setup: Setup, pad: int, offset: float) -> Setup:
    """The thermometer of one pad reads this much more than the truth."""
    readings = (*setup.instruments.thermometers, (pad, offset))
    return setup.change(instruments=replace(setup.instruments, thermometers=readings))
