"""Mains pick-up as a channel's signature: exchanged or reversed channels that no movement gives away.

A dry test toward a pad on the mirror line of two probes looks the same with the probes exchanged: its movement lies
along that line, and where both gap voltages are alike the shaft also seems to stand where it stood. But every channel
picks up the mains with a strength and phase of its own, which belong to its cable and amplifier and are the same in
every run; only the mains' own phase changes. So the pattern of complex amplitudes over the channels, free of one common
factor, is a signature, and an exchange or a reversal at the recorder changes it in a known way.

A probe exchanged together with its cable and amplifier keeps its signature: that cannot be seen here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage

from rigdata.manifest.manifest import MAINS_FREQUENCIES
from tpjb_ident.arrays import BoolArray, ComplexArray, FloatArray

AROUND = 0.35  # [Hz] in which the mains is looked for
SMOOTH = 0.1  # [s]: whole periods of either, so that taking off the running mean leaves the pick-up whole
NOISE_FROM, NOISE_TO = 1.0, 4.0  # [Hz] off the mains, where noise is measured
SHORTEST = 3.0  # [s] of record
MATCHES = 30.0  # chi-square below which two runs show one signature (6 degrees of freedom; by chance above: 4e-5)
CLEARER = 25.0  # by which a mistake undone must lower it


@dataclass(frozen=True)
class PickupSignature:
    """Mains line in every channel of a run."""

    channels: tuple[str, ...]
    size: ComplexArray
    noise: FloatArray


@dataclass(frozen=True)
class Mistake:
    """What a signature says of a run."""

    what: str
    agree: int


def measure_pickup(values: Mapping[str, FloatArray], good: BoolArray, rate: float) -> PickupSignature | None:
    """Mains line in the channels of one run."""
    n = len(good)
    if n < SHORTEST * rate or rate < 2.2 * max(MAINS_FREQUENCIES) or good.sum() < 0.5 * n:
        return None
    index = np.arange(n)
    window = np.hanning(n) * good
    width = max(int(SMOOTH * rate + 0.5), 3)
    rows = []
    for column in values.values():
        whole = column if good.all() else np.interp(index, index[good], column[good])
        rows.append((whole - ndimage.uniform_filter1d(whole, width, mode="nearest")) * window)
    length = fft.next_fast_len(3 * n, real=True)
    spectra = fft.rfft(np.array(rows), n=length, axis=1) * (2.0 / window.sum())
    frequency = np.arange(spectra.shape[1]) * rate / length
    best: PickupSignature | None = None
    strength = 0.0
    for mains in MAINS_FREQUENCIES:
        off = np.abs(frequency - mains)
        noise = np.sqrt(np.mean(np.abs(spectra[:, (off > NOISE_FROM) & (off < NOISE_TO)]) ** 2, axis=1))
        power = np.sum(np.abs(spectra / np.maximum(noise, 1e-300)[:, None]) ** 2, axis=0)
        peak = int(np.argmax(np.where(off < AROUND, power, 0.0)))
        if power[peak] > strength:
            strength = float(power[peak])
            best = PickupSignature(tuple(values), spectra[:, peak], noise)
    return best


def mistakes(pickups: Sequence[PickupSignature | None], pairs: Sequence[tuple[str, str]]) -> list[Mistake | None]:
    """What the signatures say of every run: nothing, or a mistake that most other runs confirm."""
    out: list[Mistake | None] = []
    for number, mine in enumerate(pickups):
        others = [p for k, p in enumerate(pickups) if k != number and p is not None]
        out.append(None if mine is None else _mistake(mine, others, pairs))
    return out


def _mistake(
    mine: PickupSignature, others: Sequence[PickupSignature], pairs: Sequence[tuple[str, str]]
) -> Mistake | None:
    others = [other for other in others if other.channels == mine.channels]
    stated = [(other, _mismatch(mine, other)) for other in others]
    strange = [(other, size) for other, size in stated if size > MATCHES]
    needed = max(2, math.ceil(len(others) / 2))
    if len(strange) < needed:
        return None
    found = [
        Mistake(what, sum(_mismatch(undone, other) < min(MATCHES, size - CLEARER) for other, size in strange))
        for what, undone in _undone(mine, pairs)
    ]
    best = max(found, key=lambda m: m.agree)
    return best if best.agree >= needed else None


def _undone(mine: PickupSignature, pairs: Sequence[tuple[str, str]]) -> list[tuple[str, PickupSignature]]:
    """A run's signature with every simple mistake undone."""
    out = []
    for first, second in pairs:
        i, j = mine.channels.index(first), mine.channels.index(second)
        order = np.arange(len(mine.channels))
        order[[i, j]] = j, i
        out.append(
            (f"{first} and {second} are exchanged", PickupSignature(mine.channels, mine.size[order], mine.noise[order]))
        )
    for i, name in enumerate(mine.channels):
        turned = np.ones(len(mine.channels))
        turned[i] = -1.0
        out.append((f"{name} is reversed", PickupSignature(mine.channels, mine.size * turned, mine.noise)))
    return out


def _mismatch(a: PickupSignature, b: PickupSignature) -> float:
    """Chi-square of one signature being the other's, times one complex factor."""
    factor = complex(np.vdot(b.size / b.noise, a.size / b.noise) / np.vdot(b.size / b.noise, b.size / b.noise))
    for _ in range(2):
        variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
        factor = complex(np.vdot(b.size / variance, a.size) / np.vdot(b.size / variance, b.size))
    variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
    return 2.0 * float(np.sum(np.abs(a.size - factor * b.size) ** 2 / variance))
