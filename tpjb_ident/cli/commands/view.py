"""`tpjb view`: a local page to look into a campaign or a folder of results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import campaign_place, open_bearing, open_campaign
from tpjb_ident.cli.common.options import BearingOption
from tpjb_ident.cli.common.terminal import note_line, print_line
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import former_runs

if TYPE_CHECKING:
    from tpjb_ident.view.server import Session

Source = Annotated[Path, typer.Argument(metavar="CAMPAIGN|DIR", help="A campaign, or an output folder of tpjb.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine; 0: any free one.")]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in your browser.")]
Seconds = Annotated[float | None, typer.Option(min=0.1, help="Stop after this time [default: at Ctrl-C].")]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Not used: looking writes nothing.", hidden=False)
]


@guarded
def view(
    source: Source,
    bearing: BearingOption = None,
    port: Port = 0,
    browser: Browser = True,
    seconds: Seconds = None,
    out: Out = None,
) -> None:
    """Open a local page with records, points and model.

    Runs with channels, spectra and orbits, windows with weights, prediction beside measurement.

    The page is served on 127.0.0.1 only and loads nothing from anywhere else. Stop with Ctrl-C.
    """
    session = _session(source, bearing)
    from tpjb_ident.view.server import serve

    def ready(address: str) -> None:
        print_line(f"{session.name}: {address}   (Ctrl-C ends it)")
        if browser:
            import webbrowser

            webbrowser.open(address)

    try:
        serve(session, port, ready, seconds)
    except KeyboardInterrupt:
        note_line("note", "closed.")


def _session(source: Path, bearing: Path | None) -> Session:
    from tpjb_ident.view.server import Session

    place = campaign_place(source)
    if place.is_dir() and not (place / "campaign.toml").exists() and former_runs(place):
        return Session(name=place.resolve().name, tables=_tables(place))
    campaign = open_campaign(source)
    session = Session(name=campaign.id, campaign=campaign)
    if campaign.of_kind("dynamic"):
        from tpjb_ident.dynamic.identify import identify
        from tpjb_ident.dynamic.settings import IdentifySettings

        session.identify = lambda: identify(campaign, IdentifySettings())
        if bearing is not None or campaign.bearing_text:
            drawn, _ = open_bearing(campaign, bearing)
            session.bearing = drawn
            session.pivots = {"rigid": "rigid", "kirk": "kirk", **_measured(campaign, drawn)}
    return session


def _tables(folder: Path) -> dict[str, Any]:
    import pandas as pd

    found: dict[str, Any] = {path.stem: pd.read_parquet(path) for path in sorted(folder.glob("*.parquet"))}
    for path in sorted(folder.glob("*.json")):
        if path.name == "check.json":
            problems = json.loads(path.read_text(encoding="utf-8")).get("problems", [])
            found["problems"] = pd.DataFrame(problems or [{"what": "none"}])
    if not found:
        raise BadInputError(f"{folder}: holds no tables. Give a campaign, or the --out folder of another command.")
    return found


def _measured(campaign: Any, drawn: Any) -> dict[str, Any]:
    """Measured pivot laws, where every pad has a usable dry test."""
    runs = campaign.of_kind("dry_pivot")
    if {r.pad for r in runs} < set(range(1, len(drawn.pads) + 1)):
        return {}
    from tpjb_ident.compare.measured_pivots import measured_laws
    from tpjb_ident.pivot import fit_pivots

    try:
        curves = fit_pivots(campaign, [pad.pivot_angle for pad in drawn.pads])
        return {"measured": measured_laws(curves, len(drawn.pads), campaign.id)}
    except ValueError as error:  # one of our own refusals: the page is of use without these curves
        note_line("warning", f"no measured pivots: {error}")
        return {}
