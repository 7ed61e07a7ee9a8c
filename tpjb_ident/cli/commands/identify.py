"""`tpjb identify`: dynamic records in, stiffness and damping with intervals out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.identification_display import refused_bands, show_identification
from tpjb_ident.cli.common.inputs import open_bearing, open_campaign
from tpjb_ident.cli.common.options import (
    CampaignPath,
    Delays,
    Lines,
    Method,
    Norm,
    Out,
    Scheduler,
    WorkerCount,
    as_given,
    out_folder,
    refuse_unknown,
)
from tpjb_ident.cli.common.quantities import parse_values
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import command_line, note_line, print_line, progress
from tpjb_ident.conditions import sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.executors import cores, forks
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table

if TYPE_CHECKING:
    from pathlib import Path

    from rigdata.campaign import Campaign
    from tpjb_ident.dynamic.plain import PlainSettings
    from tpjb_ident.dynamic.records.run_phasors import PhasorSettings
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.runs.run_store import RunStore

#: Records [bytes] above which several processes are quicker than one though each has to import everything, runs above
#: which copies of this one are, and how many copies.
WORTH_PROCESSES, WORTH_COPIES, MOST_COPIES = 100 * 2**20, 12, 4
PlainWay = Annotated[
    bool, typer.Option("--plain", help="Also write plain.csv: Eq. (15) by statsmodels' RLM, nothing corrected.")
]
KeepR = Annotated[bool, typer.Option("--keep-r", help="Write the R matrices of Eq. (15) too: r_matrices.h5.")]
Window = Annotated[str, typer.Option("--window", metavar="TIME", help="Window length of --plain and --keep-r.")]
#: Folder in the output folder in which finished runs wait for the others.
KEPT = ".tpjb-finished-runs"
#: What worker processes need, imported once for all of them.
PRELOAD = ("tpjb_ident.dynamic.runs.run_jobs", "rigdata.readers.hdf5.reader", "rigdata.readers.text.csv", "h5py")


@guarded
def identify(
    campaign: CampaignPath,
    method: Method = "mm-eiv",
    norm: Norm = None,
    lines: Lines = None,
    delay: Delays = None,
    workers: WorkerCount = None,
    scheduler: Scheduler = None,
    plain: PlainWay = False,
    keep_r: KeepR = False,
    window: Window = "0.5 s",
    out: Out = None,
) -> None:
    """Identify stiffness and damping with 95 % intervals.

    One row per operating point, in tables: writes coefficients (chosen method), estimators (every method,
    statsmodels RLM among them), windows (rejected ones, with reasons) and frequency_fits (K-C and K-C-M over
    frequency, per load), each as .csv and .parquet. Runs excited over a band (multi-sine, noise, sweep, impact) give
    frf, frf_estimators and frf_models. Exit code 3 if a point is not to be trusted.
    """
    options = as_given(locals())
    source = open_campaign(campaign)
    phasors = _phasor_settings(lines, delay or ())
    settings = replace(identify_settings(source, method, norm), phasors=phasors, keep_weights=False)
    from tpjb_ident.dynamic.identify import identify as run_identification
    from tpjb_ident.runtime.workers import open_workers

    count, start = _worker_count(source, workers, scheduler)
    target = out_folder(out, "identify")
    with output_folder(target, "identify", (campaign,)) as folder:
        with (
            open_workers(count, scheduler, PRELOAD, start) as team,
            finished_runs(target) as store,
            progress("identifying") as show,
        ):
            result = run_identification(source, settings, show, team, store)
        write_identification(folder, result)
        if plain or keep_r:
            _write_plain(folder, source, _plain_settings(window, norm), keep_r)
        write_record(folder, target, "identify", options, source.fingerprint(), result.remarks())
    show_identification(result)
    if result.points:
        command_line(f"tpjb {'compare' if source.bearing_text else 'export --to ross'} {campaign}")
    print_line(f"Results: {target}")
    refuse_untrusted(result)


@contextmanager
def finished_runs(target: Path) -> Iterator[RunStore]:
    """Give a store of finished runs inside the output folder; only a kill or Ctrl-C leaves it there.

    Results come into the folder whole or not at all; what is kept for a rerun stands apart from them, in a folder of
    its own, and goes when the command ends, well or with an error.
    """
    from tpjb_ident.dynamic.runs.run_store import RunStore

    store = RunStore(target / KEPT)
    try:
        yield store
    except Exception:
        store.clear()
        raise
    store.clear()


def _worker_count(campaign: Campaign, asked: int | None, scheduler: str | None) -> tuple[int | None, str | None]:
    """Processes to use, and how they begin: as asked, else one per core where the records pay for starting them."""
    if scheduler is not None:
        if asked is not None:
            raise BadInputError("--workers: processes here, and --scheduler: a cluster, exclude each other. Give one.")
        return None, None
    if asked is not None:
        return asked, None
    size = sum(path.stat().st_size for path in campaign.files.values() if path.is_file())
    if size > WORTH_PROCESSES:
        return None, None
    copies = min(cores(), MOST_COPIES) if forks() and len(campaign.of_kind("dynamic")) > WORTH_COPIES else 1
    return copies, "fork"


def _phasor_settings(lines: str | None, delays: Sequence[str]) -> PhasorSettings:
    """Build `PhasorSettings` from ``--lines`` and ``--delay``."""
    from rigdata.units import UnitError, parse_quantity
    from tpjb_ident.dynamic.records.extraction import QUANTITIES
    from tpjb_ident.dynamic.records.run_phasors import PhasorSettings

    driven = () if lines is None else parse_values(lines, "speed", "--lines")
    known: dict[str, float] = {}
    for text in delays:
        quantity, _, time = text.partition("=")
        refuse_unknown(quantity, QUANTITIES, "--delay")
        try:
            known[quantity] = parse_quantity(time, "time")
        except UnitError as error:
            raise BadInputError(f"--delay {text!r}: {error}. Write, for instance, --delay force=0.2ms.") from error
    return PhasorSettings(excitation_lines=tuple(f / (2 * math.pi) for f in driven), delays=known)


def identify_settings(campaign: Campaign, method: str, norm: str | None) -> Any:
    """Build `IdentifySettings` from options, with the campaign's clearance for the amplitude check."""
    from tpjb_ident.dynamic.estimators.estimate import METHODS, NORMS
    from tpjb_ident.dynamic.settings import IdentifySettings

    refuse_unknown(method, METHODS, "--method")
    if norm is not None:
        refuse_unknown(norm, tuple(NORMS), "--norm")
        if method != "rlm":
            raise BadInputError(f"--norm: belongs to --method rlm, not to {method}.")
    if not campaign.of_kind("dynamic"):
        raise BadInputError(f"campaign {campaign.id}: has no dynamic runs; there is nothing to identify.")
    chosen = f"rlm:{norm or 'huber'}" if method == "rlm" else method
    return IdentifySettings(method=chosen, clearance=_clearance(campaign))


def _clearance(campaign: Campaign) -> float | None:
    """Smallest assembled clearance [m], None if the campaign carries no bearing that can be read."""
    from model.bearing import BearingError

    if not campaign.bearing_text:
        return None
    try:
        bearing, _ = open_bearing(campaign, None)
    except BearingError as error:  # coefficients need no bearing
        note_line("warning", f"{error} Until then the amplitude is not held against the clearance.")
        return None
    return min(pad.assembled_clearance for pad in bearing.pads)


def write_identification(folder: Path, result: Identification) -> None:
    """Write coefficients, estimators, windows and the models over frequency; h over the band where one was excited."""
    from tpjb_ident.dynamic.broadband.band_result import frf_frame, models_frame

    if result.bands:
        write_table(folder, "frf", frf_frame(result.bands))
        write_table(folder, "frf_estimators", frf_frame(result.bands, every_method=True))
        write_table(folder, "frf_models", models_frame(result.bands))
    if result.bands and not result.points:
        return
    write_table(folder, "coefficients", result.to_frame())
    write_table(folder, "estimators", result.estimators_frame())
    write_table(folder, "windows", result.windows_frame())
    write_table(folder, "frequency_fits", result.frequency_frame())
    write_table(folder, "budget", result.budget_frame())


def _plain_settings(window: str, norm: str | None) -> PlainSettings:
    """Build `PlainSettings` from ``--window`` and ``--norm``."""
    from rigdata.units import UnitError, parse_quantity
    from tpjb_ident.dynamic.plain import PlainSettings

    try:
        length = parse_quantity(window, "time")
    except UnitError as error:
        raise BadInputError(f"--window {window!r}: {error}. Write, for instance, --window '0.5 s'.") from error
    if not length > 0:
        raise BadInputError(f"--window {window!r}: must be above zero.")
    return PlainSettings(length, norm or "huber")


def _write_plain(folder: Path, campaign: Campaign, settings: PlainSettings, keep_r: bool) -> None:
    """Write ``plain`` (Eq. (15) by statsmodels' RLM, nothing else) and, if asked for, the R matrices behind it."""
    from tpjb_ident.dynamic.plain import plain_frame, plain_points, write_r_matrices

    points = plain_points(campaign, settings)
    write_table(folder, "plain", plain_frame(points, settings))
    if keep_r:
        write_r_matrices(folder / "r_matrices.h5", points)


def refuse_untrusted(result: Identification) -> None:
    """End with exit code 3 if a point has no answer, or one that is not to be trusted, or no run any more."""
    import numpy as np

    bad = refused_bands(result.bands)
    for p in result.points:
        serious = sentences(untrusted(p.quality))
        if serious or not np.isfinite(p.stiffness.h).all():
            bad.append(f"{p.point.static_load / 1e3:g} kN, {p.point.excitation_hz:g} Hz: {'; '.join(serious)}")
    lost = sentences(untrusted(result.conditions))
    if lost and not bad:
        raise NotTrustedError("; ".join(lost))
    if bad:
        more = f"\n... and {len(bad) - 5} more" if len(bad) > 5 else ""
        of = len(result.points) + sum(not band.points for band in result.bands)
        raise NotTrustedError(f"{len(bad)} of {of} points:\n" + "\n".join([*bad[:5], *lost]) + more)
