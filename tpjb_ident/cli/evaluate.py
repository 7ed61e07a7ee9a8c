"""`tpjb evaluate`: how often a diagnosis is right, from campaigns with hidden effects; regenerates the evidence."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.errors import BadInputError, guarded
from tpjb_ident.cli.options import BearingPath, Out, Scheduler, WorkerCount, out_folder
from tpjb_ident.cli.outdir import output_folder
from tpjb_ident.cli.record import write_record
from tpjb_ident.cli.show import Progress, progress, say, table
from tpjb_ident.provenance import sha256
from tpjb_ident.tables import write_table, write_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from model.bearing import Bearing
    from tpjb_ident.diagnose.bench import Bench
    from tpjb_ident.diagnose.trials import Plan
    from tpjb_ident.evidence.outcome import Row
    from tpjb_ident.executors import Workers

PRELOAD = ("tpjb_ident.diagnose.trials", "tpjb_ident.diagnose.raw_trials")


@guarded
def evaluate(
    bearing: BearingPath,
    sizes: Annotated[str, typer.Option(help="Sizes d' of the hidden effects, in standard deviations.")] = "3,6,12,36",
    noises: Annotated[str, typer.Option(help="Factors on the noise of identification.")] = "1,2",
    seeds: Annotated[int, typer.Option(min=0, help="Campaigns per effect, size and noise.")] = 2,
    none: Annotated[int, typer.Option(min=0, help="Campaigns with calibration errors and nothing hidden.")] = 300,
    left_out: Annotated[int, typer.Option(min=0, help="Campaigns per effect that the library lacks.")] = 4,
    two: Annotated[int, typer.Option(min=0, help="Campaigns with two effects.")] = 60,
    raw: Annotated[int, typer.Option(min=0, help="Trials with campaigns written as raw volts and identified.")] = 0,
    keep: Annotated[
        Path | None,
        typer.Option(help="Folder for tables, campaigns and rows: a killed evaluation goes on from there."),
    ] = None,
    rows: Annotated[
        list[Path] | None,
        typer.Option(help="rows.jsonl made before: counted and drawn as they are; no campaign is made now."),
    ] = None,
    workers: WorkerCount = None,
    scheduler: Scheduler = None,
    out: Out = None,
) -> None:
    """Draw campaigns with hidden effects, diagnose them, and count: the evidence behind `tpjb diagnose`.

    Writes rows.jsonl (one trial a line), trials, summary, power, p_values, coverage, closure, abstention, impostors,
    plans, rules, confusion matrices and next_tests as .csv and .parquet, evidence.md, and report.html with its
    figures as .svg and .png. The same seed gives the same campaigns, whatever the workers. With --keep, rows of raw
    trials are made anew where the code of the diagnosis has changed since; delete the folder when the virtual rig
    has. With --rows only tables, figures and page are made, of rows of any age.
    """
    if scheduler is not None and workers is not None:
        raise BadInputError("--workers: processes here, and --scheduler: a cluster, exclude each other. Give one.")
    target = out_folder(out, "evaluate")
    options = {"bearing": bearing, "sizes": sizes, "noises": noises, "seeds": seeds, "none": none,
               "left_out": left_out, "two": two, "raw": raw, "keep": keep, "rows": rows}  # fmt: skip
    todo = _Todo(bearing, _plan(options), keep, workers, scheduler)
    before = _made_before(rows) if rows else None
    with output_folder(target, "evaluate") as folder:
        with progress("evaluating") as show:
            made, tests = (before, None) if before is not None else todo.make(show)
            show("tables and figures", 99, 100)
            summary = _write(folder, made, tests, (bearing, options))
        inputs = {file.name: sha256(file) for file in (bearing, *(rows or ()))}
        write_record(folder, target, "evaluate", options, inputs)
    _show(summary)
    say(f"Results: {target}")


def _plan(options: Mapping[str, Any]) -> Plan:
    from tpjb_ident.diagnose.trials import Plan

    counts = (options[name] for name in ("seeds", "none", "left_out", "two", "raw"))
    return Plan(_numbers(options["sizes"], "--sizes"), _numbers(options["noises"], "--noises"), *counts)


def _numbers(text: str, name: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise BadInputError(f"{name} {text!r}: must be numbers with commas between them, such as 6,12.") from error
    if not all(0 < value < 1e6 for value in values):
        raise BadInputError(f"{name} {text!r}: numbers must be positive and below a million.")
    return values


def _made_before(files: Sequence[Path]) -> list[Row]:
    from tpjb_ident.evidence.rows import RowsError, read_rows

    try:
        return read_rows(files)
    except RowsError as error:
        raise BadInputError(f"--rows: {error}") from error


@dataclass(frozen=True)
class _Todo:
    """What is to be drawn and where it runs."""

    bearing: Path
    plan: Plan
    keep: Path | None
    workers: int | None
    scheduler: str | None

    def make(self, show: Progress) -> tuple[list[Row], pd.DataFrame]:
        """Rows of all trials, and what next tests are expected to tell."""
        from model.bearing_file import load_bearing
        from tpjb_ident.diagnose.bench import paper_layout, prepare
        from tpjb_ident.executors import open_workers

        drawn = load_bearing(self.bearing)
        show("tabling the model", 0, 100)
        bench = prepare(drawn, paper_layout(len(drawn.pads)), self._store())
        with open_workers(self.workers, self.scheduler, PRELOAD) as team:
            rows = [*_run(team, bench, self.plan, show), *self._raw(team, bench, drawn, show)]
        show("next tests", 99, 100)
        return rows, _next_tests(bench, drawn)

    def _store(self) -> Path | None:
        """Where the tables of this very bearing are kept."""
        if self.keep is None:
            return None
        self.keep.mkdir(parents=True, exist_ok=True)
        return self.keep / f"{sha256(self.bearing)[:16]}.npz"

    def _raw(self, team: Workers, bench: Bench, drawn: Bearing, show: Progress) -> list[Row]:
        if not self.plan.raw:
            return []
        from tpjb_ident.diagnose.raw_rows import raw_rows
        from tpjb_ident.diagnose.raw_trials import raw_bench, raw_trials

        shared = raw_bench(bench, drawn, self.keep)
        groups = raw_trials([c.label for c in bench.pool], self.plan.raw)
        total, done = sum(map(len, groups)), itertools.count(1)
        return [*raw_rows(team, shared, groups, lambda row: show(f"raw volts, {row['kind']}", next(done), total))]


def _run(team: Workers, bench: Bench, plan: Plan, show: Progress) -> list[Row]:
    from tpjb_ident.diagnose.trials import run_trial, trials
    from tpjb_ident.executors import in_order

    drawn_trials = list(trials([c.label for c in bench.pool], plan))
    rows: list[Row] = []
    for row in in_order(team, run_trial, [(trial,) for trial in drawn_trials], bench):
        rows.append(row)
        show(f"{row['kind']} {' + '.join(row['truth'])}", len(rows), len(drawn_trials))
    return rows


def _next_tests(bench: Bench, drawn: Bearing) -> pd.DataFrame:
    from model.pivots import pivot_laws
    from model.setup import Setup
    from tpjb_ident.diagnose.next_test_trials import alike_pairs, next_test_table

    return next_test_table(bench, Setup(drawn, pivot_laws("kirk", drawn)), alike_pairs(bench))


def _write(
    folder: Path, rows: list[Row], tests: pd.DataFrame | None, made: tuple[Path, Mapping[str, Any]]
) -> pd.DataFrame:
    from tpjb_ident.evidence.rows import write_rows
    from tpjb_ident.evidence.tables import evidence_tables, markdown, trials_table
    from tpjb_ident.report.evidence_page import write_evidence_report

    bearing, options = made
    write_rows(folder / "rows.jsonl", rows)
    write_table(folder, "trials", trials_table(rows))
    tables = evidence_tables(rows) | ({"next_tests_expected": tests} if tests is not None and len(tests) else {})
    for name, frame in tables.items():
        write_table(folder, name, frame)
    texts = [f"## {name}\n\n{markdown(frame)}" for name, frame in tables.items()]
    write_text(folder / "evidence.md", "\n".join(texts))
    write_evidence_report(folder, rows, tables, (bearing.stem, options, {bearing.name: sha256(bearing)}))
    return tables["summary"]


def _show(summary: pd.DataFrame) -> None:
    columns = ["rung", "kind", "size_sigma", "noise_factor", "trials", "right_share", "abstained_share", "errors"]
    rows = [
        [f"{v:.3g}" if isinstance(v, float) else str(v) for v in row]
        for row in summary[columns].itertuples(index=False)
    ]
    table("Outcomes", columns, rows, (0, 1))
