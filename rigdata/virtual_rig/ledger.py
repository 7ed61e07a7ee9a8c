"""The truth of a campaign, to be kept outside of it: what really went into every run."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig.faults import Fault
from rigdata.virtual_rig.instruments import Instruments
from rigdata.virtual_rig.motion import answer
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig
from rigdata.virtual_rig.sensing import felt_direction

_PIVOT_LOADS = np.arange(250.0, 8001.0, 250.0)


@dataclass(frozen=True)
class CampaignTruth:
    """What was really put into a campaign."""

    campaign: str
    seed: int
    points: tuple[Mapping[str, object], ...] = field(repr=False)
    locus: tuple[Mapping[str, object], ...] = field(repr=False)
    pivot_curves: tuple[Mapping[str, object], ...] = field(repr=False)
    clearance_cold_m: tuple[float, ...]
    gap_voltage_V: Mapping[str, float]  # noqa: N815 - the truth files' own key
    housing_mass_kg: float
    cell_stiffness_N_per_m: tuple[float, ...]  # noqa: N815
    sensor_errors: Mapping[str, Mapping[str, float]] = field(repr=False)
    faults: tuple[Mapping[str, object], ...]
    runs: Mapping[str, Mapping[str, object]] = field(repr=False)

    def to_dict(self) -> dict[str, object]:
        """Everything as plain Python, in the shape of the samples' truth files."""
        return {"schema": "tpjb-truth/1", **asdict(self)}

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write as JSON, whole or not at all; never into the campaign itself. What is infinite becomes null."""
        target = Path(path)
        spare = target.with_name(f".{target.name}.part")
        spare.write_text(json.dumps(_finite(self.to_dict()), indent=1, allow_nan=False), encoding="utf-8")
        os.replace(spare, target)


def _finite(value: object) -> object:
    """Copy plain data with None for infinite numbers (rigid pivots, rigid cells), which JSON does not know."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def campaign_truth(rig: VirtualRig, runs: Mapping[str, Mapping[str, object]]) -> CampaignTruth:
    """Gather the truth of a rig and of its simulated runs."""
    cells = rig.instruments.cell_stiffness
    return CampaignTruth(
        campaign=rig.campaign,
        seed=rig.seed,
        points=tuple(_point(rig, point) for point in rig.plan.dynamic),
        locus=tuple(_set_point(point) | _position(rig, point) for point in rig.plan.locus),
        pivot_curves=tuple(_pivot_curve(rig, k + 1) for k in range(len(rig.truth.pivot_angles))),
        clearance_cold_m=tuple(rig.truth.clearance),
        gap_voltage_V=rig.instruments.gap_voltages(),
        housing_mass_kg=rig.instruments.true_mass,
        cell_stiffness_N_per_m=tuple(cells),
        sensor_errors={s.name: asdict(s.error) for s in rig.instruments.sensors},
        faults=tuple(_fault(fault) for fault in rig.faults),
        runs=dict(runs),
    )


def run_facts(record: SimulatedRun) -> dict[str, object]:
    """Facts of one record for the truth."""
    return {
        "kind": record.run.kind,
        "recorded_in": record.source,
        **record.motion.facts,
        "glitches": [asdict(glitch) for glitch in record.glitches],
    }


def _point(rig: VirtualRig, point: OperatingPoint) -> dict[str, object]:
    h = rig.truth.h(point)
    readings = apparent_stiffness(h, point.excitation, rig.instruments)
    steady = replace(point, excitation=0.0)
    return {
        **_set_point(point),
        "excitation_Hz": point.excitation_hz,
        "K": h.real.tolist(),
        "C": (h.imag / point.excitation).tolist(),
        "K_apparent": readings.real.tolist(),
        "C_apparent": (readings.imag / point.excitation).tolist(),
        **_position(rig, steady),
        "pad_temperature_C": rig.truth.temperatures(steady).tolist(),
    }


def _position(rig: VirtualRig, point: OperatingPoint) -> dict[str, object]:
    x, y = rig.truth.centre(point).tolist()
    return {"x_m": x, "y_m": y}


def _set_point(point: OperatingPoint) -> dict[str, object]:
    return {
        "static_load_N": point.static_load,
        "static_load_direction_deg": point.static_load_direction_deg,
        "shaft_speed_Hz": point.shaft_speed_hz,
    }


def _pivot_curve(rig: VirtualRig, pad: int) -> dict[str, object]:
    # tangents by central differences over 0.1 % of the load: error about 1e-7 for smooth laws
    low, high = _PIVOT_LOADS * (1 - 1e-3), _PIVOT_LOADS * (1 + 1e-3)
    rise = rig.truth.deflection(pad, high) - rig.truth.deflection(pad, low)
    with np.errstate(divide="ignore"):  # a rigid pivot is infinitely stiff
        stiffness = (high - low) / rise
    return {
        "pad": pad,
        "force_N": _PIVOT_LOADS.tolist(),
        "deflection_m": rig.truth.deflection(pad, _PIVOT_LOADS).tolist(),
        "stiffness_N_per_m": stiffness.tolist(),
    }


def _fault(fault: Fault) -> dict[str, object]:
    """Fault without what was not given; an open end is not a JSON number."""
    return {k: v for k, v in asdict(fault).items() if v is not None and v != float("inf")}


def apparent_stiffness(h: ComplexArray, frequency: float, instruments: Instruments) -> ComplexArray:
    """Dynamic stiffness (2, 2) [N/m] that the readings show for a true `h` at `frequency` [rad/s].

    Instrument errors are linear maps, so this needs no records: the difference to the truth is what the errors alone
    do, and a sharp test of whoever evaluates the records.
    """
    lines = [answer(frequency, force, h, instruments) for force in np.eye(2, dtype=complex)]
    readings = {}
    for quantity in ("displacement", "force", "acceleration"):
        phasors = np.stack([line.phasor(quantity) for line in lines], axis=1)
        readings[quantity] = _reading_map(instruments, quantity, frequency) @ phasors
    oil_force = readings["force"] + instruments.housing_mass * readings["acceleration"]
    return oil_force @ np.linalg.inv(readings["displacement"])


def _reading_map(instruments: Instruments, quantity: str, frequency: float) -> ComplexArray:
    """Map (2, 2) from true to stated X and Y of a quantity, phasors at `frequency` [rad/s]; first pair of sensors."""
    stated, sensed = [], []
    for sensor in instruments.of(quantity)[:2]:
        gain = sensor.error.gain * np.exp(-1j * frequency * sensor.error.delay)
        stated.append(sensor.direction(stated=True))
        sensed.append(gain * felt_direction(sensor, instruments))
    return np.linalg.solve(np.array(stated, dtype=complex), np.array(sensed))
