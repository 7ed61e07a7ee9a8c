"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten. A long record's lines are
looked for in its beginning, and small errors of their frequencies put right in the phasors, so that it is read once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import merged
from tpjb_ident.phasors.compensation import compensated, inspect_readings
from tpjb_ident.phasors.extra_lines import unexpected_lines
from tpjb_ident.phasors.extraction import extract
from tpjb_ident.phasors.frequency import DRIFT, retuned, tuned
from tpjb_ident.phasors.lines import known_lines
from tpjb_ident.phasors.reading_cache import SHORT, beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.phasors.shaft import shaft_speed
from tpjb_ident.phasors.whole_record import whole_record
from tpjb_ident.phasors.windows import RecordTooShortError


def run_phasors(run: Run, housing_mass: float, settings: PhasorSettings | None = None) -> RunPhasors:
    """Extract the phasors of one run."""
    settings = settings or PhasorSettings()
    if run.excitation_kind != "sine":
        text = f"is excited by {run.excitation_kind}; coefficients come from sines, one frequency per run"
        cure = "Excite with sines, or leave the run out"
        raise RigDataError(Problem("error", run.file, "excitation", text, cure, run.id))
    run = with_kept_beginning(run)
    slower, conditions = inspect_readings(run)
    result = compensated(_fitted(run, housing_mass, settings), run, slower)
    return replace(result, conditions=merged(result.conditions, conditions)) if conditions else result


def _fitted(run: Run, housing_mass: float, settings: PhasorSettings) -> RunPhasors:
    """The run's phasors as recorded."""
    if run.length <= SHORT:
        return _inspected(run, housing_mass, settings)
    try:
        first = _inspected(beginning_of(run, SHORT), housing_mass, settings)
    except RecordTooShortError:  # the beginning is not enough; all of it may be
        return _inspected(run, housing_mass, settings)
    lines, conditions = (
        first.lines,
        tuple(c for c in first.conditions if c not in first.lines.conditions and c != DRIFT),
    )
    result = extract(run, housing_mass, settings, lines)
    driven = settings.excitation_lines or (run.point.excitation_hz,)
    better = tuned(run, result, driven, lines.speed, settings)
    if better is not None:
        conditions = merged(conditions, better.conditions)
        quick = retuned(result, better.lines) if better.follow is None else None
        result = quick or extract(run, housing_mass, settings, better.lines, better.follow)
    # the noise of a phasor of the whole record is less than that of its beginning
    share = np.sqrt(SHORT / run.length)
    residual = tuple(share * bins for bins in first.residual)
    return replace(
        result, conditions=merged(conditions, result.lines.conditions), record=first.record, residual=residual
    )


def _inspected(run: Run, housing_mass: float, settings: PhasorSettings) -> RunPhasors:
    """Fit, look for lines that nobody mentioned and for wrong frequencies, fit again where there are any."""
    speed, conditions = shaft_speed(run)
    driven = settings.excitation_lines or (run.point.excitation_hz,)
    duration = run.length / run.sample_rate
    lines = known_lines(driven, speed, run.sample_rate, settings.lines, (), duration)
    result = extract(run, housing_mass, settings, lines)
    record = whole_record(run, result)
    extra, unexpected = unexpected_lines(record, result) if settings.find_lines else ((), ())
    if extra:
        conditions += unexpected
        lines = known_lines(driven, speed, run.sample_rate, settings.lines, extra, duration)
        result = extract(run, housing_mass, settings, lines)
    better = tuned(run, result, driven, speed, settings)
    if better is not None:
        conditions += better.conditions
        result = extract(run, housing_mass, settings, better.lines, better.follow)
    if result.lines is not record.lines:
        record = whole_record(run, result)
    residual = tuple(record.beside(i) for i in range(len(result.lines.excitation)))
    return replace(result, conditions=conditions + result.lines.conditions, record=record.fit.z[0], residual=residual)


__all__ = ["PhasorSettings", "RunPhasors", "run_phasors"]
