"""Mains pick-up of dry runs: which channels are exchanged or reversed.

Every channel picks up the mains with a strength and phase of its own, which belong to its cable and amplifier and are
the same in every run; only the mains' own phase changes. So the pattern of complex amplitudes over the channels, free
of one common factor, is a signature, and an exchange or a reversal at the recorder changes it in a known way. A probe
exchanged together with its cable and amplifier keeps its signature: that cannot be seen here.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft, ndimage

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.manifest.fields import MAINS_FREQUENCIES

_AROUND = 0.35  # [Hz] in which the mains is looked for
_SMOOTH = 0.1  # [s]: whole periods of either, so that taking off the running mean leaves the pick-up whole
_NOISE_FROM, _NOISE_TO = 1.0, 4.0  # [Hz] off the mains, where noise is measured
_SHORTEST = 3.0  # [s] of record
_MATCHES = 30.0  # chi-square below which two runs show one signature (6 degrees of freedom; by chance above: 4e-5)
_CLEARER = 25.0  # by which a mistake undone must lower it


@dataclass(frozen=True)
class PickupSignature:
    """Mains line in every channel of a run."""

    channels: tuple[str, ...]
    size: ComplexArray  #: (n,) amplitude, in the channel's unit
    noise: FloatArray  #: (n,) standard deviation of the amplitude


def measure_pickup(values: Mapping[str, FloatArray], good: BoolArray, rate: float) -> PickupSignature | None:
    """Mains line in the channels (n,) of one run at `rate` [Hz]; only samples that are `good` (n,) take part."""
    n = len(good)
    if n < _SHORTEST * rate or rate < 2.2 * max(MAINS_FREQUENCIES) or good.sum() < 0.5 * n:
        return None
    index, window = np.arange(n), np.hanning(n) * good
    rows = np.array([np.interp(index, index[good], column[good]) for column in values.values()])
    width = max(int(_SMOOTH * rate + 0.5), 3)
    quick = (rows - ndimage.uniform_filter1d(rows, width, mode="nearest")) * window
    length = fft.next_fast_len(3 * n, real=True)
    spectra = fft.rfft(quick, n=length) * (2.0 / window.sum())
    frequency = np.arange(spectra.shape[1]) * rate / length
    signature, strength = None, 0.0
    for mains in MAINS_FREQUENCIES:
        distance = np.abs(frequency - mains)
        beside = (distance > _NOISE_FROM) & (distance < _NOISE_TO)
        noise = np.sqrt(np.mean(np.abs(spectra[:, beside]) ** 2, axis=1))
        power = np.sum(np.abs(spectra / np.maximum(noise, 1e-300)[:, None]) ** 2, axis=0)
        peak = np.argmax(np.where(distance < _AROUND, power, 0.0))
        if power[peak] > strength:
            strength, signature = power[peak], PickupSignature(tuple(values), spectra[:, peak], noise)
    return signature


def mistake(
    signature: PickupSignature, others: Sequence[PickupSignature], pairs: Sequence[Sequence[str]]
) -> tuple[str, int] | None:
    """The mistake that, undone, makes a signature that of most others it now differs from, and how many these are."""
    names, size = signature.channels, signature.size
    variants = {}  # with every simple mistake undone
    for pair in pairs:
        order, places = np.arange(len(names)), [names.index(name) for name in pair]
        order[places] = places[::-1]
        exchanged = replace(signature, size=size[order], noise=signature.noise[order])
        variants[f"{pair[0]} and {pair[1]} are exchanged"] = exchanged
    for place, name in enumerate(names):
        sign = np.where(np.arange(len(names)) == place, -1.0, 1.0)
        variants[f"{name} is reversed"] = replace(signature, size=size * sign)
    alike = [other for other in others if other.channels == names]
    sizes = [_mismatch(signature, other) for other in alike]
    limits = [min(_MATCHES, size - _CLEARER) if size > _MATCHES else 0.0 for size in sizes]
    agree = {}
    for words, variant in variants.items():
        agree[words] = sum(_mismatch(variant, other) < limit for other, limit in zip(alike, limits, strict=True))
    likeliest = max(agree, key=lambda words: agree[words])
    return (likeliest, agree[likeliest]) if agree[likeliest] >= max(2, math.ceil(len(alike) / 2)) else None


def _mismatch(a: PickupSignature, b: PickupSignature) -> float:
    """Chi-square of one signature being the other's, times one complex factor."""
    variance = b.noise**2
    for _ in range(3):
        factor = complex(np.vdot(b.size / variance, a.size) / np.vdot(b.size / variance, b.size))
        variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
    return 2.0 * np.sum(np.abs(a.size - factor * b.size) ** 2 / variance)
