"""An observation of a dynamic run as plain numbers and texts, to be kept on disk beside the run's phasors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rigdata.problem import Problem
from rigdata.run import Run
from tpjb_ident.check.findings import Finding, Reporter
from tpjb_ident.check.lines import RecordLines
from tpjb_ident.check.observation import Observation


def of_run(seen: Observation, run: Run) -> Observation:
    """The same observation, of `run` in place of the one that was looked at: what that kept in memory may go.

    Parameters
    ----------
    seen : Observation
    run : rigdata.run.Run
    """
    return replace(seen, run=run, report=Reporter(run, list(seen.report.found), set(seen.report.doubts)))


def packed(seen: Observation) -> dict[str, Any]:
    """What JSON can hold; samples are left out, dynamic runs have none.

    Parameters
    ----------
    seen : Observation
    """
    lines = None if seen.lines is None else {name: _plain(value) for name, value in vars(seen.lines).items()}
    return {
        "excitation": seen.run.point.excitation,
        "channels": [c.name for c in seen.channels],
        "lines": lines,
        "spread": seen.spread.tolist(),
        "other_line": seen.other_line,
        "speed": seen.speed,
        "digest": seen.digest,
        "found": [[asdict(f.problem), f.key] for f in seen.report.found],
        "doubts": sorted(seen.report.doubts),
    }


def unpacked(stored: Mapping[str, Any], run: Run) -> Observation:
    """What `packed` made, of `run` at the excitation that was looked at.

    Parameters
    ----------
    stored : mapping
    run : rigdata.run.Run
    """
    if stored["excitation"] != run.point.excitation:
        run = replace(run, point=replace(run.point, excitation=stored["excitation"]))
    channels = tuple(run.channels[name] for name in stored["channels"])
    lines = stored["lines"]
    found = [Finding(Problem(**problem), key) for problem, key in stored["found"]]
    return Observation(
        run=run,
        channels=channels,
        lines=None if lines is None else RecordLines(**{name: _array(value) for name, value in lines.items()}),
        spread=np.array(stored["spread"], dtype=float).reshape(3, len(channels)),
        other_line=stored["other_line"],
        samples=np.empty((0, len(channels))),
        speed=stored["speed"],
        digest=stored["digest"],
        report=Reporter(run, found, set(stored["doubts"])),
    )


def _plain(values: np.ndarray) -> Any:
    return {"re": values.real.tolist(), "im": values.imag.tolist()} if np.iscomplexobj(values) else values.tolist()


def _array(stored: Any) -> np.ndarray:
    if isinstance(stored, dict):
        return np.array(stored["re"]) + 1j * np.array(stored["im"])
    return np.array(stored)
