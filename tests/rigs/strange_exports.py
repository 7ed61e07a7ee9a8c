"""Exports of six laboratories, of a rig in closed form: numbers are chosen here, nothing of the toolkit takes part.

A five-pad bearing with known K and C, pivots and clearances is loaded in dry steps toward every pad, swept around its
clearance and shaken at two loads and two frequencies in two directions; each laboratory has probes, cells, units, names
of columns and names of files of its own.
"""

import datetime
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.foreign_files import write_columns, write_groups

PADS = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
CLEARANCES = np.array([80e-6, 82e-6, 79e-6, 81e-6, 80e-6])
CENTRE = np.array([12e-6, -7e-6])  #: of the bearing, from the probes' zero [m]
MASS, CELL_SPRINGS = 30.0, np.array([5e8, 6e8])
SHAFT, FREQUENCIES, DIRECTIONS = 22.0, (25.0, 40.0), (30.0, 120.0)
K, C = np.array([[1.6e8, 1.2e7], [-0.9e7, 2.4e8]]), np.array([[4.2e5, -0.2e5], [-0.25e5, 5.5e5]])
EXPONENTS, NOMINAL = (0.55, 0.30), 5000.0
ASIDE = (0.4, -0.6, 0.2, -0.3, 0.5)  #: how far the dry steps pull beside their pads [deg]
STEPS = tuple(500.0 * (i + 1) for i in range(10))
PUSH = 200.0
RATE, SLOW_RATE = 1000.0, 250.0
LBF, KGF, MIL, G = 4.4482216152605, 9.80665, 25.4e-6, 9.80665
Table = dict[str, np.ndarray]


def stiffness(load: float) -> np.ndarray:
    """K (2, 2) [N/m] at a load [N]."""
    return K * (load / NOMINAL) ** EXPONENTS[0]


def damping(load: float) -> np.ndarray:
    """C (2, 2) [N s/m] at a load [N]."""
    return C * (load / NOMINAL) ** EXPONENTS[1]


def deflection(load: np.ndarray) -> np.ndarray:
    """Of every pivot alike [m]: softer than Kirk's rocker."""
    return 6.0e-9 * np.maximum(load, 0.0) ** 0.92


@dataclass(frozen=True)
class Planned:
    """One run: what was done, its load [N], frequency [Hz], direction [deg] or pad, and its number."""

    kind: str
    load: float = 0.0
    frequency: float = 0.0
    direction: float = 0.0
    pad: int = 0
    number: int = 1


@dataclass(frozen=True)
class Sensor:
    """A column: what it measures along which direction [deg], its reading per SI unit, and its reading at zero."""

    name: str
    quantity: str
    axis: float = 0.0
    gain: float = 1.0
    zero: float = 0.0


@dataclass(frozen=True)
class Laboratory:
    """How one laboratory measures, names its files and writes them."""

    name: str
    sensors: tuple[Sensor, ...]
    title: Callable[[Planned], str]
    write: Callable[[Path, np.ndarray, Table, Table], None]
    loads: tuple[float, float] = (3000.0, 6000.0)
    edits: dict[tuple[str, str], str] = field(default_factory=dict)


def planned_runs(laboratory: Laboratory) -> Iterator[Planned]:
    """Every run of a campaign."""
    yield Planned("clearance")
    for pad in range(1, 6):
        yield Planned("dry", pad=pad)
    number = 0
    for load in laboratory.loads:
        for frequency in FREQUENCIES:
            for direction in DIRECTIONS:
                number += 1
                yield Planned("dynamic", load, frequency, direction, number=number)


def write_exports(folder: Path, laboratory: Laboratory, seed: int = 1) -> None:
    """Write all records of a laboratory, and nothing else."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    for test in planned_runs(laboratory):
        time, motion = _motion(test, rng)
        readings = {s.name: _reading(s, motion, rng) for s in laboratory.sensors}
        fast = {s.name: readings[s.name] for s in laboratory.sensors if s.quantity == "displacement"}
        other = {name: values for name, values in readings.items() if name not in fast}
        laboratory.write(folder / laboratory.title(test), time, fast, other)


def _reading(sensor: Sensor, motion: Table, rng: np.random.Generator) -> np.ndarray:
    values = motion[sensor.quantity]
    if values.ndim == 2:
        angle = np.radians(sensor.axis)
        values = values @ np.array([np.cos(angle), np.sin(angle)])
        if sensor.quantity == "displacement" and "turn" in motion:  # runout seen where the probe stands
            values = values + 3e-6 * np.cos(motion["turn"] - angle) + 1e-6 * np.cos(2 * motion["turn"] - 2 * angle)
    noise = {"displacement": 0.02e-6, "force": 2.0, "acceleration": 0.01, "temperature": 0.02, "speed": 0.002}
    values = values + noise[sensor.quantity] * rng.standard_normal(len(values))
    return sensor.gain * values + sensor.zero


def _motion(test: Planned, rng: np.random.Generator) -> tuple[np.ndarray, Table]:
    """Times, and every quantity in SI (degC, Hz)."""
    if test.kind == "dynamic":
        return _dynamic(test, rng)
    time, force, position = _dry(test) if test.kind == "dry" else _sweep()
    still = np.zeros_like(time)
    return time, {"displacement": CENTRE + position, "force": force, "acceleration": np.zeros_like(force),
                  "temperature": 21.0 + still, "speed": still}  # fmt: skip


def _dry(test: Planned) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Load steps toward a pad: 0.2 s up, 0.8 s held."""
    time = np.arange(0.0, len(STEPS) + 1.0, 1.0 / SLOW_RATE)
    step, within = np.divmod(time, 1.0)
    levels = np.array([250.0, *STEPS])
    index = step.astype(int)
    before = levels[np.maximum(index - 1, 0)]
    load = before + (levels[index] - before) * np.clip(within / 0.2, 0.0, 1.0)
    normal = np.array([np.cos(PADS[test.pad - 1]), np.sin(PADS[test.pad - 1])])
    pulled = PADS[test.pad - 1] + np.radians(ASIDE[test.pad - 1])
    way = CLEARANCES[test.pad - 1] + deflection(load)
    return time, load[:, None] * np.array([np.cos(pulled), np.sin(pulled)]), way[:, None] * normal


def _sweep() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A small push once around: the shaft lies on two pads, and slides over to the next pair as the push passes one."""
    time = np.arange(0.0, 20.0, 1.0 / SLOW_RATE)
    angle = -np.pi / 2 + 2 * np.pi * time / 20.0
    push = PUSH * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals = np.stack([np.cos(PADS), np.sin(PADS)], axis=1)
    order = (angle - PADS[0]) / (2 * np.pi / 5)  # pads stand evenly
    position = np.zeros_like(push)
    pair = np.floor(order + 1e-9).astype(int) % 5
    for first in range(5):
        rows = pair == first
        sides = normals[[first, (first + 1) % 5]]
        shares = push[rows] @ np.linalg.inv(sides)
        way = CLEARANCES[[first, (first + 1) % 5]] + deflection(shares)
        position[rows] = way @ np.linalg.inv(sides).T
    return time, push, position


def _dynamic(test: Planned, rng: np.random.Generator) -> tuple[np.ndarray, Table]:
    """The film between shaft and housing, the housing on its cells, unbalance stronger than the light load's drive."""
    time = np.arange(0.0, 3.0, 1.0 / RATE)
    omega = 2 * np.pi * test.frequency
    angle = np.radians(test.direction)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    drive = 0.1 * test.load * (along + 0.1j * across) * np.exp(2j * np.pi * rng.uniform())
    h = stiffness(test.load) + 1j * omega * damping(test.load)
    down = np.array([0.0, -test.load])
    phasors = {"displacement": np.linalg.solve(h, drive)}
    mean = {"displacement": CENTRE + np.array([8e-6, -30e-6]), "force": down, "acceleration": np.zeros(2)}
    phasors["force"] = drive * CELL_SPRINGS / (CELL_SPRINGS - MASS * omega**2)
    phasors["acceleration"] = -(omega**2) * phasors["force"] / CELL_SPRINGS
    turn = 2 * np.pi * SHAFT * time + 2 * np.pi * rng.uniform()
    table = {"turn": turn}
    for quantity, phasor in phasors.items():
        table[quantity] = mean[quantity] + np.real(np.exp(1j * omega * time)[:, None] * phasor)
    table["force"] += 400.0 * np.stack([np.cos(turn + 0.3), np.sin(turn + 0.3)], axis=1)
    still = np.zeros_like(time)
    return time, table | {"temperature": 48.0 + still, "speed": SHAFT + still}


def _german(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """Semicolons, decimal comma, cp1252, three lines of preamble, everything in volts."""
    columns = {"Zeit [s]": time, **{f"{name} [V]": values for name, values in (fast | other).items()}}
    lines = ["Prüfstand Gleitlager;Messung", "Bearbeiter;Müller", "Datum;12.03.2021", ";".join(columns)]
    rows = zip(*columns.values(), strict=True)
    lines += [";".join(f"{value:.7g}" for value in row).replace(".", ",") for row in rows]
    path.with_suffix(".csv").write_text("\r\n".join(lines) + "\r\n", "cp1252", newline="")


def _times_of_day(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """Two devices side by side, one at half the rate, each with its times of day; an empty column between them."""
    start = datetime.datetime(2021, 3, 12, 23, 59, 58)  # midnight comes in between
    columns = []
    for title, table, every in (("Uhrzeit Gerät A", fast, 1), ("", {}, 1), ("Uhrzeit Gerät B", other, 2)):
        stamps = [start + datetime.timedelta(seconds=float(second)) for second in time[::every]]
        columns.append([title, *(f"{stamp:%H:%M:%S,%f}"[:-2] for stamp in stamps if title)])
        for name, values in table.items():
            columns.append([name, *(f"{value:.5f}".replace(".", ",") for value in values[::every])])
    lines = ["Prüfling: ölgeschmiertes Kippsegmentlager; Prüfer: Jörg Groß", "Gerät A: 1 kHz; Gerät B: 500 Hz", ""]
    lines += [";".join(row) for row in itertools.zip_longest(*columns, fillvalue="")]
    path.with_suffix(".csv").write_text("\r\n".join(lines) + "\r\n", "cp1252", newline="")


def _tdms(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """Two devices: probes of one, everything else of another at half the rate; units as properties."""
    units = {"Gap": "um", "Load": "N", "Acc": "m/s^2", "Oil": "degC", "Speed": "rpm"}
    groups = []
    for table, every in ((fast, 1), (other, 2)):
        channels = {name: (units[name.split()[0]], values[::every]) for name, values in table.items()}
        groups.append((time[::every], channels))
    write_groups(path.with_suffix(".tdms"), *groups)


def _matlab(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """One vector a channel, its unit after an underscore, a scalar Fs."""
    write_columns(path.with_suffix(".mat"), {**fast, **other, "Fs": 1.0 / float(time[1] - time[0])})


def _lvm(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """LabVIEW's text with a row of units, spelt out."""
    units = {"Prox": "um", "LC": "Newtons", "Acc": "g", "TC1": "Deg F", "Tach": "RPM"}
    channels = {}
    for name, values in (fast | other).items():
        channels[name] = (units[name.replace("_", " ").split()[0]], values)
    write_groups(path.with_suffix(".lvm"), (time, channels))


def _parquet(path: Path, time: np.ndarray, fast: Table, other: Table) -> None:
    """A data frame, units in the names of its columns."""
    write_columns(path.with_suffix(".parquet"), {"time (s)": time, **fast, **other})


def _named(dynamic: str, dry: str, sweep: str) -> Callable[[Planned], str]:
    def title(test: Planned) -> str:
        form = {"dynamic": dynamic, "dry": dry, "clearance": sweep}[test.kind]
        kn, lbf, kgf = f"{test.load / 1e3:g}", f"{test.load / LBF:.0f}", f"{test.load / KGF:.0f}"
        return form.format(
            kn=kn, lbf=lbf, kgf=kgf, n=f"{test.load:.0f}", f=f"{test.frequency:g}", pad=test.pad, i=test.number
        )

    return title


def _numbered(test: Planned) -> str:
    """A counter alone, as a logger names its files."""
    place = {"clearance": 1, "dry": 1 + test.pad, "dynamic": 6 + test.number}[test.kind]
    return f"Test_{place:03d}"


def _rig(names: dict[str, str], axes: tuple[float, float], gains: dict[str, float], zero: float = 0.0,
         cold: float = 0.0) -> tuple[Sensor, ...]:  # fmt: skip
    """Two probes, two cells, two accelerometers, a thermometer and a tachometer."""
    first, second = axes
    g = gains
    return (
        Sensor(names["x"], "displacement", first, g["x"], zero),
        Sensor(names["y"], "displacement", second, g["x"], zero),
        Sensor(names["fx"], "force", 0.0, g["f"]),
        Sensor(names["fy"], "force", 90.0, g["f"]),
        Sensor(names["ax"], "acceleration", 0.0, g["a"]),
        Sensor(names["ay"], "acceleration", 90.0, g["a"]),
        Sensor(names["t"], "temperature", 0.0, g["t"], cold),
        Sensor(names["n"], "speed", 0.0, g["n"]),
    )


def _channels(text: str) -> dict[str, str]:
    names = [part.strip() for part in text.split(",")]
    return dict(zip(("x", "y", "fx", "fy", "ax", "ay", "t", "n"), names, strict=True))


_MASS = {("housing", "mass"): "30 kg"}
LABORATORIES = (
    Laboratory(
        "German CSV, volts",
        _rig(_channels("Weg 1, Weg 2, Kraft H, Kraft V, Beschl H, Beschl V, Temp Pad 1, Drehzahl"), (45.0, 135.0),
             {"x": -7874.0, "f": 5e-4, "a": 0.1 / G, "t": 0.05, "n": 0.1}, zero=-9.5),
        _named("Dyn_{kn}kN_{f}Hz_{i:02d}", "Pad{pad}_Stufen", "Spiel_01"),
        _german,
        edits=_MASS | {("Weg 1", "sensitivity"): "7.874 mV/um", ("Kraft H", "sensitivity"): "0.5 mV/N",
                       ("Beschl H", "sensitivity"): "100 mV/g", ("Temp Pad 1", "sensitivity"): "50 mV/K",
                       ("Temp Pad 1", "zero"): "0 degC"},
    ),
    Laboratory(
        "TDMS of two devices",
        _rig(_channels("Gap A, Gap B, Load H, Load V, Acc H, Acc V, Oil temp, Speed"), (225.0, 315.0),
             {"x": 1e6, "f": 1.0, "a": 1.0, "t": 1.0, "n": 60.0}),
        _numbered,
        _tdms,
        edits=_MASS,
    ),
    Laboratory(
        "MATLAB, units in names",
        _rig(_channels("probe1_um, probe2_um, Fx_N, Fy_N, acc_x_g, acc_y_g, T1_degC, n_rpm"), (-60.0, 30.0),
             {"x": 1e6, "f": 1.0, "a": 1.0 / G, "t": 1.0, "n": 60.0}),
        _named("dyn_{n}N_{f}Hz_{i}", "dry_pad{pad}", "clearance"),
        _matlab,
        edits=_MASS,
    ),
    Laboratory(
        "LVM, row of units",
        _rig(_channels("Prox Horiz, Prox Vert, LC_H, LC_V, Acc_H, Acc_V, TC1, Tach"), (-45.0, 45.0),
             {"x": 1e6, "f": 1.0, "a": 1.0 / G, "t": 1.8, "n": 60.0}, cold=32.0),
        _named("{kn}kN-{f}Hz-{i}", "pad {pad} steps", "clearance sweep"),
        _lvm,
        edits=_MASS,
    ),
    Laboratory(
        "Parquet, mil and lbf",
        _rig(_channels("Prox 45L (mil), Prox 45R (mil), LC_H (lbf), LC_V (lbf), Acc H (g), Acc V (g), Oil (degF), "
                       "Speed (rpm)"),
             (135.0, 45.0), {"x": 1 / MIL, "f": 1 / LBF, "a": 1.0 / G, "t": 1.8, "n": 60.0}, cold=32.0),
        _named("dyn_{lbf}lbf_{f}Hz_{i}", "pad{pad}_dry_steps", "clearance_sweep"),
        _parquet,
        loads=(674 * LBF, 1349 * LBF),
        edits=_MASS,
    ),
    Laboratory(
        "CSV of two devices, times of day",
        _rig(_channels("Abstand oben links [mil], Abstand oben rechts [mil], Stützkraft waagrecht [kgf], "
                       "Stützkraft senkrecht [kgf], Gehäuse waagrecht [m/s²], Gehäuse senkrecht [m/s²], "
                       "Öltemperatur [°C], Welle [U/min]"),
             (135.0, 45.0), {"x": 1 / MIL, "f": 1 / KGF, "a": 1.0, "t": 1.0, "n": 60.0}),
        _named("Erregung {kgf}kgf {f}Hz Nr {i:02d}", "Kippsegment {pad} trocken", "Lagerspiel"),
        _times_of_day,
        loads=(306 * KGF, 612 * KGF),
        edits=_MASS,
    ),
)  # fmt: skip
