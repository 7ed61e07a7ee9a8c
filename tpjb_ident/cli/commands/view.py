"""`tpjb view`: a local page to look into a campaign or a folder of results."""

from __future__ import annotations

import contextlib
import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import identified
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.interrupts import heard
from tpjb_ident.runtime.output_folder import former_runs
from tpjb_ident.schema import TABLES

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign


@command("tpjb view {DEMO}", "tpjb view tpjb-compare-out")
def view(
    c: Command,
    source: Path,
    bearing: Path | None = None,
    port: int = 0,
    browser: bool = True,
    seconds: float | None = None,
) -> None:
    """Open a local page with records, points and model.

    Runs with channels, spectra and orbits, windows with weights, prediction beside measurement.

    The page is served on 127.0.0.1 only, under a random path that is printed, and loads nothing from anywhere else.
    Stop with Ctrl-C.
    """
    from rigdata.campaign import campaign_place
    from tpjb_ident.view.server import Session, private_link, serve

    place = campaign_place(source)
    if place.is_dir() and not (place / "campaign.toml").exists() and former_runs(place):
        session = Session(name=place.resolve().name, tables=_tables(c, place))
        c.next("verify", source)
    else:
        campaign = c.open(source)
        session = Session(name=campaign.id, campaign=campaign)
        if campaign.of_kind("dynamic"):
            session.identify = functools.partial(identified, c, campaign)
            if c.has_bearing(campaign):
                session.bearing = c.bearing_of(campaign)
                session.pivots = {"rigid": "rigid", "kirk": "kirk", **_measured_laws(c, campaign, session.bearing)}
        c.next("check", source)
    with contextlib.ExitStack() as links:

        def ready(address: str) -> None:
            c.print(f"{session.name}: {address}   (Ctrl-C ends it)")
            if browser:
                import webbrowser

                webbrowser.open(links.enter_context(private_link(address)))

        try:
            serve(session, port, ready, seconds)
        except KeyboardInterrupt:
            heard()
            c.note("closed.")


def _tables(c: Command, folder: Path) -> dict[str, Any]:
    """Tables of a results folder, and the problems that `check` found."""
    import pandas as pd

    from tpjb_ident.runtime.provenance import read_document
    from tpjb_ident.runtime.table_reader import read_table

    files = {name: folder / f"{name}.csv" for name in TABLES}
    tables = {name: read_table(c.file(path)) for name, path in files.items() if path.exists()}
    findings = folder / "check.json"
    if findings.exists():
        problems = read_document(c.file(findings), "tpjb-check").get("problems")
        rows = [entry for entry in problems if isinstance(entry, dict)] if isinstance(problems, list) else []
        tables["problems"] = pd.DataFrame(rows or [{"what": "none"}]).astype(str)
    if not tables:
        raise BadInputError(f"{folder}: holds no tables. Give a campaign, or the --out folder of another command.")
    return tables


def _measured_laws(c: Command, campaign: Campaign, bearing: Bearing) -> dict[str, Any]:
    """Measured pivot laws, where every pad has a usable dry test."""
    pads = set(range(1, len(bearing.pads) + 1))
    if {run.pad for run in campaign.of_kind("dry_pivot")} < pads:
        return {}
    from tpjb_ident.compare.predictions import measured_laws
    from tpjb_ident.pivot.fit import fit_pivots

    try:
        curves = fit_pivots(campaign, bearing.pivot_angles)
        return {"measured": measured_laws(curves, len(bearing.pads), campaign.id)}
    except ValueError as error:  # one of our own refusals: the page is of use without these curves
        c.warn(f"no measured pivots: {error}")
        return {}
