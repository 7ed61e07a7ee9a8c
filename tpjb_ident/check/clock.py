"""Problems of a run's time: gaps, jitter, a rate that cannot show the excitation."""

from __future__ import annotations

import numpy as np

from rigdata.problem import Severity
from tpjb_ident.arrays import FloatArray
from tpjb_ident.check.findings import Reporter

_MIN_CYCLES = 5.0


def check_clock(report: Reporter, time: FloatArray) -> None:
    """Judge the times of a run.

    Parameters
    ----------
    report : Reporter
        Receives the findings.
    time : (n,) ndarray
        Seconds, not decreasing.
    """
    rate = report.run.sample_rate
    _check_length(report, len(time), rate)
    if len(time) < 3:
        return
    steps = np.diff(time)
    step = 1.0 / rate
    _check_gaps(report, steps, step)
    usual = steps[steps < 1.5 * step]
    if len(usual) < len(steps) / 2:
        return
    scatter = float(np.std(usual)) / step
    resolution = float(np.min(steps[steps > 0], initial=step))
    rounded = resolution > 0.3 * step and float(np.max(np.abs(usual - step))) <= resolution
    if scatter > 0.02:
        cause = "the time column is rounded" if rounded else "the clock jitters"
        severity: Severity = "warning" if scatter > 0.2 and not rounded else "note"
        what = f"{cause}: steps scatter by {scatter:.0%} of a sample"
        cure = "Times are used as they are; export more digits if you can"
        report.say("jitter", severity, "time", what, cure)


def _check_length(report: Reporter, samples: int, rate: float) -> None:
    excitation = report.run.point.excitation_hz
    if samples < 3:
        what = f"the record holds only {samples} samples"
        report.say("short", "error", "time", what, "Export the run again")
    elif report.run.kind == "dynamic" and rate < 2.2 * excitation:
        what = f"{rate:g} samples per second cannot show an excitation of {excitation:g} Hz"
        report.say("nyquist", "error", "time", what, "Check sample_rate and excitation_frequency")
    elif report.run.kind == "dynamic" and excitation > 0 and samples < _MIN_CYCLES * rate / excitation:
        what = f"the record holds only {samples * excitation / rate:.1f} cycles of the excitation"
        report.say("short", "warning", "time", what, f"Record at least {_MIN_CYCLES:g} cycles")


def _check_gaps(report: Reporter, steps: FloatArray, step: float) -> None:
    """A late sample of a jittering clock is no gap: there the next step is short."""
    gaps = np.flatnonzero(steps > 1.9 * step)
    if len(gaps) == 0:
        return
    longest = int(gaps[np.argmax(steps[gaps])])
    lost = float(np.sum(steps[gaps] - step)) / step
    severity: Severity = "warning" if lost > 0.005 * len(steps) else "note"
    what = (
        f"{len(gaps)} gaps, about {lost:.0f} samples lost, the longest of {steps[longest]:.6g} s after sample {longest}"
    )
    report.say("gap", severity, "time", what, "Times are used as they are; check the logger's buffer")
