"""Cells or accelerometers on a clock of another rate than the probes', seen in phases that drift over the record.

A difference e turns the force's phase at f by 2 pi f e t: over 16 s at 100 Hz, 10 ppm are 0.1 rad. Pieces of the record
tell it from anything that the film does, which answers alike in all of them. All runs share it. A single sweep tells
nothing: it passes each frequency once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import inverse_directions
from tpjb_ident.bands.disturbing_lines import bins_taken
from tpjb_ident.bands.samples import Samples, interpolated
from tpjb_ident.phasors.lines import Line

#: Pieces of a record,
_PIECES = 8
#: bins of a piece next to a disturbing line that tell nothing,
_BESIDE = 3.0
#: standard errors beyond which a difference is one,
_CLEAR = 6.0
#: and phase [rad] over the record at the top of the band that it must come to.
_NOTABLE = 5e-3


@dataclass(frozen=True)
class ClockRate:
    """How much faster than the probes' clock another runs (relative), and its standard error."""

    rate: float
    error: float


def common_rates(seen: Sequence[dict[str, ClockRate]], reach: float) -> dict[str, ClockRate]:
    """Differences that runs share, by quantity; those that are clear, and matter."""
    pooled = {}
    for quantity in sorted({q for rates in seen for q in rates}):
        clocks = [rates[quantity] for rates in seen if quantity in rates and np.isfinite(rates[quantity].error)]
        if clocks:
            weight = np.array([max(clock.error, 1e-12) ** -2.0 for clock in clocks])
            rates = np.array([clock.rate for clock in clocks])
            rate = float(np.sum(weight * rates) / weight.sum())
            # a film that is not linear turns phases too, but not alike in all runs: their scatter widens the error
            scatter = float(np.sum(weight * (rates - rate) ** 2)) / max(len(rates) - 1, 1)
            pooled[quantity] = ClockRate(rate, float(np.sqrt(max(scatter, 1.0) / weight.sum())))
    clear = {q: c for q, c in pooled.items() if abs(c.rate) > _CLEAR * c.error and abs(c.rate) * reach > _NOTABLE}
    if "force" in clear and "acceleration" in pooled:
        cells, other = clear["force"], pooled["acceleration"]
        if abs(cells.rate - other.rate) < _CLEAR * np.hypot(cells.error, other.error):
            clear["acceleration"] = cells  # too weak to tell: as a rule accelerometers are recorded with the cells
        elif "acceleration" in clear:  # on neither's clock: the film turns phases where blows differ in size
            return {}
    return clear


def with_one_clock(samples: Samples, clocks: dict[str, ClockRate]) -> Samples:
    """The record as if one clock had sampled all of it."""
    rows = samples.rows.copy()
    for quantity, clock in clocks.items():
        places = samples.places(quantity)
        at = np.asarray(np.arange(samples.length) / (1 + clock.rate), dtype=float)
        mean = rows[places].mean(axis=1, keepdims=True)
        rows[places] = interpolated(rows[places] - mean, at) + mean
    return replace(samples, rows=rows)


def clock_rates(samples: Samples, band: tuple[float, float], lines: tuple[Line, ...]) -> dict[str, ClockRate]:
    """Rates of the clocks of force and acceleration against the probes', as one run shows them."""
    present = [q for q in ("force", "acceleration") if samples.places(q)]
    return {q: _clock_rate(samples, q, band, lines) for q in present}


def _clock_rate(samples: Samples, quantity: str, band: tuple[float, float], lines: tuple[Line, ...]) -> ClockRate:
    """Rate of a quantity's clock against the probes'."""
    length = samples.length // _PIECES
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / samples.rate), dtype=float)
    seconds = length / samples.rate
    used = (frequency >= band[0]) & (frequency <= band[1]) & ~bins_taken(frequency, lines, seconds, _BESIDE)
    if used.sum() < _PIECES:
        return ClockRate(0.0, np.inf)
    D, z = (_pieces(vector_rows(samples, q), length)[:, :, used] for q in ("displacement", quantity))
    cross = np.sum(z * D.conj(), axis=0)
    first, second = np.triu_indices(_PIECES, 1)
    apart = (second - first)[:, None] * seconds
    turn = cross[second] * cross[first].conj()
    weight = np.sqrt(np.abs(turn))
    weight = np.minimum(weight, 3 * np.median(weight) + 1e-300)
    lever = 2 * np.pi * frequency[used] * apart
    rate = 0.0
    for step in (1, 3, _PIECES - 1):  # from near pieces to far ones: turns wrap, and are counted from what is known
        near = (second - first) <= step
        remaining = np.angle(turn * np.exp(-1j * rate * lever))[near]
        rate += float(np.sum((weight * lever)[near] * remaining) / np.sum((weight * lever**2)[near]))
    remaining = np.angle(turn * np.exp(-1j * rate * lever))
    # bins err apart from each other, pairs of pieces do not
    scores = np.sum(weight * lever * remaining, axis=0)
    return ClockRate(rate, float(np.sqrt(np.sum(scores**2)) / np.sum(weight * lever**2)))


def vector_rows(samples: Samples, quantity: str) -> FloatArray:
    """X and Y of a quantity (2, n)."""
    places = samples.places(quantity)
    return inverse_directions(tuple(float(samples.channels[j].axis or 0.0) for j in places)) @ samples.rows[places]


def _pieces(rows: FloatArray, length: int) -> ComplexArray:
    """Spectra (2, PIECES, n) of equal pieces under a Hann window."""
    folded = rows[:, : _PIECES * length].reshape(2, _PIECES, length)
    folded = folded - folded.mean(axis=2, keepdims=True)
    return np.asarray(np.fft.rfft(folded * np.hanning(length), axis=2))
