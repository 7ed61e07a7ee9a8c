"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten. A long record's lines are
looked for in its beginning, and small errors of their frequencies put right in the phasors, so that it is read once.
"""

from __future__ import annotations

from dataclasses import replace

from rigdata.problem import Problem, RigDataError
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.records.compensation import compensated, inspect_readings
from tpjb_ident.dynamic.records.extra_lines import unexpected_lines
from tpjb_ident.dynamic.records.extraction import extract
from tpjb_ident.dynamic.records.line_tuning import DRIFT, retuned, tuned
from tpjb_ident.dynamic.records.lines import LineSet, known_lines
from tpjb_ident.dynamic.records.reading_cache import SHORT, ShortRecord
from tpjb_ident.dynamic.records.run_data import MeasuredRun, PhasorSettings, RunPhasors
from tpjb_ident.dynamic.records.shaft import shaft_speed
from tpjb_ident.dynamic.records.windows import RecordTooShortError


def run_phasors(run: MeasuredRun, housing_mass: float, settings: PhasorSettings | None = None) -> RunPhasors:
    """Extract the phasors of one run."""
    settings = settings or PhasorSettings()
    kind = getattr(run, "excitation_kind", "sine")
    if kind != "sine":
        text = f"is excited by {kind}; coefficients come from sines, one frequency per run"
        cure = "Excite with sines, or leave the run out"
        raise RigDataError(Problem("error", getattr(run, "file", ""), "excitation", text, cure, run.id))
    slower, conditions = inspect_readings(run)
    result = compensated(_fitted(run, housing_mass, settings), run, slower)
    return replace(result, conditions=merged(result.conditions, conditions)) if conditions else result


def _fitted(run: MeasuredRun, housing_mass: float, settings: PhasorSettings) -> RunPhasors:
    """The run's phasors as recorded."""
    if run.length <= SHORT:
        return _inspected(ShortRecord(run), housing_mass, settings)
    try:
        lines, conditions = _known_from_the_beginning(run, housing_mass, settings)
    except RecordTooShortError:  # the beginning is not enough; all of it may be
        return _inspected(run, housing_mass, settings)
    result = extract(run, housing_mass, settings, lines)
    driven = settings.excitation_lines or (run.point.excitation_hz,)
    better = tuned(run, result, driven, lines.speed, settings)
    if better is not None:
        conditions = merged(conditions, better.conditions)
        quick = retuned(result, better.lines) if better.follow is None else None
        result = quick or extract(run, housing_mass, settings, better.lines, better.follow)
    return replace(result, conditions=merged(conditions, result.lines.conditions))


def _known_from_the_beginning(
    run: MeasuredRun, housing_mass: float, settings: PhasorSettings
) -> tuple[LineSet, tuple[Condition, ...]]:
    """Lines of a long run as its first samples show them, so that reading all of it once is enough."""
    first = _inspected(ShortRecord(run, SHORT), housing_mass, settings)
    own = tuple(c for c in first.conditions if c not in first.lines.conditions and c != DRIFT)
    return first.lines, own


def _inspected(run: MeasuredRun, housing_mass: float, settings: PhasorSettings) -> RunPhasors:
    """Fit, look for lines that nobody mentioned and for wrong frequencies, fit again where there are any."""
    speed, conditions = shaft_speed(run)
    driven = settings.excitation_lines or (run.point.excitation_hz,)
    lines = known_lines(driven, speed, run.sample_rate, settings.lines)
    result = extract(run, housing_mass, settings, lines)
    extra, unexpected = unexpected_lines(run, result) if settings.find_lines else ((), ())
    if extra:
        conditions += unexpected
        lines = known_lines(driven, speed, run.sample_rate, settings.lines, extra)
        result = extract(run, housing_mass, settings, lines)
    better = tuned(run, result, driven, speed, settings)
    if better is not None:
        conditions += better.conditions
        result = extract(run, housing_mass, settings, better.lines, better.follow)
    return replace(result, conditions=conditions + result.lines.conditions)


__all__ = ["PhasorSettings", "RunPhasors", "run_phasors"]
