"""`tpjb demo`: the main job end to end on a bundled campaign, with its report."""

from __future__ import annotations

import json
from pathlib import Path

import rigdata
from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.commands.check import check_summary
from tpjb_ident.cli.commands.compare import show_comparison, write_comparison
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.executors import background_job


@command("tpjb demo", "tpjb demo --out /tmp/look")
def demo(c: Command) -> None:
    """Run the main job on a bundled campaign, with its report.

    End to end: check, identify, pivot, locus, predict, compare, report.

    The campaign is computed (docs/make_demo_campaign.py): the paper's rocker-backed bearing with pivots softer than the
    printed formula, recorded with noise and glitches.
    """
    from tpjb_ident.compare.comparison import CompareSettings, compare_campaign, model_side

    path = Path(rigdata.__path__[0]) / "samples" / "demo.h5"
    c.options = {"campaign": path, "thermal": "adiabatic", "pivots": ["rigid", "kirk", "measured"], "method": "mm-eiv"}
    with c.results():
        campaign = c.open(path)
        bearing = c.bearing_of(campaign)
        with background_job(model_side, campaign, bearing, CompareSettings()) as model, c.progress("demo") as show:
            from tpjb_ident.check.campaign import check_campaign  # loaded while the model is at work

            show("reading and checking every record", 0, 1)
            summary = check_summary(c, campaign.id, check_campaign(path), campaign)
            c.json("check.json", summary)
            result = compare_campaign(campaign, bearing, progress=show, model=model)
            c.table("prediction", result.predictions["measured"])
            import numpy as np

            truth = json.loads(path.with_name("demo.truth.json").read_text("utf-8"))
            true = np.array([[p["K_apparent"], p["C_apparent"]] for p in truth["points"]])
            measured = np.array([[p.stiffness.k, p.stiffness.c] for p in result.identification.points])
            error = 100 * np.abs(np.diagonal(measured / true - 1.0, axis1=-2, axis2=-1)).max()
            note = f"The records are computed: identified direct coefficients are within {error:.2f} % of the truth."
            c.next("init", "FOLDER-OF-YOUR-RECORDS")
            write_comparison(c, result, show, note)
    show_comparison(c, result)
    counts = ", ".join(counted(summary["counts"][severity], severity) for severity in ("error", "warning"))
    c.print(f"Read {len(campaign.runs)} records of {path.name}: {counts}.")
    c.print(note)
    c.print("On your own campaign: tpjb compare CAMPAIGN   (every command: tpjb --help)")
    c.next("view", c.target)
