"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.conditions import Condition
from tpjb_ident.dynamic.lines import LineSet, LineSettings, known_lines
from tpjb_ident.dynamic.oil_force import oil_force
from tpjb_ident.dynamic.phasors import LineFitter, PhasorBlock, fit_uneven
from tpjb_ident.dynamic.windows import WindowSettings, plan_windows

QUANTITIES = ("displacement", "force", "acceleration")
#: Samples of one channel held at a time.
CHUNK = 2**17
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02
#: Phase advance over a run [cycles] that a frequency may be off before the fit is repeated.
MAX_SLIP = 0.01


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted.

    Attributes
    ----------
    lines : LineSettings
    windows : WindowSettings
    delays : dict
        Seconds by which a quantity's channels are recorded late, where that is known.
    excitation_lines : tuple of float
        Excitation frequencies [Hz] for records that hold several; empty takes the run's own.
    """

    lines: LineSettings = field(default_factory=LineSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()


@dataclass(frozen=True)
class RunPhasors:
    """What is kept of a run.

    Attributes
    ----------
    run : str
    point : OperatingPoint
        Set points of the run.
    direction : float or None
        Direction of the excitation [rad].
    lines : LineSet
        As fitted; excitation lines first.
    start : (n,) ndarray
        Start of every window [s].
    length : float
        Of a window [s].
    displacement, cell_force, acceleration : PhasorBlock
        `acceleration` is None where the rig has none.
    housing_mass : float
    slip : (n_lines,) ndarray
        Frequency that the phase of each line's window phasors still shows [Hz]; NaN where unclear.
    conditions : tuple of Condition
    """

    run: str
    point: OperatingPoint
    direction: float | None
    lines: LineSet
    start: FloatArray
    length: float
    displacement: PhasorBlock
    cell_force: PhasorBlock
    acceleration: PhasorBlock | None
    housing_mass: float
    conditions: tuple[Condition, ...]

    def oil_force(self, line: int = 0) -> ComplexArray:
        """Oil-force phasors at one line, shape (n, 2) [N]."""
        a = None if self.acceleration is None else self.acceleration.phasors[:, line]
        return oil_force(self.cell_force.phasors[:, line], a, 0.0 if a is None else self.housing_mass)


def run_phasors(run: Any, housing_mass: float, settings: PhasorSettings | None = None) -> RunPhasors:
    """Extract the phasors of one run.

    Parameters
    ----------
    run : rigdata.campaign.Run
    housing_mass : float
        [kg]
    settings : PhasorSettings, optional

    Raises
    ------
    RecordTooShortError
        The record cannot resolve its lines.
    rigdata.problem.RigDataError
        The file cannot give what the manifest promises.
    """
    settings = settings or PhasorSettings()
    speed, conditions = shaft_speed(run)
    driven = settings.excitation_lines or (run.point.excitation_hz,)
    result = _extract(run, housing_mass, settings, known_lines(driven, speed, run.sample_rate, settings.lines))
    better = _better_lines(result, driven, speed, settings, run.sample_rate)
    if better is not None:
        lines, found = better
        conditions += found
        result = _extract(run, housing_mass, settings, lines)
    from dataclasses import replace

    return replace(result, conditions=conditions + result.lines.conditions)


def shaft_speed(run: Any) -> tuple[float, tuple[Condition, ...]]:
    """Shaft speed of a run [Hz]: the tachometer's, or the set point where it gives nothing usable."""
    nominal = run.point.shaft_speed_hz
    record = run.speed(0, CHUNK)
    if record is None:
        return nominal, ()
    values = record.values[np.isfinite(record.values)]
    measured = float(values.mean()) / (2 * np.pi) if len(values) else np.nan
    if abs(measured - nominal) <= 0.05 * max(nominal, 1.0):
        return measured, ()
    return nominal, (
        Condition("tach off set point", f"tachometer says {measured:.4g} Hz, set point {nominal:g} Hz; set point used"),
    )


def _extract(run: Any, housing_mass: float, settings: PhasorSettings, lines: LineSet) -> RunPhasors:
    rate = run.sample_rate
    length, count = plan_windows(run.length, rate, lines, settings.windows)
    fitter = LineFitter(length, rate, lines.frequencies)
    present = {c.quantity for c in run.channels.values()}
    blocks: dict[str, list[PhasorBlock]] = {q: [] for q in QUANTITIES if q in present or q != "acceleration"}
    starts = []
    for first, stop in _chunks(length, count):
        start = None
        for quantity, parts in blocks.items():
            record = run.vector(quantity, first * length, stop * length)
            block, start = _fit_chunk(fitter, record, first, stop)
            parts.append(_undelayed(block, lines, settings.delays.get(quantity, 0.0)))
        starts.append(start)
    joined = {quantity: _joined(parts) for quantity, parts in blocks.items()}
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        np.concatenate([s for s in starts if s is not None]),
        length / rate,
        joined["displacement"],
        joined["force"],
        joined.get("acceleration"),
        housing_mass,
        (),
    )


def _chunks(length: int, count: int) -> Iterator[tuple[int, int]]:
    step = max(1, CHUNK // length)
    for first in range(0, count, step):
        yield first, min(first + step, count)


def _fit_chunk(fitter: LineFitter, record: Any, first: int, stop: int) -> tuple[PhasorBlock, FloatArray]:
    """Fit windows first..stop-1 of a record that starts at window `first`."""
    n, length = stop - first, fitter.length
    values = record.values.reshape(n, length, 2)
    time = record.time.reshape(n, length)
    grid = time[:, :1] + np.arange(length) / fitter.rate
    even = np.abs(time - grid).max(axis=1) <= MAX_JITTER / fitter.rate
    start = np.where(np.isfinite(time[:, 0]), time[:, 0], (first + np.arange(n)) * length / fitter.rate)
    block = fitter.fit(values, start)
    for i in np.flatnonzero(~even):
        good = np.isfinite(time[i])
        if good.sum() > 2 * fitter.design.shape[1]:
            single = fit_uneven(values[i][good], time[i][good], fitter.frequencies, 0.0)
            _put(block, int(i), single)
    return block, start


def _put(block: PhasorBlock, i: int, single: PhasorBlock) -> None:
    block.phasors[i], block.mean[i] = single.phasors[0], single.mean[0]
    block.noise[i], block.lost[i] = single.noise[0], single.lost[0]


def _undelayed(block: PhasorBlock, lines: LineSet, delay: float) -> PhasorBlock:
    if delay == 0.0:
        return block
    advance = np.exp(2j * np.pi * lines.frequencies * delay)
    return PhasorBlock(block.phasors * advance[None, :, None], block.mean, block.noise, block.lost)


def _joined(parts: list[PhasorBlock]) -> PhasorBlock:
    return PhasorBlock(
        np.concatenate([p.phasors for p in parts]),
        np.concatenate([p.mean for p in parts]),
        np.concatenate([p.noise for p in parts]),
        np.concatenate([p.lost for p in parts]),
    )


def frequency_slip(phasors: ComplexArray, start: FloatArray, noise: float) -> float:
    """Frequency error that the phase advance of window phasors shows [Hz].

    Parameters
    ----------
    phasors : (n, 2) complex ndarray
        One line, referred to the start of the run.
    start : (n,) ndarray
        [s]
    noise : float
        Standard error of a phasor component; a line weaker than ten times this tells nothing.

    Returns
    -------
    float
        0.0 where nothing can be told.
    """
    good = np.isfinite(phasors).all(axis=1)
    if good.sum() < 3:
        return 0.0
    z, t = phasors[good], start[good]
    size = float(np.median(np.linalg.norm(z, axis=1)))
    if not size > 10 * noise:
        return 0.0
    # Phase steps between neighbours, each weighted by what both show: robust through the median.
    steps = np.angle(np.einsum("ni,ni->n", z[1:], z[:-1].conj())) / (2 * np.pi * np.diff(t))
    return float(np.median(steps))


def _better_lines(
    result: RunPhasors, driven: tuple[float, ...], speed: float, settings: PhasorSettings, rate: float
) -> tuple[LineSet, tuple[Condition, ...]] | None:
    """Lines with corrected frequencies, or None where the first guess was good enough."""
    span = result.start[-1] - result.start[0] + result.length
    n_driven = len(result.lines.excitation)
    noise_f = float(np.nanmedian(result.cell_force.noise)) / np.sqrt(result.length * rate)
    noise_d = float(np.nanmedian(result.displacement.noise)) / np.sqrt(result.length * rate)
    slips = [frequency_slip(result.cell_force.phasors[:, i], result.start, noise_f) for i in range(n_driven)]
    names = [line.name for line in result.lines.nuisance]
    slip_1x = 0.0
    if "1X" in names:
        index = n_driven + names.index("1X")
        slip_1x = frequency_slip(result.displacement.phasors[:, index], result.start, noise_d)
    found: tuple[Condition, ...] = ()
    off = [s if abs(s) * span > MAX_SLIP else 0.0 for s in slips]
    if abs(slip_1x) * span <= MAX_SLIP * 5 and not any(off):
        return None
    exact = tuple(line.frequency + s for line, s in zip(result.lines.excitation, off))
    if any(off):
        found = (
            Condition(
                "excitation off set point",
                f"excitation found at {', '.join(f'{f:.5g}' for f in exact)} Hz, set point "
                f"{', '.join(f'{f:g}' for f in driven)} Hz; the found one was used for the fit",
            ),
        )
    return known_lines(exact, speed + slip_1x, rate, settings.lines), found
