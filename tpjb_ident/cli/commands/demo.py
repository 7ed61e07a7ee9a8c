"""`tpjb demo`: the main job end to end on a bundled campaign, with its report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.commands.check import check_summary
from tpjb_ident.cli.commands.compare import refuse_comparison, show_comparison, write_comparison
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.options import Out, named, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table, write_text

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import Comparison


@guarded
def demo(out: Out = None) -> None:
    """Run the main job on a bundled campaign, with its report.

    End to end: check, identify, pivot, locus, predict, compare, report.

    The campaign is computed (docs/make_demo_campaign.py): the paper's rocker-backed bearing with pivots softer than the
    printed formula, recorded with noise and glitches.
    """
    from model.bearing_file import parse_bearing
    from rigdata import load_campaign
    from tpjb_ident.compare.comparison import CompareSettings, compare_campaign, model_side
    from tpjb_ident.compare.predictions import prediction_frame
    from tpjb_ident.runtime.executors import background_job

    path = sample("demo.h5")
    target = out_folder(out, "demo")
    options = {"campaign": path, "thermal": "adiabatic", "pivots": ["rigid", "kirk", "measured"], "method": "mm-eiv"}
    with output_folder(target, "demo") as folder:
        campaign = load_campaign(path)
        bearing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
        with background_job(model_side, campaign, bearing, CompareSettings()) as model, progress("demo") as show:
            from tpjb_ident.check.campaign import check_campaign  # loaded while the model is at work
            from tpjb_ident.report.comparison_page import write_report

            show("reading and checking every record", 0, 1)
            summary = check_summary(path, check_campaign(path), campaign)
            write_text(folder / "check.json", json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
            result = compare_campaign(campaign, bearing, progress=show, model=model)
            write_table(folder, "prediction", prediction_frame(result.variant("measured").points))
            show("writing tables", 0, 2)
            write_comparison(folder, result)
            show("drawing figures", 1, 2)
            write_report(folder, result, named(options), campaign.fingerprint())
        write_record(folder, target, "demo", options, summary["files_sha256"])
    counts = summary["counts"]
    print_line(
        f"Read {len(campaign.runs)} records of {path.name}: {counted(counts['error'], 'error')}, "
        f"{counted(counts['warning'], 'warning')}."
    )
    show_comparison(result)
    print_line(_truth_sentence(result, json.loads(sample("demo.truth.json").read_text(encoding="utf-8"))))
    print_line(f"Report: {(target / 'report.html').resolve()}")
    print_line("On your own campaign: tpjb compare CAMPAIGN   (every command: tpjb --help)")
    refuse_comparison(result)


def sample(name: str) -> Path:
    """Path of a bundled file."""
    import rigdata

    return Path(rigdata.__path__[0]) / "samples" / name


def _truth_sentence(result: Comparison, truth: dict[str, Any]) -> str:
    """Say how far the identified direct coefficients are from what was put into the computed records."""
    import numpy as np

    known = {(p["static_load_N"], p["excitation_Hz"]): p for p in truth["points"]}
    off = []
    for p in result.identification.points:
        true = known[(p.point.static_load, p.point.excitation_hz)]
        for found, key in ((p.stiffness.k, "K_apparent"), (p.stiffness.c, "C_apparent")):
            off.append(np.diagonal(found) / np.diagonal(np.array(true[key])) - 1.0)
    return (
        f"The records are computed, so the truth is known: the largest error of an identified direct coefficient is "
        f"{100 * np.max(np.abs(off)):.2f} %."
    )
