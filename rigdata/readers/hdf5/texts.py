"""The manifest and the bearing text in an HDF5 campaign, and what the file claims to hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.problem import refuse
from rigdata.readers.base import refuse_claim
from rigdata.readers.hdf5.guards import TEXT, UNIT, broken_heap, claimed_by_runs, too_long_text
from rigdata.readers.hdf5.reader import open_readonly

_MAX_TEXT = 8 * 2**20


def read_texts(path: Path, file: str) -> tuple[str, str]:
    """Read the manifest and the bearing text from the root attributes."""
    try:
        heap = broken_heap(path)
    except OSError as error:
        raise refuse(file, "", f"cannot be read ({error.strerror or error})", "Check the path") from error
    if heap is not None:
        fault = "the file is damaged: its store of texts cannot be walked"
        raise refuse(file, f"byte {heap}", fault, "Copy the file again from the rig")
    with open_readonly(path, file) as handle:
        if "manifest" not in handle.attrs:
            raise refuse(file, "root attribute manifest", "is missing", "Store campaign.toml's text there")
        damaged = too_long_text(path, ("manifest", "bearing", *UNIT), handle.userblock_size)
        if damaged is not None:
            fault = "claims a text longer than the file"
            raise refuse(file, f"attribute {damaged}", fault, "Copy the file again from the rig")
        manifest = _text_attribute(handle, "manifest", file)
        bearing = _text_attribute(handle, "bearing", file) if "bearing" in handle.attrs else ""
    return manifest, bearing


def refuse_claims(path: Path, runs: Sequence[str], names: Sequence[str]) -> None:
    """Refuse a file whose runs claim more samples than it can hold."""
    with open_readonly(path, path.name) as handle:
        refuse_claim(claimed_by_runs(handle, runs, names), path.stat().st_size, path.name)


def _text_attribute(handle: Any, name: str, file: str) -> str:
    place, remedy = f"root attribute {name}", "Store it as one UTF-8 string"
    no_text = refuse(file, place, "is not a text, or far too long", remedy)
    stored = handle.attrs.get_id(name)
    if stored.get_storage_size() > _MAX_TEXT or stored.get_type().get_class() != TEXT:
        raise no_text
    value = handle.attrs[name]
    value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    if isinstance(value, bytes):
        try:
            value = value.decode("utf-8")
        except UnicodeDecodeError as error:
            raise refuse(file, place, "is not UTF-8 text", remedy) from error
    if not isinstance(value, str) or len(value) > _MAX_TEXT:
        raise no_text
    return value
