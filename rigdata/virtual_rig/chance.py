"""Random streams: one per run and purpose, so that a change in one place leaves all others as they were."""

from __future__ import annotations

from zlib import crc32

import numpy as np

PURPOSES = ("physics", "noise", "mains", "glitches", "dry", "faults", "campaign")


def stream(seed: int, run: str, purpose: str) -> np.random.Generator:
    """Generator for one run (by its id) and purpose; the same for the same arguments, on every machine."""
    return np.random.default_rng([seed, crc32(run.encode()), PURPOSES.index(purpose)])
