"""Good campaigns of the virtual rig, for tests and benchmarks that spoil, kill, fill or repeat something.

Two linear bearings: `stiff_rig` for what is judged by `check` (five pads from no bearing file), `rocker_rig` for whole
commands (the rocker bearing file, three temperatures). Everything random hangs on the seed.

A test that only reads its campaign takes the fixture `campaign_of` (tests/conftest.py) instead of writing one:

    def test_something(campaign_of):
        path = campaign_of(rocker_rig(3))                       # .../campaign.h5
        folder = campaign_of(rocker_rig(3), "csv-german")       # .../campaign/

The file is written by the first test of the whole run that asks for this content, whichever worker it is on: truth,
plan, instruments, noise, faults, seed, names and layout together are the key (`content_key`). Nothing else is: give the
same rig the same way in several tests, and it is computed once. The file is read-only and shared; what spoils, renames
or adds to a campaign copies it first (`shutil.copy`, `shutil.copytree`) or has its own `written`. A rig of another kind
is shared by `once(session_folder / NAME, write)`.
"""

import hashlib
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import (
    ClearanceSweep,
    DryTest,
    Fault,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    VirtualRig,
    locus_points,
    operating_points,
    write_campaign,
)
from rigdata.virtual_rig.campaign import CsvLayout, csv_layout

BEARINGS = Path(__file__).resolve().parents[1] / "model" / "bearings"
#: The sample campaigns of an independent program, for tests marked `samples`.
SHARED = Path(__file__).resolve().parents[2] / "shared"
SAMPLES = SHARED / "samples"
STIFFNESS = np.array([[3.0e8, 0.2e8], [-0.3e8, 4.5e8]])
DAMPING = np.array([[5e5, 2e4], [1e4, 7e5]])
#: Of a bearing with strong cross coupling, for the tests of the virtual rig itself.
CROSS_STIFFNESS = np.array([[2.0e8, 1.3e7], [-1.1e7, 4.0e8]])
CROSS_DAMPING = np.array([[4.0e5, 2.0e4], [1.0e4, 6.0e5]])
#: Of the rig with the rocker bearing file.
ROCKER_STIFFNESS = np.array([[1.0e8, 2e6], [1e6, 2.0e8]])
ROCKER_DAMPING = np.array([[5e5, 1e4], [1e4, 7e5]])


def directions(count: int) -> tuple[float, ...]:
    """Directions of excitation, evenly over half a turn [rad]."""
    return tuple(math.radians(180.0 / count * i) for i in range(count))


#: One operating point in six directions, and one or some of every other kind of run.
PLAN = RigPlan(
    dynamic=operating_points([(5000.0, 25.0)]),
    directions=directions(6),
    locus=locus_points(6),
    dry=tuple(DryTest(p, levels=(1000.0, 3000.0), hold=0.3) for p in range(1, 6)),
    clearance=(ClearanceSweep(seconds=6.0),),
    locus_seconds=1.0,
)
#: The dynamic run of `PLAN` that faults strike.
RUN = "d-05000-25-03"
#: A little of everything, for whole commands.
SMALL_PLAN = RigPlan(
    dynamic=operating_points([(5000.0, 25.0)]),
    directions=directions(3),
    locus=locus_points(3, load=1000.0),
    dry=tuple(DryTest(p, levels=(500.0, 1000.0, 2000.0, 3000.0), hold=0.3) for p in range(1, 6)),
    clearance=(ClearanceSweep(seconds=6.0),),
    dynamic_seconds=1.0,
)


def stiff_rig(seed: int, *faults: Fault, plan: RigPlan = PLAN, noise: Noise | None = None, **truth: Any) -> VirtualRig:
    """A rig for `check`; `truth` are arguments of `RigTruth.constant` besides, or in place of, K and C."""
    made = RigTruth.constant(**{"k": STIFFNESS, "c": DAMPING, **truth})
    return VirtualRig(made, plan, noise=noise or Noise.like_samples(), faults=faults, seed=seed)


def rocker_rig(seed: int, *faults: Fault, plan: RigPlan = SMALL_PLAN, **names: str) -> VirtualRig:
    """A rig that carries the rocker bearing's file; `names` are `campaign` and `description`."""
    text = (BEARINGS / "rocker.toml").read_text("utf-8")
    truth = RigTruth.constant(ROCKER_STIFFNESS, ROCKER_DAMPING, bearing_name="rocker.toml", bearing_text=text)
    instruments = Instruments.like_paper(5, 3)
    return VirtualRig(truth, plan, instruments, Noise.like_samples(), faults=faults, seed=seed, **names)


def sample(name: str) -> Path:
    """A sample campaign: its folder, or its file."""
    return SAMPLES / name if (SAMPLES / name).is_dir() else SAMPLES / f"{name}.h5"


def written(path: Path, rig: VirtualRig, layout: str | CsvLayout = "hdf5") -> Path:
    """Write a rig's campaign; its path."""
    write_campaign(path, rig, layout)
    return path


def shared_campaign(folder: Path, rig: VirtualRig, layout: str | CsvLayout = "hdf5", name: str = "campaign") -> Path:
    """The read-only campaign of `rig` in `folder`, written by the first who asks; see the top of this file."""
    csv = csv_layout(layout)
    place = folder / f"campaign-{content_key(rig, csv)}"
    place.mkdir(exist_ok=True)
    return once(place / (f"{name}.h5" if csv is None else name), lambda path: _read_only(written(path, rig, layout)))


def _read_only(path: Path) -> None:
    for file in [path, *path.rglob("*")]:
        if file.is_file():
            file.chmod(0o444)


def content_key(rig: VirtualRig, layout: CsvLayout | None) -> str:
    """What a campaign is made of, as a hash: plain fields by what they print, laws by their values at the points."""
    digest = hashlib.sha256(repr(layout).encode())
    truth = rig.truth
    for part in (rig.plan, rig.instruments, rig.noise, *rig.faults):
        digest.update(f"{type(part).__name__} {asdict(part)}".encode())
    plain = (rig.seed, rig.campaign, rig.description, truth.pivot_angles, truth.clearance)
    digest.update(f"{plain} {truth.bearing_name} {truth.bearing_text} {truth.cold_temperature}".encode())
    for point in _probed(rig):
        for law in (truth.stiffness, truth.position, truth.temperature):
            digest.update(np.asarray(law(point), dtype=complex).tobytes())
    for pad in range(1, len(truth.pivot_angles) + 1):
        digest.update(np.asarray(truth.pivot_deflection(pad, np.linspace(0.0, 2e4, 41)), dtype=float).tobytes())
    return digest.hexdigest()[:20]


def _probed(rig: VirtualRig) -> Iterator[OperatingPoint]:
    """Every planned point, and one a little off: a rig that misses its set points asks the laws there."""
    for point in dict.fromkeys(run.point for run in rig.runs if run.test is None):
        yield point
        yield replace(
            point,
            static_load=1.01 * point.static_load,
            static_load_direction=point.static_load_direction + 0.01,
            shaft_speed=1.01 * point.shaft_speed,
            excitation=1.01 * point.excitation,
        )


def once(path: Path, write: Callable[[Path], object], patience: float = 120.0) -> Path:
    """Let one of several workers write `path`, the others wait for it; after `patience` [s] one that waits writes."""
    lock = path.with_name(f"{path.name}.lock")
    began = time.monotonic()
    while not path.exists():
        try:
            os.close(os.open(lock, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            if time.monotonic() - began < patience:
                time.sleep(0.05)
                continue
        made = path.with_name(f"{os.getpid()}-{path.name}")
        write(made)
        made.replace(path)
    return path
