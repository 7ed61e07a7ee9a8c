"""The page of a campaign while it is measured: what to do now, what there is, what is still to run."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tpjb_ident.columns import set_point, size, symbol
from tpjb_ident.report.comparison_page import clearance_table, pivot_stiffness_table
from tpjb_ident.report.drawing.picture import DIRECT, longest_series
from tpjb_ident.report.figure import Panel, svg_text
from tpjb_ident.report.page import Page, Section, Table, render_page
from tpjb_ident.report.plots.coefficients import direct_coefficients
from tpjb_ident.report.sections import KINDS_IN_WORDS, flags_line, tested_facts, values_table
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.runtime.tables import write_text
from tpjb_ident.schema import STIFFNESS
from tpjb_ident.watch.next_steps import described, lacking, located
from tpjb_ident.watch.watcher import Snapshot

#: Words of the page for the states of a run, where they are not the state's name.
_WORDS = {"look": "good, with a remark", "replaced": "replaced by a repeat"}
#: States of a run that has not landed.
_WAITING = ("to run", "being written")


def write_watch_page(folder: Path, snapshot: Snapshot, refresh: int, origin: Mapping[str, Any], bearing: Any) -> None:
    """Write ``watch.html``, whole or not at all, with its figures inside; the next command comes after the last run."""
    landed = snapshot.count("good", "look", "repeat", "replaced")
    points = [p for p in snapshot.measured.points if not lacking(p)]
    page = Page(
        title=f"{snapshot.campaign.id}: while it is measured",
        subtitle=f"{landed} of {len(snapshot.states)} runs are recorded, {snapshot.count('repeat')} to be repeated, "
        f"{snapshot.count('to run')} to run",
        sentences=[step.text for step in snapshot.steps] or ["Nothing to do: records are being written."],
        facts=tested_facts(snapshot.campaign, bearing, points),
        key_table=coverage_table(snapshot),
        values=values_table(points),
        flags=flags_line([p.quality for p in points], len(points)),
        lead="k-over-",
        sections=_sections(snapshot, bearing),
        refresh=refresh,
        beside="coefficients.csv and watch.json are beside this file.",
        **{**origin, "then": "" if snapshot.count(*_WAITING) else origin["then"]},
    )
    write_text(folder / "watch.html", render_page(page, {p.name: svg_text(p.figure, p.name) for p in page.panels}))


def coverage_table(snapshot: Snapshot) -> Table:
    """How many runs of every kind and set-up have landed."""
    counts: dict[str, Any] = {}
    for status in snapshot.states:
        kind = status.run.kind
        name = set_point(status.run.point) if kind == "dynamic" else KINDS_IN_WORDS.get(kind, kind)
        states = np.array([status.counts, status.state == "repeat", status.state in _WAITING], dtype=int)
        counts[name] = counts.get(name, 0) + states
    rows = [[name, *map(str, numbers)] for name, numbers in counts.items()]
    return Table("How far the plan is", ["", "good", "to repeat", "to run"], rows)


def _sections(snapshot: Snapshot, bearing: Any) -> list[Section]:
    measured = snapshot.measured
    so_far = ["From the good runs so far. They change while runs come in; tpjb identify has the last word."]
    points = points_table(measured.points)
    panels, identification = [], measured.identification
    if identification is not None and identification.points:
        table = identification.to_frame().dropna(subset=list(STIFFNESS.columns))
        for over in ("load", "frequency"):
            if longest_series(table, over) is not None:
                title, bearings = f"Direct stiffness over {over}, 95 % intervals", {identification.campaign: table}
                panels.append(Panel(f"k-over-{over}", title, direct_coefficients, bearings, "k", over))
    pivots = [pivot_stiffness_table(measured.curves, None)] if measured.curves else []
    clearances = []
    if measured.polygon is not None:
        clearances.append(clearance_table(measured.polygon, np.array(bearing.clearances)))
    waiting = []
    for status in snapshot.states:
        run = status.run
        if status.state in _WAITING:
            waiting.append([run.id, run.kind, described(run), run.file])
    to_come = Table("Runs to come", ["run", "kind", "set points", "file"], waiting)
    notes = [*so_far, *measured.refusals] if measured.points or measured.refusals else []
    return [
        Section("What the plan leaves out, and remarks", [*snapshot.lacks, *map(str, snapshot.problems)]),
        Section("Stiffness and damping so far", notes, panels, [points]),
        Section("Pivots so far", tables=pivots),
        Section("Clearance", tables=clearances),
        Section("Records", tables=[records_table(snapshot, [status.run.id for status in snapshot.states])]),
        Section("Still to run", tables=[to_come]),
    ]


def points_table(points: Sequence[PointResult]) -> Table:
    """K and C of every point so far, with intervals and flags."""
    rows = []
    for p in points:
        reason, solved = lacking(p), p.stiffness.cells()
        cells = ["–" if reason else solved[i] for i in (0, 3, 4, 7)]
        place = [f"{p.point.static_load / size('load'):.6g}", f"{p.point.excitation_hz:g}", str(p.n_records)]
        rows.append([*place, *cells, reason or ", ".join(q.sentence() for q in p.quality)])
    direct = [f"{name}, {symbol('stiffness' if name[0] == 'k' else 'damping')}" for name in DIRECT]
    columns = [f"load, {symbol('load')}", "excitation, Hz", "records", *direct, "flags"]
    return Table("Direct coefficients so far, 95 % intervals", columns, rows)


def records_table(snapshot: Snapshot, runs: Collection[str]) -> Table:
    """Records of some runs that have landed, the newest first."""
    reasons = {placed.run.id: placed.why for placed in snapshot.placed if placed.run is not None}
    landed = sorted((s for s in snapshot.states if s.landed and s.run.id in runs), key=lambda s: s.landed, reverse=True)
    rows = []
    for s in landed:
        remarks = [located(f.problem) for f in s.findings if f.problem.severity != "note"][:3]
        if s.run.id in reasons:
            remarks.append(f"not in the manifest; {reasons[s.run.id]}")
        rows.append([s.landed[11:19], s.run.id, described(s.run), _WORDS.get(s.state, s.state), "; ".join(remarks)])
    return Table("Newest first", ["time", "run", "set points", "verdict", "why"], rows)
