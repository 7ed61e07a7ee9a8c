"""`tpjb watch`: a campaign while it is measured."""

from __future__ import annotations

import math
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.commands.identify import KEPT
from tpjb_ident.cli.inputs import parse_share, parse_value
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.rounding import counted, listed
from tpjb_ident.runtime.interrupts import heard

if TYPE_CHECKING:
    from tpjb_ident.watch.watcher import Snapshot, Watcher

#: Steps that forbid to go on as planned.
URGENT = ("stop", "repeat")
#: More records than this at once are counted, not listed.
MOST_LINES = 12


@command("tpjb watch records", 'tpjb watch records --once --within "3 %"')
def watch(
    c: Command,
    folder: Path,
    bearing: Path | None = None,
    once: bool = False,
    every: str = "2 s",
    settle: str = "5 s",
    within: str | None = None,
) -> None:
    """Check, identify and place each record of a campaign as it lands.

    The plan is campaign.toml: list every run that you mean to make; files may come in any order, under their names or
    with a repeat's (d-05000-25-03_2.csv). Says what to repeat before the load is changed, what is missing, what comes
    next; writes watch.html (loads itself again), watch.json and coefficients. Ctrl-C ends it, the same command goes on.
    """
    pause, patience = parse_value(every, "time", "--every", 0.0), parse_value(settle, "time", "--settle", 0.0)
    watcher = _open_watcher(c, folder, patience, parse_share(within, "--within"))
    c.next("check", folder)
    c.options = {"folder": folder, "every": every, "settle": settle, "within": within or "-"}
    c.doing(f"watching {folder}; the page: {c.target / 'watch.html'}")
    latest = None
    printed: set[str] = set()
    until = math.inf
    try:
        while True:
            snapshot = watcher.look()
            if snapshot is not None:
                printed = _show_news(c, snapshot, printed)
                try:
                    _write_results(c, snapshot, watcher.bearing, 0 if once else max(2, round(pause)))
                except (BadInputError, OSError) as error:
                    if latest is None or once:
                        raise
                    c.warn(f"the page could not be written, it is tried again: {error}")
                    watcher.look_again()
                latest = snapshot
            if once and (not watcher.waits or time.monotonic() > until):
                break
            until = min(until, time.monotonic() + 2.0 * patience)  # from the first look on, however long it took
            time.sleep(min(pause, 0.25 * patience) if once else pause)
    except KeyboardInterrupt:
        heard()
        c.print("Stopped. The same command goes on from here.")
        return
    urgent = [step.runs for step in (latest.steps if latest else ()) if step.kind in URGENT]
    if urgent:
        runs = list(dict.fromkeys(sum(urgent, ())))
        raise NotTrustedError(f"{counted(len(runs), 'run')} to be repeated: {listed(runs, 8)}")


def _open_watcher(c: Command, folder: Path, settle: float, within: float | None) -> Watcher:
    """Make the watcher of a campaign folder, with its bearing."""
    if not (folder / "campaign.toml").is_file():
        raise BadInputError(
            f"{folder}: has no campaign.toml. Give the folder that the logger writes to; write one with `tpjb init "
            f"{folder}` as soon as the first record is there, and list the runs that you plan."
        )
    from model.bearing import BearingError
    from tpjb_ident.runs.run_jobs import RunStore
    from tpjb_ident.watch.landing import NewFiles
    from tpjb_ident.watch.watcher import Watcher

    campaign = c.open(folder)
    drawing = None
    if c.has_bearing(campaign):
        try:
            drawing = c.bearing_of(campaign)
        except BearingError as error:
            c.warn(f"{error} Until then pivots and clearance wait.")
    return Watcher(folder, NewFiles(settle), drawing, RunStore(c.target / KEPT), within)


def _write_results(c: Command, snapshot: Snapshot, bearing: Any, refresh: int) -> None:
    """Write page, state and coefficients into the output folder, all of them or none."""
    from tpjb_ident.report.watch_page import write_watch_page

    c.inputs = dict(snapshot.hashes)
    with c.results():
        write_watch_page(c.folder, snapshot, refresh, c.origin, bearing)
        if snapshot.measured.identification is not None:
            c.table("coefficients", snapshot.measured.identification.to_frame())
        runs = []
        for s in snapshot.states:
            run = {"id": s.run.id, "kind": s.run.kind, "file": s.run.file}
            state = {"state": s.state, "landed": s.landed, "planned": s.planned}
            runs.append({**run, **state, "findings": [asdict(finding.problem) for finding in s.findings]})
        document = {
            "schema": "tpjb-watch/1",
            "campaign": snapshot.campaign.id,
            "steps": list(map(asdict, snapshot.steps)),
            "lacks": snapshot.lacks,
            "runs": runs,
            "unnamed": [{"file": u.file, "like": u.like, "why": u.why} for u in snapshot.placed],
            "problems": list(map(str, snapshot.problems)),
        }
        c.json("watch.json", document)


def _show_news(c: Command, snapshot: Snapshot, printed: set[str]) -> set[str]:
    """Print how the campaign stands, what landed, and every step that was not printed before; what is printed now."""
    from tpjb_ident.report.watch_page import coverage_table, points_table, records_table

    name, landed = snapshot.campaign.id, sum(bool(s.landed) for s in snapshot.states)
    c.print(
        f"{name}: {landed} of {len(snapshot.states)} runs landed, {snapshot.count('repeat')} to be repeated, "
        f"{snapshot.count('look')} to look at."
    )
    if len(snapshot.new) > MOST_LINES:
        c.show_table(coverage_table(snapshot), f"{name}, {len(snapshot.new)} records have landed")
    elif snapshot.new:
        c.show_table(records_table(snapshot, snapshot.new), name)
        points = [p for p in snapshot.measured.points if set(p.runs) & set(snapshot.new)]
        if points:
            c.show_table(points_table(points), name)
    steps = [step.text for step in snapshot.steps]
    lines = [*steps, *snapshot.lacks, *map(str, snapshot.problems), *snapshot.measured.refusals]
    for line in lines:
        if line not in printed:
            c.print(line)
    return set(lines)
