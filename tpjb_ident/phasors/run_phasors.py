"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten. A long record's lines are
looked for in its beginning, and small errors of their frequencies put right in the phasors, so that it is read once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.conditions import merged
from tpjb_ident.phasors.compensation import compensated, filled_channels
from tpjb_ident.phasors.extraction import extract
from tpjb_ident.phasors.found_lines import lines_beside, near_line, unexpected_lines
from tpjb_ident.phasors.frequency import DRIFT, device_rates, retuned, tuned
from tpjb_ident.phasors.lines import HIGHEST, LineSet, known_lines
from tpjb_ident.phasors.reading_cache import SHORT, beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.phasors.shaft import ShaftCourse, shaft_speed
from tpjb_ident.phasors.stretches import longest_stretch
from tpjb_ident.phasors.whole_record import WholeRecord, whole_records, with_record
from tpjb_ident.phasors.windows import RecordTooShortError

#: Second thoughts about the frequencies, at most.
_TUNINGS = 3


def run_phasors(run: Run, housing_mass: float, settings: PhasorSettings | None = None) -> RunPhasors:
    """Extract the phasors of one run."""
    settings = settings or PhasorSettings()
    if run.excitation_kind != "sine":
        text = f"is excited by {run.excitation_kind}; coefficients come from sines, one frequency per run"
        cure = "Excite with sines, or leave the run out"
        raise refuse(run.file, "excitation", text, cure, run.id)
    run = with_kept_beginning(run)
    fit = _beginning_fit(run, housing_mass, settings)
    if fit.run.length < run.length:
        fit.extend(run)
    result, slower = fit.result, fit.slower
    device = tuple(
        f"{slower[c.name].rate:.4g} Hz" if c.name in slower else d for c, d in zip(result.channels, result.device)
    )
    conditions = merged(fit.conditions, result.lines.conditions)
    return compensated(replace(result, conditions=conditions, device=device), run, slower, settings.delays)


def _beginning_fit(run: Run, housing_mass: float, settings: PhasorSettings) -> _RunFit:
    """Fit of a run, of the beginning of a long one."""
    if run.length > SHORT:
        try:
            return _RunFit(beginning_of(run, SHORT), housing_mass, settings)
        except RecordTooShortError:  # the beginning is not enough; all of it may be
            pass
    return _RunFit(run, housing_mass, settings)


class _RunFit:
    """Fit of a record: lines that nobody mentioned are looked for, wrong frequencies put right, and fitted again."""

    result: RunPhasors
    records: tuple[WholeRecord, ...]
    follow: ShaftCourse | None
    clocks: Mapping[str, float] | None = None

    def __init__(self, run: Run, housing_mass: float, settings: PhasorSettings) -> None:
        self.run, self.mass, self.settings = run, housing_mass, settings
        self.driven = settings.excitation_lines or (run.point.excitation_hz,)
        self.speed, self.conditions = shaft_speed(run)
        self._fit(self._lines(self.driven, ()))
        self.slower = filled_channels(run)
        self._add_unexpected()
        self._add_near()
        for _ in range(_TUNINGS):
            better = tuned(run, self.result, self.driven, self.speed, settings)
            if better is None:
                break
            self.conditions += better.conditions
            self._fit(better.lines, better.follow)
            if better.settled:
                break
        self.clocks = device_rates(self.result, run.sample_rate)
        if self.clocks:
            self._fit(self.result.lines, self.follow)
        self.result = with_record(self.result, self.records)

    def extend(self, run: Run) -> None:
        """Fit all of a long run with the lines of its beginning."""
        first, share = self.result, np.sqrt(self.run.length / run.length)
        self.run = run
        self._fit_windows(first.lines)
        self.conditions = tuple(c for c in self.conditions if c != DRIFT)
        better = tuned(run, self.result, self.driven, first.lines.speed, self.settings)
        if better is not None:
            self.conditions += better.conditions
            quick = retuned(self.result, better.lines) if better.follow is None else None
            if quick is None:
                self._fit_windows(better.lines, better.follow)
            else:
                self.result = quick
        # the noise of a phasor of the whole record is less than that of its beginning
        residual = tuple(share * bins for bins in first.residual)
        self.result = replace(self.result, record=first.record, residual=residual, rounding=first.rounding)

    def _lines(self, excitation: tuple[float, ...], extra: tuple[float, ...]) -> LineSet:
        run, rate = self.run, self.run.sample_rate
        beyond = [f for f in excitation if not 0.0 < f < HIGHEST * rate]
        if beyond:
            fault = f"{rate:g} samples per second cannot show an excitation of {beyond[0]:g} Hz"
            cure = "Check sample_rate, the unit of the time column (ms called s?) and excitation_frequency"
            raise refuse(run.file, "time", fault, cure, run.id)
        return known_lines(excitation, self.speed, rate, self.settings.lines, extra, run.length / rate)

    def _fit(self, lines: LineSet, follow: ShaftCourse | None = None) -> None:
        self._fit_windows(lines, follow)
        self.records = whole_records(self.run, self.result)

    def _fit_windows(self, lines: LineSet, follow: ShaftCourse | None = None) -> None:
        """Windows of the run's longest stretch of one excitation."""
        self.follow = follow
        windows = extract(self.run, self.mass, self.settings, lines, follow, self.clocks)
        self.result = longest_stretch(windows, self.run.sample_rate)

    def _add_unexpected(self) -> None:
        """Fit lines along that stand out of the residual, but for the images of what was filled up."""
        images = [slow.images(self.result.lines.frequencies) for slow in self.slower.values()]
        extra, conditions = unexpected_lines(self.records, self.result, np.ravel(images))
        if extra:
            self.conditions += conditions
            self._fit(self._lines(self.driven, extra))

    def _add_near(self) -> None:
        """Fit lines along that no window tells from the excitation: their beat looks like a drive off its set point."""
        lines, exact, neighbours = self.result.lines, list(self.result.lines.driven), []
        for i in range(len(exact)):
            pair = near_line(self.result, i, self.records[0].duration, self.run.sample_rate)
            if pair is not None:
                exact[i] = pair[0]
                neighbours.append(pair[1])
        if neighbours:
            self._fit(self._lines(tuple(exact), (*lines.found, *neighbours)))
            self.conditions += (lines_beside(tuple(neighbours)),)


__all__ = ["PhasorSettings", "RunPhasors", "run_phasors"]
