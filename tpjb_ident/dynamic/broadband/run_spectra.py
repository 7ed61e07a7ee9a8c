"""One broadband run as phasors: of every period of a periodic excitation, or of the whole record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from rigdata.vector import directions, inverse_directions
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.clock_rate import ClockRate, clock_rates, with_one_clock
from tpjb_ident.dynamic.broadband.disturbing_lines import (
    LEFT_OUT,
    LEFT_OUT_OF_PERIOD,
    Disturbance,
    bins_taken,
    find_disturbances,
    without_disturbances,
)
from tpjb_ident.dynamic.broadband.period import find_period, resampled
from tpjb_ident.dynamic.broadband.samples import Samples, read_samples
from tpjb_ident.dynamic.runs.point_data import mean_temperatures
from tpjb_ident.phasors.compensation import SlowerChannel, channel_gains, inspect_readings
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_data import QUANTITIES, RunPhasors, oil_force, vector_channels
from tpjb_ident.terms.clock import START

#: Kinds that may repeat themselves; those that never do are not asked.
_MAY_REPEAT = ("multisine", "random", "sweep")
#: Kinds whose records may begin and end in motion; a hammer waits for rest.
OPEN_ENDS = ("multisine", "random", "sweep")


@dataclass(frozen=True)
class RunSpectra:
    """Phasors of one run over the band."""

    phasors: RunPhasors
    D: ComplexArray  #: (n_windows, n_bins, 2) complex, m
    F: ComplexArray  #: (n_windows, n_bins, 2) complex, N
    A: ComplexArray  #: (n_windows, n_bins, 2) complex, m/s^2
    command: ComplexArray | None  #: (n_windows, n_bins, 2) complex
    frequencies: FloatArray  #: (n_bins,), Hz
    taken: BoolArray  #: (n_bins,): bins that lines of shaft or mains may have spoiled
    disturbances: tuple[Disturbance, ...]
    period: float | None
    mean_load: FloatArray  #: (2,), N
    position: FloatArray  #: (2,), m
    temperatures: dict[int, float]
    start: float = 0.0

    @property
    def amplitude(self) -> float:
        """Of a sine that moves the shaft as much as all bins of the band together do [m]."""
        return float(np.sqrt(np.sum(np.mean(np.abs(self.D) ** 2, axis=0))))


@dataclass(frozen=True)
class SpectraSettings:
    """How runs become spectra."""

    band: tuple[float, float]
    seconds: float | None
    mains: float
    delays: dict[str, float]
    clocks: dict[str, ClockRate] = field(default_factory=dict)


def run_clocks(run: Run, settings: SpectraSettings) -> dict[str, ClockRate]:
    """What one run shows of the rates of its clocks."""
    with run.opened():
        samples = read_samples(run, settings.seconds)
    lines = find_disturbances(samples, run.point.shaft_speed_hz, settings.mains, settings.band[1])
    return clock_rates(samples, settings.band, lines)


def run_spectra(run: Run, housing_mass: float, settings: SpectraSettings) -> RunSpectra:
    """Read one run and transform it."""
    with run.opened():
        slower, conditions = inspect_readings(run)
        samples = read_samples(run, settings.seconds)
        temperatures = mean_temperatures(run)
    if settings.band[1] >= 0.45 * samples.rate:
        text = f"the band reaches {settings.band[1]:g} Hz, more than 0.45 of the sample rate of {samples.rate:g} Hz"
        raise _error(run, "excitation_band", text, "Sample faster, or excite lower frequencies")
    means = samples.values["force"].mean(axis=1), samples.values["displacement"].mean(axis=1)
    lines = find_disturbances(samples, run.point.shaft_speed_hz, settings.mains, settings.band[1])
    samples, clocks = with_one_clock(samples, settings.clocks), settings.clocks
    period = _period(run, samples, settings.band, lines)
    if period is None:
        clean, length = without_disturbances(samples, lines), samples.length
    else:
        cut = resampled(samples, period, settings.band[1])
        length = round(period)
        clean = without_disturbances(cut, lines, length)
    result = _transformed(run, clean, length, housing_mass, settings)
    phasors = _without_responses(result, run, slower)
    phasors = replace(phasors, conditions=merged(samples.conditions, conditions, _clock_conditions(clocks)))
    frequencies = phasors.lines.frequencies
    phasors = phasors.advanced(settings.delays)
    a = None if phasors.acceleration is None else phasors.acceleration.phasors
    F = oil_force(phasors.cell_force.phasors, a, housing_mass)
    D = phasors.displacement.phasors
    command = None if clean.command is None else _bins(clean.command, length, _places(clean.rate, length, settings))
    return RunSpectra(
        phasors,
        D,
        F,
        np.zeros_like(D) if a is None else a,
        command,
        frequencies,
        bins_taken(frequencies, lines, length / clean.rate, LEFT_OUT if period is None else LEFT_OUT_OF_PERIOD),
        lines,
        None if period is None else length / clean.rate,
        *means,
        temperatures,
        START / samples.rate if "force" in clocks else 0.0,
    )


def _clock_conditions(clocks: dict[str, ClockRate]) -> tuple[Condition, ...]:
    """What to say of clocks that differ."""
    if not clocks:
        return ()
    told = ", ".join(f"{q} {1e6 * c.rate:+.1f} ppm (standard error {1e6 * c.error:.1f})" for q, c in clocks.items())
    return (Condition("clocks-differ", f"against the probes' clock: {told}; put right from the start of each record"),)


def _error(run: Run, place: str, what: str, cure: str) -> RigDataError:
    return RigDataError(Problem("error", run.file, place, what, cure, run.id))


def _period(run: Run, samples: Samples, band: tuple[float, float], lines: tuple[Disturbance, ...]) -> float | None:
    if run.excitation_kind not in _MAY_REPEAT:
        return None
    frequency = np.asarray(np.fft.rfftfreq(samples.length, 1 / samples.rate), dtype=float)
    period = find_period(samples, band, bins_taken(frequency, lines, samples.length / samples.rate))
    if period is None and run.excitation_kind == "multisine":
        text = "a multi-sine, but no period is found that the record holds three times"
        raise _error(run, "excitation", text, 'Record longer; or state excitation = "random" if it does not repeat')
    return period


def _places(rate: float, length: int, settings: SpectraSettings) -> IntArray:
    """Numbers of the bins of the band."""
    frequency = np.fft.rfftfreq(length, 1 / rate)
    low, high = settings.band
    edge = 1e-6 * rate / length
    return np.flatnonzero((frequency >= low - edge) & (frequency <= high + edge) & (frequency > 0))


def _bins(rows: FloatArray, length: int, places: IntArray) -> ComplexArray:
    """Phasors (n_windows, n_bins, 2) of rows (2, n) in stretches of `length` samples."""
    folded = rows.reshape(2, -1, length)
    spectra = np.fft.rfft(folded, axis=2)[:, :, places] * (2.0 / length)
    return np.asarray(spectra.transpose(1, 2, 0))


def _transformed(run: Run, samples: Samples, length: int, housing_mass: float, settings: SpectraSettings) -> RunPhasors:
    """Phasors as recorded."""
    places = _places(samples.rate, length, settings)
    frequency = np.fft.rfftfreq(length, 1 / samples.rate)[places]
    quantities = tuple(q for q in QUANTITIES if q in samples.values)
    z = np.concatenate([_bins(samples.values[q], length, places) for q in quantities], axis=2)
    windows = samples.length // length
    lines = LineSet(tuple(Line("excitation", float(f)) for f in frequency), (), (), run.point.shaft_speed_hz)
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        np.arange(windows) * length / samples.rate,
        length / samples.rate,
        vector_channels(quantities),
        z,
        np.zeros((windows, z.shape[2])),
        np.full((windows, z.shape[2]), np.nan),
        np.zeros((windows, z.shape[2])),
        housing_mass,
        np.full(windows, np.nan),
    )


def _without_responses(result: RunPhasors, run: Run, slower: dict[str, SlowerChannel]) -> RunPhasors:
    """Phasors of X and Y as channels without filters and delays would have given them.

    With P the matrix from readings to X, Y, U that from X, Y to readings and g the channels' complex gains at a line,
    P diag(1/g) U undoes them; exact for two channels.
    """

    def undone(quantity: str, phasors: ComplexArray) -> ComplexArray:
        chosen = [c for c in run.channels.values() if c.quantity == quantity and c.axis is not None]
        gains = channel_gains(run, chosen, slower, result.lines)
        if gains is None:
            return phasors
        axes = tuple(float(c.axis or 0.0) for c in chosen)
        undo = np.einsum("ac,lc,cb->lab", inverse_directions(axes), 1 / gains, directions(axes))
        return np.asarray(np.einsum("lab,nlb->nla", undo, phasors))

    return result.changed(undone)
