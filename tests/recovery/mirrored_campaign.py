"""A campaign as a mirror along the y axis shows it, file by file: its shaft turns the other way, nothing else differs.

Texts and numbers are changed as a person would change them; nothing of the toolkit is used. Cells and accelerometers
along x keep their axis, and their readings change sign; all other channels get the mirrored axis.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import h5py

_ANGLES = re.compile(r'^(axis|static_load_direction|excitation_direction) = "([-+.\d]+) deg"', re.MULTILINE)
_SENSE = re.compile(r'^rotation = "(.*)"', re.MULTILINE)
_CHANNEL = re.compile(r"^\[channels\.(\w+)\]$", re.MULTILINE)


def _turned(degrees: str) -> str:
    return f"{(360.0 - float(degrees)) % 360.0 - 180.0:.12g}"


def _turning_back(text: str) -> str:
    return _SENSE.sub(lambda found: f'rotation = "{"counter-" if found[1] == "clockwise" else ""}clockwise"', text)


def mirrored_manifest(text: str, pads: int) -> tuple[str, set[str]]:
    """The manifest, and the channels whose readings change sign."""
    negated = set()
    blocks = re.split(r"^(?=\[)", text, flags=re.MULTILINE)
    for i, block in enumerate(blocks):
        channel = _CHANNEL.match(block)
        if channel and 'axis = "0 deg"' in block:
            negated.add(channel[1])
        else:
            block = _ANGLES.sub(lambda found: f'{found[1]} = "{_turned(found[2])} deg"', block)
        blocks[i] = re.sub(
            r"^pad = (\d+)", lambda found: f"pad = {pads + 1 - int(found[1])}", block, flags=re.MULTILINE
        )
    text = _turning_back("".join(blocks))
    if "[shaft]" not in text:
        text = text.replace("[", '[shaft]\nrotation = "clockwise"\n\n[', 1)
    return text, negated


def mirrored_bearing(text: str) -> tuple[str, int]:
    """The bearing file, and its number of pads: angles in the mirror, lists in reverse order."""
    pads = 0

    def turn(found: re.Match[str]) -> str:
        nonlocal pads
        entries = [entry.strip() for entry in found[2].split(",")][::-1]
        if found[1] == "pivot_angles":
            pads = len(entries)
            entries = [f'"{_turned(entry.strip(chr(34)).removesuffix(" deg"))} deg"' for entry in entries]
        return f"{found[1]} = [{', '.join(entries)}]"

    return _turning_back(re.sub(r"^(\w+) = \[(.*?)\]", turn, text, flags=re.MULTILINE)), pads


def mirror_campaign(source: Path, target: Path) -> Path:
    """Write the mirror image of a campaign, one HDF5 file."""
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        bearing, pads = mirrored_bearing(str(file.attrs["bearing"]))
        manifest, negated = mirrored_manifest(str(file.attrs["manifest"]), pads)
        file.attrs["bearing"], file.attrs["manifest"] = bearing, manifest
        for run in file["runs"].values():
            for name in negated & set(run):
                run[name][...] = -run[name][...]
    return target
