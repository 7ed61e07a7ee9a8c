"""Records that end earlier than the others of their kind: cut off by the logger, a copy, or a hand."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.check.findings import Finding
from tpjb_ident.check.observation import Observation

#: Share of the usual length below which a record was cut off.
WHOLE = 0.8


def seconds(run: Run) -> float:
    """Length of a record [s]; 0 where it cannot be told.

    Parameters
    ----------
    run : Run
    """
    try:
        return run.length / run.sample_rate
    except RigDataError:
        return 0.0


def name_cut_records(seen: Sequence[Observation], lengths: Sequence[float]) -> None:
    """Note records below `WHOLE` of the median length of their kind, before everything else that follows from it.

    Parameters
    ----------
    seen : sequence of Observation
        Whose reports receive the findings.
    lengths : sequence of float
        Of their records [s].
    """
    of_kind: dict[str, list[float]] = {}
    for one, length in zip(seen, lengths, strict=True):
        if length > 0:
            of_kind.setdefault(one.run.kind, []).append(length)
    for one, length in zip(seen, lengths, strict=True):
        usual = median(of_kind[one.run.kind]) if one.run.kind in of_kind else 0.0
        if 0 < length < WHOLE * usual and len(of_kind[one.run.kind]) > 2:
            what = f"{length:.3g} s long, the others of its kind {usual:.3g} s: cut off, or not written to its end"
            one.report.say("short record", "error", "record", what, "Copy it again from the logger, or repeat the run")
            found: list[Finding] = one.report.found
            found.insert(0, found.pop())
