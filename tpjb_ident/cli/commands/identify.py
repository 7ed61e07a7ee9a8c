"""`tpjb identify`: dynamic records in, stiffness and damping with intervals out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import identify_settings, show_identification, write_identification
from tpjb_ident.cli.inputs import parse_value, parse_values
from tpjb_ident.cli.options import refuse_unknown
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.executors import cores, forks

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from tpjb_ident.runs.run_jobs import RunStore

#: Records [bytes] above which several processes are quicker than one though each has to import everything, runs above
#: which copies of this one are, and how many copies.
WORTH_PROCESSES, WORTH_COPIES, MOST_COPIES = 100 * 2**20, 12, 4
#: Length of a window [s] that holds samples at any rate.
_SHORTEST = 1e-6
#: Folder in the output folder in which finished runs wait for the others.
KEPT = ".tpjb-finished-runs"


@command("tpjb identify {DEMO}", "tpjb identify {DEMO} --method rlm --norm tukey --out rlm")
def identify(
    c: Command,
    campaign: Path,
    method: str = "mm-eiv",
    norm: str | None = None,
    lines: str | None = None,
    delay: list[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    plain: bool = False,
    keep_r: bool = False,
    window: str = "0.5 s",
) -> None:
    """Identify stiffness and damping with 95 % intervals.

    One row per operating point, in tables: writes coefficients (chosen method), estimators (every method,
    statsmodels RLM among them), windows (rejected ones, with reasons) and frequency_fits (K-C and K-C-M over
    frequency, per load), each as .csv and .parquet. Runs excited over a band (multi-sine, noise, sweep, impact) give
    frf, frf_estimators and frf_models. Exit code 3 if a point is not to be trusted.
    """
    if scheduler is not None and workers is not None:
        raise BadInputError("--workers: processes here, and --scheduler: a cluster, exclude each other. Give one.")
    from tpjb_ident.phasors.run_data import VECTOR_QUANTITIES, PhasorSettings

    source = c.open(campaign)
    excited = parse_values(lines, "speed", "--lines") if lines is not None else ()
    delays = {}
    for text in delay or ():
        quantity, _, time = text.partition("=")
        refuse_unknown(quantity, VECTOR_QUANTITIES, "--delay")
        delays[quantity] = parse_value(time, "time", f"--delay {quantity}")
    phasors = PhasorSettings(excitation_lines=tuple(omega / (2 * math.pi) for omega in excited), delays=delays)
    settings = replace(identify_settings(c, source), phasors=phasors, keep_weights=False)
    from tpjb_ident.identification.identify import identify as run_identification
    from tpjb_ident.runtime.executors import open_workers

    team = open_workers(workers, scheduler) if workers or scheduler else open_workers(*_worth_starting(source))
    with c.results():
        with team as opened, _finished_runs(c) as store, c.progress("identifying") as show:
            result = run_identification(source, settings, show, opened, store)
        write_identification(c, result)
        if plain or keep_r:
            from tpjb_ident.identification.plain import PlainSettings, plain_frame, plain_points, write_r_matrices

            length = parse_value(window, "time", "--window", _SHORTEST)
            plain_settings = PlainSettings(length, norm or "huber")
            points = plain_points(source, plain_settings)
            c.table("plain", plain_frame(points, plain_settings))
            if keep_r:
                write_r_matrices(c.folder / "r_matrices.h5", points)
        c.remarks = result.remarks()
    show_identification(c, result)
    if settings.clearance is not None:  # its bearing can be read
        c.next("compare", campaign)
    elif result.points:
        c.next("export", c.target, "--to", "ross")
    c.distrust(result.doubt)


@contextmanager
def _finished_runs(c: Command) -> Iterator[RunStore]:
    """Give a store of finished runs inside the output folder; only a kill or Ctrl-C leaves it there.

    Results come into the folder whole or not at all; what is stored for a rerun is apart from them, in a folder of
    its own, and goes when the command ends, well or with an error.
    """
    from tpjb_ident.runs.run_jobs import RunStore

    store = RunStore(c.target / KEPT)
    try:
        yield store
    except Exception:
        store.clear()
        raise
    except KeyboardInterrupt:
        if store.folder.is_dir():
            c.note(f"finished runs wait in {store.folder}: the same command goes on from there.")
        raise
    store.clear()


def _worth_starting(campaign: Campaign) -> tuple[int | None, None, str | None]:
    """Processes that pay for being started, and how they begin: one per core for long records, else copies of this."""
    if sum(path.stat().st_size for path in campaign.files.values() if path.is_file()) > WORTH_PROCESSES:
        return None, None, None
    many = forks() and len(campaign.of_kind("dynamic")) > WORTH_COPIES
    return min(cores(), MOST_COPIES) if many else 1, None, "fork"
