"""Copies of the demo campaign whose manifest or stored rate is not the one it was written with."""

import re
import shutil
from pathlib import Path

import h5py

DEMO = Path(__file__).resolve().parents[2] / "rigdata" / "samples" / "demo.h5"


def scaled_sensors(text: str, names: tuple[str, ...], factor: float) -> str:
    """The manifest with the sensitivities of some channels times a factor."""
    for name in names:
        head, _, tail = text.partition(f"[channels.{name}]")
        number = re.search(r'sensitivity = "([0-9.]+) ', tail)
        assert number is not None
        tail = tail[: number.start(1)] + f"{float(number[1]) * factor:.10g}" + tail[number.end(1) :]
        text = f"{head}[channels.{name}]{tail}"
    return text


def shortened(text: str, all_kinds: bool) -> str:
    """The demo's manifest with dynamic runs of two loads, and the others where they are wanted."""
    head, *runs = text.split("[[runs]]\n")
    chosen = []
    for run in runs:
        is_dynamic = 'kind = "dynamic"' in run
        if ('id = "d-02500-25' in run or 'id = "d-05000-25' in run) if is_dynamic else all_kinds:
            chosen.append(run)
    return "[[runs]]\n".join([head, *chosen])


def written(folder: Path, text: str, rate: float) -> Path:
    """A copy of the demo with another manifest and another stored rate."""
    path = folder / "c.h5"
    shutil.copy(DEMO, path)
    with h5py.File(path, "r+") as file:
        file.attrs["manifest"] = text
        for group in file["runs"].values():
            group.attrs["sample_rate_hz"] = rate * float(group.attrs["sample_rate_hz"])
    return path
