"""Campaigns of long records for throughput measurements: eight channels at 10 kHz, written quickly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE = 10_000.0
H = np.array([[2e8 + 6e7j, 2e7 + 3e6j], [-1.5e7 + 2e6j, 5e8 + 9e7j]])
#: name, quantity, axis [deg], unit, SI value of a unit, size of the disturbing lines in the unit
CHANNELS = (
    ("X1A", "displacement", 45.0, "um", 1e-6, 0.3),
    ("X2A", "displacement", 135.0, "um", 1e-6, 0.3),
    ("L1H", "force", 0.0, "N", 1.0, 30.0),
    ("L2V", "force", 90.0, "N", 1.0, 30.0),
    ("A1H", "acceleration", 0.0, "m/s^2", 1.0, 0.005),
    ("A2V", "acceleration", 90.0, "m/s^2", 1.0, 0.005),
)
HEAD = """schema = "tpjb-rig/1"
id = "long"
bearing = "none.toml"
[housing]
mass = "30 kg"
[channels.K1]
quantity = "speed"
unit = "Hz"
[channels.T1]
quantity = "temperature"
pad = 1
unit = "degC"
"""


def columns(run: int, n_runs: int, samples: int) -> dict[str, np.ndarray]:
    """Readings of one run: excitation at 25 Hz in the run's direction, 1X, 2X, mains, noise, 16-bit steps."""
    rng = np.random.default_rng([2026, run])
    time = np.arange(samples) / RATE
    angle = np.pi * run / n_runs
    force = 500 * np.exp(1j * run) * np.array([np.cos(angle), np.sin(angle)])
    motion = {"force": force, "displacement": np.linalg.solve(H, force), "acceleration": np.zeros(2, dtype=complex)}
    lines = [np.exp(2j * np.pi * f * time) for f in (25.0, 22.0, 44.0, 50.0)]
    result = {}
    for name, quantity, axis, _, unit, size in CHANNELS:
        along = np.array([np.cos(np.radians(axis)), np.sin(np.radians(axis))])
        z = [motion[quantity] @ along / unit, *(size * (rng.standard_normal(3) + 1j * rng.standard_normal(3)))]
        values = sum((a * line).real for a, line in zip(z, lines)) + 0.1 * size * rng.standard_normal(samples)
        values += 5000.0 * (name == "L2V")
        step = 3e-4 * size * 10
        result[name] = np.round(values / step) * step
    result["K1"] = 22 + 0.01 * rng.standard_normal(samples)
    result["T1"] = 50 + 0.01 * rng.standard_normal(samples)
    return result


def manifest(n_runs: int, suffix: str = "") -> str:
    """Text of campaign.toml."""
    text = HEAD
    for name, quantity, axis, unit, _, _ in CHANNELS:
        text += (
            f'[channels.{name}]\nquantity = "{quantity}"\naxis = "{axis} deg"\nunit = "{unit}"\nuncertainty = "1 %"\n'
        )
    for run in range(n_runs):
        text += (
            f'[[runs]]\nid = "d{run}"\nfile = "d{run}{suffix}"\nkind = "dynamic"\nshaft_speed = "22 Hz"\n'
            f'static_load = "5 kN"\nstatic_load_direction = "-90 deg"\nexcitation_frequency = "25 Hz"\n'
            f'excitation_direction = "{180 * run / n_runs} deg"\n'
        )
    return text


def write_hdf5(path: Path, n_runs: int, seconds: float, packed: bool = True) -> int:
    """Write a campaign of float32 datasets; return the bytes of its readings."""
    import h5py

    options = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "chunks": (8192,)} if packed else {}
    size = 0
    with h5py.File(path, "w") as file:
        file.attrs["manifest"] = manifest(n_runs)
        for run in range(n_runs):
            group = file.create_group(f"runs/d{run}")
            group.attrs["sample_rate_hz"] = RATE
            for name, values in columns(run, n_runs, round(seconds * RATE)).items():
                size += group.create_dataset(name, data=values.astype(np.float32), **options).nbytes
    return size


def write_csv(folder: Path, seconds: float) -> int:
    """Write a campaign of one decimal-comma run with semicolons, cp1252, CRLF; return the bytes of the run."""
    folder.mkdir(parents=True)
    text = manifest(1, ".csv").replace("[housing]", '[acquisition]\nsample_rate = "10 kHz"\n[housing]')
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    data = columns(0, 1, round(seconds * RATE))
    table = np.column_stack(list(data.values()))
    with (folder / "d0.csv").open("w", encoding="cp1252", newline="") as file:
        file.write("Prüfstand\r\n" + ";".join(data) + "\r\n" + ";".join(["V"] * len(data)) + "\r\n")
        for first in range(0, len(table), 10_000):
            rows = (";".join(f"{v:.6f}" for v in row) for row in table[first : first + 10_000])
            file.write("\r\n".join(rows).replace(".", ",") + "\r\n")
    return (folder / "d0.csv").stat().st_size
