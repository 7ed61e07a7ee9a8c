"""Instruments and files of a rig in closed form: true signals become records of a `tpjb-rig/1` campaign.

Nothing of the toolkit is used. A rig hands over runs whose true displacement, cell force and housing acceleration are
functions of time; every channel samples them at its own times, with its own axis, gain, lateness and faults.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from scipy.interpolate import CubicSpline

from tests.manifests import write_files

Array = np.ndarray
#: Signal of a run: (quantity, times [s]) to (2, n), SI, in the frame x, y.
Signal = Callable[[str, Array], Array]
#: Change of a channel's values [SI]: (values, generator, number of the run).
Fault = Callable[[Array, np.random.Generator, int], Array]
UNITS = {"displacement": "V", "force": "N", "acceleration": "m/s^2", "time": "s", "keyphasor": "V"}
#: Stated calibration uncertainty, one standard deviation; true gains are drawn from it.
UNCERTAINTY = {"displacement": 0.003, "force": 0.002, "acceleration": 0.005}
#: Of sensors without any error, which says so.
EXACT = dict.fromkeys(UNCERTAINTY, 0.0)
VOLTS_PER_METRE, GAP_VOLTS = 7780.0, 8.2
BEARING = """
schema = "tpjb-bearing/1"
name = "to scale"
journal = {{ diameter = "{diameter:g} mm" }}
pads = {{ pivot_angles = ["-90 deg", "-18 deg", "54 deg", "126 deg", "198 deg"], arc = "60 deg", pivot_offset = 0.5, \
thickness = "{thickness:g} mm", mass = "1 kg", moment_of_inertia = "1e-3 kg m^2" }}
pivot = {{ kind = "rigid" }}
[bearing]
length = "{length:g} mm"
assembled_clearance = "{clearance:g} mm"
pad_clearance = "{pad_clearance:g} mm"
[oil]
supply_temperature = "40 degC"
viscosity_40C = "0.0396 Pa s"
viscosity_exponent = "0.034 1/K"
density_40C = "860 kg/m^3"
thermal_expansion = "7.0e-4 1/K"
specific_heat = "2000 J/kg/K"
conductivity = "0.13 W/m/K"
"""


@dataclass(frozen=True)
class Channel:
    """A sensor and its column; `axis` is stated, `true_axis` where it really points [deg]."""

    name: str
    quantity: str
    axis: float
    true_axis: float | None = None
    gain: float = 1.0
    zero: float = 0.0
    late: float = 0.0  #: [s]
    ppm: float = 0.0  #: its device's clock is slow by this
    rate: float | None = None  #: of its own device [Hz]
    fill: str = ""  #: hold, linear or spline: slow readings written at the run's rate
    drift: float = 0.0  #: gain per kelvin, from 40 degC
    plane: float = 0.0  #: [m]
    noise: float = 1.0
    fault: Fault | None = None
    extra: tuple[str, ...] = ()  #: further lines of its table


@dataclass(frozen=True)
class Run:
    """One record as it was: its lines in the manifest, its signals, its temperature [degC]."""

    name: str
    lines: tuple[str, ...]
    signal: Signal
    seconds: float
    temperature: float = 40.0
    tilt: float = 0.0  #: change of displacement with axial position, as a share of it per metre


@dataclass(frozen=True)
class Acquisition:
    """How signals are recorded and written."""

    rate: float = 2000.0
    noise: dict[str, float] = field(default_factory=dict)  #: standard deviation a sample, SI
    uncertainty: dict[str, float] = field(default_factory=UNCERTAINTY.copy)
    mains: float = 50.0
    hum: dict[str, float] = field(default_factory=dict)  #: amplitude by quantity, SI
    form: str = "hdf5"  #: or csv
    nominal_rate: float | None = None
    extra: tuple[str, ...] = ()  #: further lines of [acquisition]
    time_digits: int | None = None  #: decimals of a time column [s], none without such a column


@dataclass(frozen=True)
class Campaign:
    """What a rig gives: head of the manifest, bearing file, channels, runs, and the truth."""

    head: tuple[str, ...]
    bearing: str
    channels: tuple[Channel, ...]
    runs: tuple[Run, ...]
    truth: Callable[[float, float], Array]  #: (static load [N], stated frequency [Hz]) to H (2, 2) [N/m]
    real: Callable[[float], float]  #: stated frequency to the real one [Hz]


def unit_vector(degrees: float) -> Array:
    """Direction in the frame (2,)."""
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])


def bearing_file(diameter: float, clearance: float) -> str:
    """A bearing of this journal diameter and assembled clearance [m], drawn to scale."""
    sizes = {"diameter": 1e3, "length": 700.0, "thickness": 200.0}
    scaled = {name: factor * diameter for name, factor in sizes.items()}
    return BEARING.format(**scaled, clearance=1e3 * clearance, pad_clearance=2.2e3 * clearance)


def channel_lines(channel: Channel, uncertainty: dict[str, float]) -> list[str]:
    """Table of one channel in the manifest."""
    q = channel.quantity
    lines = [f'[channels."{channel.name}"]', f'quantity = "{q}"']
    lines += [f'axis = "{channel.axis:g} deg"'] if q not in ("time", "keyphasor") else []
    lines += [f'unit = "{UNITS[q]}"'] if q in UNITS else []
    lines += ['sensitivity = "7.78 mV/um"', "polarity = -1"] if q == "displacement" else []
    lines += [f'uncertainty = "{100 * uncertainty[q]:g} %"'] if q in uncertainty else []
    return lines + list(channel.extra)


def channel_values(channel: Channel, run: Run, setup: Acquisition, rng: np.random.Generator, number: int) -> Array:
    """Values of one channel in run `number`, SI."""
    rate = channel.rate or setup.rate
    nominal = np.arange(round(run.seconds * rate)) / rate
    if channel.quantity == "time":
        return nominal
    times = nominal * (1 + 1e-6 * channel.ppm) - channel.late
    axis = channel.axis if channel.true_axis is None else channel.true_axis
    values = unit_vector(axis) @ run.signal(channel.quantity, times) * (1 + run.tilt * channel.plane)
    values = values * channel.gain * (1 + channel.drift * (run.temperature - 40.0)) + channel.zero
    hum = setup.hum.get(channel.quantity, 0.0) * (0.6 + 0.4 * np.cos(3 * axis))
    phase = np.random.default_rng(number).uniform(0, 2 * np.pi) + axis
    values = values + hum * np.cos(2 * np.pi * 1.0002 * setup.mains * times + phase)
    values = values + channel.noise * setup.noise.get(channel.quantity, 0.0) * rng.standard_normal(len(values))
    if channel.fault is not None:
        values = channel.fault(values, rng, number)
    fast = np.arange(round(run.seconds * setup.rate)) / setup.rate
    if channel.fill == "hold":
        return np.asarray(values[np.searchsorted(nominal, fast + 1e-9, side="right") - 1])
    if channel.fill == "linear":
        return np.interp(fast, nominal, values)
    return np.asarray(CubicSpline(nominal, values)(fast)) if channel.fill == "spline" else values


def readings(campaign: Campaign, setup: Acquisition, seed: list[int]) -> dict[str, dict[str, Array]]:
    """Columns of every run, in the units of the manifest."""
    rng = np.random.default_rng(seed)
    gains = {}
    for channel in campaign.channels:
        gains[channel.name] = 1 + setup.uncertainty.get(channel.quantity, 0.0) * rng.standard_normal()
    records: dict[str, dict[str, Array]] = {}
    for number, run in enumerate(campaign.runs):
        columns = {}
        if setup.time_digits is not None:
            columns["Time"] = np.round(np.arange(round(run.seconds * setup.rate)) / setup.rate, setup.time_digits)
        for channel in campaign.channels:
            values = gains[channel.name] * channel_values(channel, run, setup, rng, number)
            volts = channel.quantity == "displacement"
            columns[channel.name] = GAP_VOLTS - VOLTS_PER_METRE * values if volts else values
        records[run.name] = columns
    return records


def write_campaign(folder: Path, campaign: Campaign, setup: Acquisition, seed: list[int]) -> Path:
    """Write the campaign; its path."""
    rate = setup.nominal_rate or setup.rate
    text = ['schema = "tpjb-rig/1"', 'id = "field"', 'bearing = "bearing.toml"', *campaign.head]
    text += ["[acquisition]", f'sample_rate = "{rate:g} Hz"', *setup.extra]
    if setup.time_digits is not None:
        text += ["[channels.Time]", 'quantity = "time"', 'unit = "s"']
    for channel in campaign.channels:
        text += channel_lines(channel, setup.uncertainty)
    for run in campaign.runs:
        text += ["[[runs]]", f'id = "{run.name}"', f'file = "runs/{run.name}.csv"', *run.lines]
    manifest, records = "\n".join(text) + "\n", readings(campaign, setup, seed)
    if setup.form == "csv":
        tables = {f"runs/{name}.csv": _table(columns) for name, columns in records.items()}
        return write_files(folder / "field", manifest, {"bearing.toml": campaign.bearing, **tables})
    with h5py.File(folder / "field.h5", "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = manifest, campaign.bearing
        for name, columns in records.items():
            group = file.create_group("runs/" + name)
            group.attrs["sample_rate_hz"] = rate
            for channel_name, values in columns.items():
                group.create_dataset(channel_name, data=values)
    return folder / "field.h5"


def _table(columns: dict[str, Array]) -> bytes:
    """CSV with decimal commas; shorter columns end in blanks."""
    cells = [[f"{v:.8g}".replace(".", ",") for v in values] for values in columns.values()]
    lines = [";".join(columns), *map(";".join, itertools.zip_longest(*cells, fillvalue="")), ""]
    return "\r\n".join(lines).encode("cp1252")
