"""`tpjb evaluate`: how often a diagnosis is right, from campaigns with hidden effects; regenerates the evidence."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.errors import BadInputError, guarded
from tpjb_ident.cli.options import BearingPath, Out, Scheduler, WorkerCount, out_folder
from tpjb_ident.cli.outdir import output_folder
from tpjb_ident.cli.record import write_record
from tpjb_ident.cli.show import progress, say, table
from tpjb_ident.provenance import sha256
from tpjb_ident.tables import write_table, write_text

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.diagnose.bench import Bench
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
    workers: WorkerCount = None,
    scheduler: Scheduler = None,
    out: Out = None,
) -> None:
    """Draw campaigns with hidden effects, diagnose them, and count: the evidence behind `tpjb diagnose`.

    Writes trials, summary, confusion, figures and rules as .csv and .parquet, and evidence.md. The same seed gives
    the same campaigns, whatever the workers. With --keep, rows of raw trials are made anew where the code of the
    diagnosis has changed since; delete the folder when the virtual rig has.
    """
    if scheduler is not None and workers is not None:
        raise BadInputError("--workers: processes here, and --scheduler: a cluster, exclude each other. Give one.")
    from model.bearing_file import load_bearing
    from tpjb_ident.diagnose.bench import paper_layout, prepare
    from tpjb_ident.diagnose.trials import Plan
    from tpjb_ident.executors import open_workers

    plan = Plan(_numbers(sizes, "--sizes"), _numbers(noises, "--noises"), seeds, none, left_out, two, raw)
    drawn = load_bearing(bearing)
    target = out_folder(out, "evaluate")
    options = {"bearing": bearing, "sizes": sizes, "noises": noises, "seeds": seeds, "none": none,
               "left_out": left_out, "two": two, "raw": raw, "keep": keep}  # fmt: skip
    with output_folder(target, "evaluate") as folder:
        with progress("evaluating") as show:
            show("tabling the model", 0, 100)
            bench = prepare(drawn, paper_layout(len(drawn.pads)), _store(keep, bearing))
            with open_workers(workers, scheduler, PRELOAD) as team:
                rows = _run(team, bench, plan, show) + _run_raw(team, bench, drawn, raw, keep, show)
            show("next tests", 99, 100)
            tests = _next_tests(bench, drawn)
        summary = _write(folder, rows, tests)
        write_record(folder, target, "evaluate", options, {bearing.name: sha256(bearing)})
    _show(summary)
    say(f"Results: {target}")


def _numbers(text: str, name: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise BadInputError(f"{name} {text!r}: must be numbers with commas between them, such as 6,12.") from error
    if not all(0 < value < 1e6 for value in values):
        raise BadInputError(f"{name} {text!r}: numbers must be positive and below a million.")
    return values


def _store(keep: Path | None, bearing: Path) -> Path | None:
    """Where the tables of this very bearing are kept."""
    if keep is None:
        return None
    keep.mkdir(parents=True, exist_ok=True)
    return keep / f"{sha256(bearing)[:16]}.npz"


def _run(team: Workers, bench: Bench, plan: Any, show: Any) -> list[dict[str, Any]]:
    from tpjb_ident.diagnose.trials import run_trial, trials
    from tpjb_ident.executors import in_order

    drawn_trials = list(trials([c.label for c in bench.pool], plan))
    rows = []
    for row in in_order(team, run_trial, [(trial,) for trial in drawn_trials], bench):
        rows.append(row)
        show(f"{row['kind']} {' + '.join(row['truth'])}", len(rows), len(drawn_trials))
    return rows


def _run_raw(team: Workers, bench: Bench, drawn: Any, count: int, keep: Path | None, show: Any) -> list[dict[str, Any]]:
    if not count:
        return []
    from tpjb_ident.diagnose.raw_rows import raw_rows
    from tpjb_ident.diagnose.raw_trials import raw_bench, raw_trials

    shared = raw_bench(bench, drawn, keep)
    groups = raw_trials([c.label for c in bench.pool], count)
    total, done = sum(map(len, groups)), []

    def told(row: dict[str, Any]) -> None:
        done.append(row)
        show(f"raw volts, {row['kind']}", len(done), total)

    return raw_rows(team, shared, groups, told)


def _next_tests(bench: Bench, drawn: Any) -> pd.DataFrame:
    from model.pivots import pivot_laws
    from model.setup import Setup
    from tpjb_ident.diagnose.next_test_trials import alike_pairs, next_test_table

    return next_test_table(bench, Setup(drawn, pivot_laws("kirk", drawn)), alike_pairs(bench))


def _write(folder: Path, rows: list[dict[str, Any]], tests: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    from tpjb_ident.diagnose.evidence import (
        confusion_table,
        figures_table,
        markdown,
        outcome,
        rules_table,
        summary_table,
    )

    flat = [
        {**{k: " | ".join(map(str, v)) if isinstance(v, tuple) else v for k, v in row.items() if k != "naive"},
         "outcome": outcome(row)}
        for row in rows
    ]  # fmt: skip
    write_table(folder, "trials", pd.DataFrame(flat))
    tables = {
        "summary": summary_table(rows),
        "figures": figures_table(rows),
        "rules": rules_table(rows),
        "next_tests": tests,
        "confusion": confusion_table(rows),
        "impostors": confusion_table(rows, "left out"),
    }
    texts = []
    for name, frame in tables.items():
        write_table(folder, name, frame)
        texts.append(f"## {name}\n\n{markdown(frame)}")
    write_text(folder / "evidence.md", "\n".join(texts))
    return tables["summary"]


def _show(summary: pd.DataFrame) -> None:
    columns = ["rung", "kind", "size_sigma", "noise_factor", "trials", "right_share", "abstained_share", "errors"]
    rows = [
        [f"{v:.3g}" if isinstance(v, float) else str(v) for v in row]
        for row in summary[columns].itertuples(index=False)
    ]
    table("Outcomes", columns, rows, (0, 1))
