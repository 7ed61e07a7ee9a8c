"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tpjb_ident.dynamic.extra_lines import unexpected_lines
from tpjb_ident.dynamic.extraction import extract
from tpjb_ident.dynamic.line_tuning import tuned
from tpjb_ident.dynamic.lines import known_lines
from tpjb_ident.dynamic.run_data import PhasorSettings, RunPhasors
from tpjb_ident.dynamic.shaft_speed import shaft_speed
from tpjb_ident.dynamic.short_record import kept_if_short


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
    run = kept_if_short(run)
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
