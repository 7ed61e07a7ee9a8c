"""`tpjb show`: a quick look at a campaign, one of its runs, or a record file of any known kind."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import campaign_place, open_campaign
from tpjb_ident.cli.common.options import Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.readers.series import Series
    from rigdata.run import Run
    from rigdata.survey.spectrum import Look

#: Unit that people read, its size in SI and where its zero lies.
READ = {"m": ("µm", 1e-6, 0.0), "K": ("degC", 1.0, 273.15), "rad/s": ("Hz", 2 * math.pi, 0.0), "Pa": ("bar", 1e5, 0.0)}
CAMPAIGNS = (".h5", ".hdf5", ".hdf", ".he5", ".toml")
Source = Annotated[
    Path, typer.Argument(metavar="FILE", help="A campaign, or one record file (CSV, TDMS, UFF, MAT, ..).")
]
Wanted = Annotated[str | None, typer.Option("--run", metavar="ID", help="One run of a campaign, channel by channel.")]
Picture = Annotated[bool, typer.Option("--picture", help="Draw channels and spectra to a PNG and an SVG in --out.")]
BARS = " ▁▂▃▄▅▆▇█"
PLAIN = " .:-=+*#@"
#: What lies this far below the highest bar is blank.
DECADES = 3.0


@guarded
def show(source: Source, run: Wanted = None, picture: Picture = False, out: Out = None) -> None:
    """Show channels, statistics and spectra of a file.

    Of a campaign the list of its runs, or one of them with --run. With --picture or --out also writes channels.csv and
    .parquet, and the picture. Values of a campaign are shown in µm, N, m/s^2, degC, Hz and written in SI; those of a
    record file have the units of the file.
    """
    place = campaign_place(source)
    if not place.exists():
        raise BadInputError(f"{source}: there is no such file or folder. Check the path.")
    campaign = open_campaign(source) if place.is_dir() or place.suffix.lower() in CAMPAIGNS else None
    if campaign is not None and run is None:
        _show_campaign(campaign)
        if picture:
            raise BadInputError("--picture: of a campaign needs --run ID; the runs are listed above.")
        return
    if campaign is None and run is not None:
        raise BadInputError(f"--run: {source.name} is a single record, not a campaign. Leave the option out.")
    with progress(f"looking at {source.name}"):
        title, series = _run_series(campaign.run(run)) if campaign and run else _file_series(source)
        shown = [_for_people(s) for s in series] if campaign else series
        looks = {s.name: _look(s) for s in shown}
    show_channels(title, shown, looks)
    if picture or out is not None:
        _write(out_folder(out, "show"), source, title, series, (shown, looks) if picture else None)


def _show_campaign(campaign: Campaign) -> None:
    """Print the runs of a campaign."""
    print_line(str(campaign))
    if campaign.description:
        print_line(campaign.description)
    rows = []
    for r in campaign.runs[:200]:
        p = r.point
        rows.append([
            r.id, r.kind, f"{p.static_load / 1e3:g}" if p.static_load else "-", f"{p.static_load_direction_deg:g}",
            f"{p.shaft_speed_hz:g}", f"{p.excitation_hz:g}" if p.excitation else "-",
            "" if r.pad is None else f"#{r.pad}",
        ])  # fmt: skip
    columns = ["run", "kind", "load kN", "direction deg", "speed Hz", "exc. Hz", "pad"]
    table("runs", columns, rows, words=(0, 1))
    if len(campaign.runs) > len(rows):
        print_line(f"... and {len(campaign.runs) - len(rows)} more runs")


def _run_series(run: Run) -> tuple[str, list[Series]]:
    """Channels of a run, calibrated."""
    from rigdata.problem import Problem, RigDataError
    from rigdata.readers.series import Series

    units = {"displacement": "m", "force": "N", "acceleration": "m/s^2", "temperature": "K", "pressure": "Pa",
             "speed": "rad/s"}  # fmt: skip
    found: list[Series] = []
    problems: list[Problem] = []
    for name, channel in run.channels.items():
        if channel.quantity == "time":
            continue
        try:
            record = run.record(name)
        except RigDataError as error:
            problems.extend(error.problems)
        else:
            found.append(Series(name, units.get(channel.quantity, ""), record.values, record.time))
    if not found:
        raise RigDataError(problems)
    return f"{run.id} ({run.kind})", found


def _file_series(path: Path) -> tuple[str, list[Series]]:
    """Channels of a record file, as they are."""
    from rigdata.survey.exports import read_export

    return path.name, list(read_export(path).series)


def _for_people(one: Series) -> Series:
    """A calibrated channel in the unit that people read."""
    unit, scale, zero = READ.get(one.unit, (one.unit, 1.0, 0.0))
    return replace(one, unit=unit, values=one.values / scale - zero)


def _look(series: Series) -> Look:
    from rigdata.survey.spectrum import look_at

    return look_at(series.values, series.rate)


def show_channels(title: str, series: list[Series], looks: dict[str, Look]) -> None:
    """Print statistics and a spectrum per channel."""
    rows = []
    for s in series:
        look = looks[s.name]
        lines = ", ".join(f"{x.frequency:.4g}" for x in look.lines)
        flag = "dead" if look.flat else f"{look.missing} missing" if look.missing else ""
        rows.append([s.name, s.unit, f"{look.count}", f"{s.rate:g}" if s.rate > 0 else "?", f"{look.mean:.4g}",
                     f"{look.deviation:.3g}", f"{look.low:.4g}", f"{look.high:.4g}", lines, flag])  # fmt: skip
    columns = ["channel", "unit", "samples", "rate Hz", "mean", "std", "min", "max", "lines Hz", ""]
    table(title, columns, rows, words=(0, 1, 8, 9))
    drawn = [[s.name, sparkline(looks[s.name].amplitude[4:].tolist()), f"{looks[s.name].frequency[-1]:g}"]
             for s in series if len(looks[s.name].amplitude) > 4]  # fmt: skip
    if drawn:
        table("spectra, 3 decades", ["channel", "from 0", "to Hz"], drawn, words=(0, 1))


def _write(
    target: Path, source: Path, title: str, series: list[Series], picture: tuple[list[Series], dict[str, Look]] | None
) -> None:
    import pandas as pd

    rows = [
        {"channel": s.name, "unit": s.unit, "samples": k.count, "missing": k.missing, "sample_rate_Hz": s.rate,
         "mean": k.mean, "standard_deviation": k.deviation, "minimum": k.low, "maximum": k.high,
         **{f"line{i + 1}_Hz": k.lines[i].frequency if i < len(k.lines) else float("nan") for i in range(3)}}
        for s, k in ((s, _look(s)) for s in series)
    ]  # fmt: skip
    inputs = {}
    if source.is_file():
        from tpjb_ident.runtime.provenance import sha256

        inputs = {source.name: sha256(source)}
    with output_folder(target, "show", (source,) if source.is_dir() else ()) as folder:
        write_table(folder, "channels", pd.DataFrame(rows))
        if picture:
            from tpjb_ident.report.panels import write_quick_look

            write_quick_look(folder, title, *picture)
        write_record(folder, target, "show", {"source": source, "shown": title}, inputs)
    print_line(f"Results: {target}")


def sparkline(values: Sequence[float], width: int = 48, plain: bool = False) -> str:
    """Draw positive values on a logarithmic scale, the largest of neighbours where they share a cell.

    >>> sparkline([1.0, 10.0, 100.0, 1000.0], width=4)
    ' ▃▅█'
    """
    finite = [v if math.isfinite(v) and v > 0 else 0.0 for v in values]
    top = max(finite, default=0.0)
    if top <= 0:
        return " " * min(width, len(finite))
    width = min(width, len(finite))
    edges = [round(i * len(finite) / width) for i in range(width + 1)]
    letters = PLAIN if plain else BARS
    out = []
    for first, last in itertools.pairwise(edges):
        peak = max(finite[first:last])
        share = 1.0 + math.log10(peak / top) / DECADES if peak > 0 else 0.0
        out.append(letters[max(0, min(len(letters) - 1, round(share * (len(letters) - 1))))])
    return "".join(out)
