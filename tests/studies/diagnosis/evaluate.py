"""How often a diagnosis is right, from campaigns with hidden effects; regenerates the evidence.

python -m tests.studies.diagnosis.evaluate model/bearings/rocker.toml [--raw 20] [--workers 2]
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.options import BearingPath, Out, Scheduler, WorkerCount, out_folder
from tpjb_ident.cli.common.registration import add_command
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import Progress, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_table, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from model.bearing import Bearing
    from tests.studies.diagnosis.bench import Bench
    from tests.studies.diagnosis.trials import Plan
    from tests.studies.evidence.outcome import Row
    from tpjb_ident.runtime.executors import Workers

PRELOAD = ("tests.studies.diagnosis.trials", "tests.studies.diagnosis.raw_trials")
#: Parts of the paper's campaign after which next tests are tried.
DATA_SETS = ("D", "C", "B", "A")


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
    follow: Annotated[
        int, typer.Option(min=0, help="Campaigns per effect, size and data set for next tests; 0: none.")
    ] = 1,
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
    plans, rules, next_tests and confusion matrices as .csv and .parquet, evidence.md, and report.html with its
    figures as .svg and .png. The same seed gives the same campaigns, whatever the workers. Where campaigns of the data
    sets A to D (see `tpjb plan --data-sets`) come out ambiguous, the suggested next test is drawn too. With --keep,
    rows are made anew where the code of the diagnosis has changed since; delete the folder when the virtual rig has.
    With --rows only tables, figures and page are made, of rows of any age.
    """
    if scheduler is not None and workers is not None:
        raise BadInputError("--workers: processes here, and --scheduler: a cluster, exclude each other. Give one.")
    target = out_folder(out, "evaluate")
    options = {"bearing": bearing, "sizes": sizes, "noises": noises, "seeds": seeds, "none": none,
               "left_out": left_out, "two": two, "raw": raw, "follow": follow, "keep": keep, "rows": rows}  # fmt: skip
    todo = _Todo(bearing, _plan(options), follow, keep, (workers, scheduler))
    before = _made_before(rows) if rows else None
    with output_folder(target, "evaluate") as folder:
        with progress("evaluating") as show:
            made = before if before is not None else todo.make(show)
            show("tables and figures", 99, 100)
            tables = _write(folder, made, (bearing, options))
        inputs = {file.name: sha256(file) for file in (bearing, *(rows or ()))}
        write_record(folder, target, "evaluate", options, inputs)
    _show(tables)
    print_line(f"Results: {target}")


def _plan(options: Mapping[str, Any]) -> Plan:
    from tests.studies.diagnosis.trials import Plan

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
    from tests.studies.evidence.rows import RowsError, read_rows

    try:
        return read_rows(files)
    except RowsError as error:
        raise BadInputError(f"--rows: {error}") from error


@dataclass(frozen=True)
class _Todo:
    """What is to be drawn, where it is kept and where it runs (processes, cluster)."""

    bearing: Path
    plan: Plan
    follow: int
    keep: Path | None
    where: tuple[int | None, str | None]

    def make(self, show: Progress) -> list[Row]:
        """Rows of all trials."""
        from model.bearing_file import load_bearing
        from tests.studies.diagnosis.bench import paper_layout, prepare
        from tpjb_ident.runtime.workers import open_workers

        drawn = load_bearing(self.bearing)
        show("tabling the model", 0, 100)
        bench = prepare(drawn, paper_layout(len(drawn.pads)), self._store(".npz"))
        with open_workers(*self.where, PRELOAD) as team:
            return [
                *self._surrogate(team, bench, show),
                *self._raw(team, bench, drawn, show),
                *self._followed(team, bench, drawn, show),
                *self._case(bench, show),
            ]

    def _store(self, name: str) -> Path | None:
        """Where something about this very bearing is kept."""
        if self.keep is None:
            return None
        self.keep.mkdir(parents=True, exist_ok=True)
        return self.keep / f"{sha256(self.bearing)[:16]}{name}"

    def _surrogate(self, team: Workers, bench: Bench, show: Progress) -> list[Row]:
        from tests.studies.diagnosis.kept_trials import kept_trials
        from tests.studies.diagnosis.trials import run_trial, trials

        todo, done = list(trials([c.label for c in bench.pool], self.plan)), itertools.count(1)

        def told(row: Row) -> None:
            show(f"{row['kind']} {' + '.join(row['truth'])}", next(done), len(todo))

        return [*kept_trials(team, run_trial, todo, bench, self._store("-rows.jsonl"), told)]

    def _case(self, bench: Bench, show: Progress) -> list[Row]:
        from tests.studies.diagnosis.case import run_case

        show("one case", 0, 1)
        return [run_case(bench)]

    def _raw(self, team: Workers, bench: Bench, drawn: Bearing, show: Progress) -> list[Row]:
        if not self.plan.raw:
            return []
        from tests.studies.diagnosis.raw_rows import raw_rows
        from tests.studies.diagnosis.raw_trials import raw_bench, raw_trials

        shared = raw_bench(bench, drawn, self.keep)
        groups = raw_trials([c.label for c in bench.pool], self.plan.raw)
        total, done = sum(map(len, groups)), itertools.count(1)
        return [*raw_rows(team, shared, groups, lambda row: show(f"raw volts, {row['kind']}", next(done), total))]

    def _followed(self, team: Workers, bench: Bench, drawn: Bearing, show: Progress) -> list[Row]:
        """Next tests, for every data set."""
        from model.pivots import pivot_laws
        from model.setup import Setup
        from tests.studies.diagnosis.kept_trials import kept_trials
        from tests.studies.diagnosis.next_test_bench import followed_by_all, of_data_set
        from tests.studies.diagnosis.next_test_trials import next_trials, run_next_trial

        setup, rows = Setup(drawn, pivot_laws("kirk", drawn)), []
        for name in DATA_SETS if self.follow else ():
            show(f"tests that could follow data set {name}", 0, 100)
            alone = of_data_set(bench, name)
            whole = followed_by_all(setup, alone, lambda design: self._store(f"-{design}.npz"))
            todo, done = list(next_trials([c.label for c in bench.pool], name, self.follow)), itertools.count(1)

            def told(row: Row, done: Iterator[int] = done, total: int = len(todo)) -> None:
                show(f"next tests after {row['data_set']}", next(done), total)

            file = self._store("-next-tests.jsonl")
            rows += kept_trials(team, run_next_trial, todo, (whole, alone), file, told)
        return [*rows]


def _write(folder: Path, rows: list[Row], made: tuple[Path, Mapping[str, Any]]) -> dict[str, pd.DataFrame]:
    from tests.studies.evidence.rows import write_rows
    from tests.studies.evidence.tables import evidence_tables, markdown, trials_table
    from tests.studies.pages.evidence_page import write_evidence_report

    bearing, options = made
    write_rows(folder / "rows.jsonl", rows)
    write_table(folder, "trials", trials_table(rows))
    tables = evidence_tables(rows)
    for name, frame in tables.items():
        write_table(folder, name, frame)
    texts = [f"## {name}\n\n{markdown(frame)}" for name, frame in tables.items()]
    write_text(folder / "evidence.md", "\n".join(texts))
    write_evidence_report(folder, rows, tables, (bearing.stem, options, {bearing.name: sha256(bearing)}))
    return tables


#: Tables that are shown at the terminal: title, columns, how many of them are words.
SHOWN = {
    "summary": (
        "Outcomes",
        ["rung", "kind", "size_sigma", "noise_factor", "trials", "right_share", "abstained_share", "errors"], 2,
    ),
    "next_tests": (
        "What the suggested next test settles",
        ["data_set", "size_sigma", "ambiguous_campaigns", "settled", "settled_by_random", "expected", "achieved"], 2,
    ),
}  # fmt: skip


def _show(tables: Mapping[str, pd.DataFrame]) -> None:
    for name, (title, columns, words) in SHOWN.items():
        if name not in tables:
            continue
        lines = tables[name][columns].itertuples(index=False)
        rows = [[f"{v:.3g}" if isinstance(v, float) else str(v) for v in line] for line in lines]
        table(title, columns, rows, range(words))


app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
add_command(app, evaluate)

if __name__ == "__main__":
    app(["evaluate", *sys.argv[1:]])
