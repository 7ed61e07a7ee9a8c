"""One broadband run as phasors: of every period of a periodic excitation, or of the whole record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.bands.clock_rate import ClockRate, clock_rates, vector_rows, with_one_clock
from tpjb_ident.bands.disturbing_lines import (
    LEFT_OUT,
    LEFT_OUT_OF_PERIOD,
    bins_taken,
    find_disturbances,
    without_disturbances,
)
from tpjb_ident.bands.period import find_period, resampled
from tpjb_ident.bands.samples import Samples, read_samples
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.phasors.compensation import compensated, filled_channels, slower_condition
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.runs.point_data import mean_temperatures

#: Share of the power that a period may leave where none is stated.
_LEFT = 0.5
#: Kinds that may repeat themselves; those that never do are not asked.
_MAY_REPEAT = ("multisine", "random", "sweep")
#: Kinds whose records may begin and end in motion; a hammer waits for rest.
OPEN_ENDS = ("multisine", "random", "sweep")


def is_broadband(run: Run) -> bool:
    """Whether a run is excited over a band, not by a sine."""
    return getattr(run, "excitation_kind", "sine") != "sine"


@dataclass(frozen=True)
class RunSpectra:
    """Phasors of one run over the band: every period's, or those of the whole record's bins."""

    phasors: RunPhasors  #: channel by channel
    command: ComplexArray | None  #: (n_windows, n_bins, 2) complex
    taken: BoolArray  #: (n_bins,): bins that lines of shaft or mains may have spoiled
    disturbances: tuple[Line, ...]
    period: float | None
    mean_load: FloatArray  #: (2,), N
    position: FloatArray  #: (2,), m
    temperatures: dict[int, float]
    clocks: frozenset[str] = frozenset()  #: quantities that were recorded on a clock of their own
    rms: float = 0.0  #: m: of the motion over the band
    peak: float = 0.0  #: m: largest motion
    one_sided: float = 0.0  #: 1 where what drives goes to one side only, 0 where to both alike

    @property
    def frequencies(self) -> FloatArray:
        """Of the bins, (n_bins,) [Hz]."""
        return self.phasors.lines.frequencies

    @cached_property
    def D(self) -> ComplexArray:
        """Displacement, (n_windows, n_bins, 2) [m]."""
        return self.phasors.displacement.phasors

    @cached_property
    def F(self) -> ComplexArray:
        """Oil force by the accelerometers where there are any, (n_windows, n_bins, 2) [N]."""
        return self.phasors.oil_force(slice(None))

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
        slower = filled_channels(run)
        samples = read_samples(run, settings.seconds)
        temperatures = mean_temperatures(run)
    if settings.band[1] >= 0.45 * samples.rate:
        text = f"the band reaches {settings.band[1]:g} Hz, more than 0.45 of the sample rate of {samples.rate:g} Hz"
        raise refuse(run.file, "excitation_band", text, "Sample faster, or excite lower frequencies", run.id)
    means = {q: vector_rows(samples, q).mean(axis=1) for q in ("force", "displacement")}
    lines = find_disturbances(samples, run.point.shaft_speed_hz, settings.mains, settings.band[1])
    samples, clocks = with_one_clock(samples, settings.clocks), settings.clocks
    period = _period(run, samples, settings.band, lines)
    if period is None:
        clean, length = without_disturbances(samples, lines), samples.length
    else:
        cut = resampled(samples, period, settings.band[1])
        length = round(period)
        clean = without_disturbances(cut, lines, length)
    phasors = compensated(_transformed(run, clean, length, housing_mass, settings), run, slower, settings.delays)
    phasors = replace(
        phasors, conditions=merged(samples.conditions, slower_condition(slower), _clock_conditions(clocks))
    )
    command = None if clean.command is None else _bins(clean.command, length, _places(clean.rate, length, settings))
    width = LEFT_OUT if period is None else LEFT_OUT_OF_PERIOD
    return RunSpectra(
        phasors,
        command,
        bins_taken(phasors.lines.frequencies, lines, length / clean.rate, width),
        lines,
        None if period is None else length / clean.rate,
        means["force"],
        means["displacement"],
        temperatures,
        frozenset(clocks),
        *_motion(clean),
    )


def _motion(samples: Samples) -> tuple[float, float, float]:
    """Rms and peak of the motion [m], and how far the drive goes to one side."""
    motion = vector_rows(samples, "displacement")
    size = np.linalg.norm(motion, axis=0)
    drive = motion if samples.command is None else samples.command
    along = np.linalg.eigh(drive @ drive.T)[1][:, -1] @ drive
    one_sided = abs(float(np.mean(along**3))) / max(float(np.mean(np.abs(along) ** 3)), 1e-300)
    return float(np.sqrt(np.mean(size**2))), float(size.max()), one_sided


def _clock_conditions(clocks: dict[str, ClockRate]) -> tuple[Condition, ...]:
    """What to say of clocks that differ."""
    if not clocks:
        return ()
    told = ", ".join(f"{q} {1e6 * c.rate:+.1f} ppm (standard error {1e6 * c.error:.1f})" for q, c in clocks.items())
    return (Condition("clocks-differ", f"against the probes' clock: {told}; put right from the start of each record"),)


def _period(run: Run, samples: Samples, band: tuple[float, float], lines: tuple[Line, ...]) -> float | None:
    if run.excitation_kind not in _MAY_REPEAT:
        return None
    stated = run.excitation_kind == "multisine"
    period = find_period(samples, band, lines, 1.0 if stated else _LEFT)
    if period is None and stated:
        text = "a multi-sine, but no period is found that the record holds three times"
        cure = 'Record longer; or state excitation = "random" if it does not repeat'
        raise refuse(run.file, "excitation", text, cure, run.id)
    return period


def _places(rate: float, length: int, settings: SpectraSettings) -> IntArray:
    """Numbers of the bins of the band."""
    frequency = np.fft.rfftfreq(length, 1 / rate)
    low, high = settings.band
    edge = 0.02 * rate / length  # clocks of runs differ by some ppm
    return np.flatnonzero((frequency >= low - edge) & (frequency <= high + edge) & (frequency > 0))


def _bins(rows: FloatArray, length: int, places: IntArray) -> ComplexArray:
    """Phasors (n_windows, n_bins, m) of rows (m, n) in stretches of `length` samples."""
    folded = rows.reshape(len(rows), -1, length)
    spectra = np.fft.rfft(folded, axis=2)[:, :, places] * (2.0 / length)
    return np.asarray(spectra.transpose(1, 2, 0))


def _transformed(run: Run, samples: Samples, length: int, housing_mass: float, settings: SpectraSettings) -> RunPhasors:
    """Phasors as recorded."""
    places = _places(samples.rate, length, settings)
    frequency = np.fft.rfftfreq(length, 1 / samples.rate)[places]
    z = _bins(samples.rows, length, places)
    windows = samples.length // length
    lines = LineSet(tuple(Line("excitation", float(f)) for f in frequency), (), (), run.point.shaft_speed_hz)
    nothing = np.zeros((windows, z.shape[2]))
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        np.arange(windows) * length / samples.rate,
        length / samples.rate,
        samples.channels,
        z,
        nothing,
        nothing,
        nothing,
        housing_mass,
        np.full(windows, np.nan),
    )
