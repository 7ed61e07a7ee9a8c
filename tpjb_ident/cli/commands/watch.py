"""`tpjb watch`: a campaign while it is measured."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_bearing
from tpjb_ident.cli.common.options import BearingOption, Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import note_line, print_line, table
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table, write_text

if TYPE_CHECKING:
    from tpjb_ident.watch.next_steps import RunStatus
    from tpjb_ident.watch.watcher import Snapshot, Watcher

SCHEMA = "tpjb-watch/1"
#: Folder in the output folder in which phasors of finished runs stay, for the next start.
KEPT = ".tpjb-finished-runs"
#: Steps that forbid to go on as planned.
URGENT = ("stop", "repeat")
#: More records than this at one look are counted, not listed.
MOST_LINES = 12
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Campaign folder, with campaign.toml: the plan.")]
Once = Annotated[bool, typer.Option("--once", help="Look once and end: exit code 3 if a run must be repeated.")]
Every = Annotated[str, typer.Option("--every", metavar="TIME", help="How often to look.")]
Settle = Annotated[
    str, typer.Option("--settle", metavar="TIME", help="A file that has not changed for so long is written.")
]
Within = Annotated[
    str | None,
    typer.Option(
        "--within", metavar="SHARE", help='Interval that you want, such as "3 %": says how many records more.'
    ),
]


@guarded
def watch(
    folder: Folder,
    bearing: BearingOption = None,
    once: Once = False,
    every: Every = "2 s",
    settle: Settle = "5 s",
    within: Within = None,
    out: Out = None,
) -> None:
    """Check, identify and place each record of a campaign as it lands.

    The plan is campaign.toml: list every run that you mean to make; files may come in any order, under their names or
    with a repeat's (d-05000-25-03_2.csv). Says what to repeat before the load is changed, what is missing, what comes
    next; writes watch.html (loads itself again), watch.json and coefficients. Ctrl-C ends it, the same command goes on.
    """
    target = out_folder(out, "watch")
    pause, patience = _amount(every, "time", "--every", "2 s"), _amount(settle, "time", "--settle", "5 s")
    wanted = None if within is None else _amount(within, "ratio", "--within", "3 %")
    watcher = _open_watch(folder, bearing, target / KEPT, patience, wanted)
    settings = {"folder": folder, "every": every, "settle": settle, "within": within or "-"}
    refresh = 0 if once else max(2, round(pause))
    print_line(f"Watching {folder}; the page: {target / 'watch.html'}")
    last: Snapshot | None = None
    told: frozenset[str] = frozenset()
    until = time.monotonic() + 2.0 * patience
    try:
        while True:
            snapshot = watcher.look()
            if snapshot is not None:
                told = _show_news(snapshot, told)
                try:
                    _write_results(target, folder, snapshot, refresh, settings)
                except (BadInputError, OSError) as error:
                    if last is None or once:
                        raise
                    note_line("warning", f"the page could not be written, it is tried again: {error}")
                    watcher.look_again()
                last = snapshot
            if once and (not watcher.waits or time.monotonic() > until):
                break
            time.sleep(min(pause, 0.25 * patience) if once else pause)
    except KeyboardInterrupt:
        print_line("Stopped. The same command goes on from here.")
        return
    finish(last, target)


def _open_watch(folder: Path, bearing: Path | None, kept: Path, settle: float, within: float | None) -> Watcher:
    """Make the watcher of a campaign folder."""
    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that the logger writes to, with campaign.toml.")
    if not (folder / "campaign.toml").is_file():
        raise BadInputError(
            f"{folder}: has no campaign.toml. Write one with `tpjb init {folder}` as soon as the first "
            "record is there, and list the runs that you plan."
        )
    from rigdata.campaign import load_campaign
    from tpjb_ident.dynamic.runs.run_store import RunStore
    from tpjb_ident.dynamic.settings import IdentifySettings
    from tpjb_ident.watch.landing import NewFiles
    from tpjb_ident.watch.measured import Measuring
    from tpjb_ident.watch.watcher import Watcher

    campaign = load_campaign(folder)
    angles: tuple[float, ...] = ()
    clearance = None
    if bearing is not None or campaign.bearing_text:
        from model.bearing import BearingError

        try:
            pads = open_bearing(campaign, bearing)[0].pads
        except BearingError as error:
            note_line("warning", f"{error} Until then pivots and clearance wait.")
        else:
            angles = tuple(pad.pivot_angle for pad in pads)
            clearance = min(pad.assembled_clearance for pad in pads)
    settings = IdentifySettings(clearance=clearance, keep_weights=False)
    return Watcher(folder, NewFiles(settle), Measuring(settings, angles, RunStore(kept)), within)


def _write_results(target: Path, folder: Path, snapshot: Snapshot, refresh: int, settings: dict[str, Any]) -> None:
    """Write page, state and coefficients into the output folder, all of them or none."""
    from tpjb_ident.report.watch_page import write_watch_page

    with output_folder(target, "watch", (folder,)) as staging:
        write_watch_page(staging, snapshot, refresh, {name: str(value) for name, value in settings.items()})
        if snapshot.measured.identification is not None:
            write_table(staging, "coefficients", snapshot.measured.identification.to_frame())
        document = _state_document(snapshot)
        write_text(staging / "watch.json", json.dumps(document, indent=1, ensure_ascii=False) + "\n")
        write_record(staging, target, "watch", settings, snapshot.hashes)


def _state_document(snapshot: Snapshot) -> dict[str, Any]:
    """Content of watch.json."""
    return {
        "schema": SCHEMA,
        "campaign": snapshot.campaign.id,
        "steps": [{"kind": s.kind, "text": s.text, "runs": list(s.runs)} for s in snapshot.steps],
        "lacks": list(snapshot.lacks),
        "runs": [
            {
                "id": s.run.id,
                "kind": s.run.kind,
                "file": s.run.file,
                "state": s.state,
                "landed": s.landed,
                "planned": s.planned,
                "findings": [
                    {"severity": f.problem.severity, "place": f.problem.place, "what": f.problem.what,
                     "cure": f.problem.cure}
                    for f in s.findings
                ],
            }
            for s in snapshot.states
        ],
        "unnamed": [{"file": u.file, "like": u.like, "why": u.why} for u in snapshot.placed],
        "problems": [str(p) for p in snapshot.problems],
    }  # fmt: skip


def _show_news(snapshot: Snapshot, told: frozenset[str]) -> frozenset[str]:
    """Print what landed, and every step that was not printed before."""
    by_id = {s.run.id: s for s in snapshot.states}
    if len(snapshot.new) > MOST_LINES:
        from tpjb_ident.report.watch_page import coverage_table

        coverage = coverage_table(snapshot)
        table(f"{snapshot.campaign.id}: {len(snapshot.new)} records have landed", coverage.columns, coverage.rows)
    else:
        last_of = {p.point: r for p in snapshot.measured.points for r in snapshot.new if r in p.runs}
        for run_id in snapshot.new:
            print_line(_landed_line(by_id[run_id], snapshot, run_id in last_of.values()))
    sentences = [*(s.text for s in snapshot.steps), *snapshot.lacks, *(str(p) for p in snapshot.problems),
                 *snapshot.measured.refusals]  # fmt: skip
    for sentence in sentences:
        if sentence not in told:
            print_line(sentence)
    return frozenset(sentences)


def _landed_line(status: RunStatus, snapshot: Snapshot, with_result: bool) -> str:
    """Time, run, verdict, and what its point is by now."""
    line = f"{status.landed[11:19]} {status.run.id}: {status.state}"
    why = next((u.why for u in snapshot.placed if u.run is not None and u.run.id == status.run.id), "")
    line += f" ({why})" if why else ""
    point = next((p for p in snapshot.measured.points if status.run.id in p.runs), None)
    if point is None or not with_result:
        return line
    from tpjb_ident.rounding import with_interval
    from tpjb_ident.watch.next_steps import lacking

    records = f"{point.n_records} record{'s' if point.n_records > 1 else ''}"
    place = f"{point.point.static_load / 1e3:g} kN, {point.point.excitation_hz:g} Hz, {records}"
    if why := lacking(point):
        return f"{line}; {place}: {why}"
    half, v = point.stiffness.half_width(), point.stiffness.vector
    k = [with_interval(v[i], v[i] - half[i], v[i] + half[i], 1e6) for i in (0, 3)]
    return f"{line}; {place}: kxx {k[0]}, kyy {k[1]} MN/m"


def finish(snapshot: Snapshot | None, target: Path) -> None:
    """Say where the results are; refuse with exit code 3 where a run must be repeated."""
    print_line(f"Results: {target}")
    urgent = [s for s in snapshot.steps if s.kind in URGENT] if snapshot is not None else []
    if urgent:
        runs = list(dict.fromkeys(run for step in urgent for run in step.runs))
        raise NotTrustedError(
            f"{counted(len(runs), 'run')} to be repeated: {', '.join(runs[:8])}{', ..' if len(runs) > 8 else ''}"
        )


def _amount(text: str, dimension: str, option: str, example: str) -> float:
    """A time [s] or a share of an option, not below zero."""
    from rigdata.units import UnitError, parse_quantity

    try:
        value = parse_quantity(text, dimension)
    except UnitError as error:
        raise BadInputError(f"{option} {text!r}: {error}. Write, for instance, {option} {example!r}.") from error
    if value < 0:
        raise BadInputError(f"{option} {text!r}: must not be below zero.")
    return value
