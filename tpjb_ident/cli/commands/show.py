"""`tpjb show`: a quick look at a campaign, one of its runs, or a record file of any known kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.terminal import PRINTED
from tpjb_ident.columns import Column, channel_unit, words
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.readers.series import Series
    from rigdata.run import Run
    from rigdata.survey.spectrum import Spectrum

#: Runs that are listed.
MOST_RUNS = 200
BARS = " ▁▂▃▄▅▆▇█"
#: What is this far below the highest bar is blank.
DECADES = 3.0
#: Columns of channels.csv at the terminal.
_COLUMNS = (
    "channel unit samples sample_rate_Hz mean standard_deviation minimum maximum line1_Hz line2_Hz line3_Hz missing"
)


@command("tpjb show {DEMO}", "tpjb show {DEMO} --run d-05000-25-01 --picture", "tpjb show exports/run1.csv")
def show(c: Command, source: Path, run: str | None = None, picture: bool = False) -> None:
    """Show channels, statistics and spectra of a file.

    Of a campaign the list of its runs, or one of them with --run. With --picture or --out also writes channels.csv and
    .parquet, and the picture. Values of a campaign are shown in µm, N, m/s^2, degC, Hz (in mil, lbf, degF, rpm with
    --units us) and written in SI; those of a record file have the units of the file.
    """
    from rigdata.campaign import HDF5_SUFFIXES, MANIFEST_NAME, campaign_place
    from rigdata.survey.exports import read_export
    from rigdata.survey.spectrum import amplitude_spectrum

    place = campaign_place(source)
    if not place.exists():
        raise BadInputError(f"{source}: there is no such file or folder. Check the path.")
    if place.is_dir() or place.suffix.lower() in (*HDF5_SUFFIXES, ".toml"):
        campaign = c.open(source)
        c.next("check", source)
        if run is None:
            _show_campaign(c, campaign)
            if picture:
                raise BadInputError("--picture: of a campaign needs --run ID; the runs are listed above.")
            return
        chosen = campaign.run(run)
        title = f"{chosen.id} ({chosen.kind})"
        with c.progress(f"looking at {place.name}"):
            series, displayed = _run_series(chosen)
    else:
        c.next("check" if (source.parent / MANIFEST_NAME).exists() else "init", source.parent)
        if run is not None:
            raise BadInputError(f"--run: {source.name} is a single record, not a campaign. Leave the option out.")
        title = source.name
        with c.progress(f"looking at {place.name}"):
            displayed = series = list(read_export(c.file(source)).series)
    spectra = {s.name: amplitude_spectrum(s.values, s.rate) for s in displayed}
    rows = [channel_row(s, spectra[s.name]) for s in displayed]
    dead = [row["channel"] for row in rows if not row["maximum"] > row["minimum"]]
    c.print(f"{title}: {counted(len(displayed), 'channel')}, {', '.join(dead) or 'none'} dead.")
    names = _COLUMNS.split()
    c.show(title, [PRINTED[name] for name in names], map(itemgetter(*names), rows))
    lines = [[name, a[4:].tolist(), f[-1]] for name, (f, a) in spectra.items() if len(f) > 4]
    bars = Column("from 0", lambda *values: sparkline(values), words=True)
    if lines:
        c.show("spectra, 3 decades", [*words("channel"), bars, "to {frequency}"], lines)
    if picture or c.out is not None:
        import pandas as pd

        c.options = {"source": source, "shown": title}
        with c.results():
            c.table("channels", pd.DataFrame([channel_row(s, amplitude_spectrum(s.values, s.rate)) for s in series]))
            if picture:
                from tpjb_ident.report.figure import Panel
                from tpjb_ident.report.sections import quick_look

                c.draw([Panel("quick-look", title, quick_look(displayed, spectra, title=printable(title)))])


def _show_campaign(c: Command, campaign: Campaign) -> None:
    """Print the runs of a campaign."""
    c.print(str(campaign))
    if campaign.description:
        c.print(campaign.description)
    rows = []
    for run in campaign.runs[:MOST_RUNS]:
        p = run.point
        place = [p.static_load or None, p.static_load_direction_deg, p.shaft_speed_hz, p.excitation_hz or None]
        rows.append([run.id, run.kind, *place, run.pad and f"#{run.pad}", p.rotation if p.shaft_speed else None])
    quantities = ["load {load}", "direction {angle}", "speed {speed}", "exc. {frequency}"]
    c.show("runs", [*words("run", "kind"), *quantities, "pad", "rotation"], rows)
    if len(campaign.runs) > len(rows):
        c.print(f"... and {len(campaign.runs) - len(rows)} more runs")


def _run_series(run: Run) -> tuple[list[Series], list[Series]]:
    """Channels of a run, calibrated: in SI, and in the units that people read."""
    from rigdata.calibration import DIMENSIONS
    from rigdata.problem import Problem, RigDataError
    from rigdata.readers.series import Series
    from rigdata.units import SI_UNITS

    series = []
    displayed = []
    problems: list[Problem] = []
    for name, channel in run.channels.items():
        if channel.quantity == "time":
            continue
        try:
            record = run.record(name)
        except RigDataError as error:
            problems += error.problems
        else:
            unit = SI_UNITS.get(DIMENSIONS.get(channel.quantity, ""), "")
            series.append(Series(name, unit, record.values, record.time))
            shown, scale, zero = channel_unit(channel.quantity)
            displayed.append(Series(name, shown or unit, (record.values - zero) / scale, record.time))
    if not series:
        raise RigDataError(problems)
    return series, displayed


def channel_row(series: Series, spectrum: Spectrum) -> dict[str, Any]:
    """A channel in channels.csv."""
    import numpy as np

    from rigdata.survey.spectrum import strongest

    good = series.values[np.isfinite(series.values)]
    shown = good if len(good) else np.full(1, math.nan)
    frequencies = [line.frequency for line in strongest(*spectrum, 3)] + 3 * [math.nan]
    return {
        "channel": series.name,
        "unit": series.unit,
        "samples": len(series),
        "missing": len(series) - len(good),
        "sample_rate_Hz": series.rate,
        "mean": shown.mean(),
        "standard_deviation": shown.std(),
        "minimum": shown.min(),
        "maximum": shown.max(),
        **{f"line{i + 1}_Hz": frequencies[i] for i in range(3)},
    }


def sparkline(values: Sequence[float], width: int = 48) -> str:
    """Draw positive values on a logarithmic scale, the largest of neighbours where they share a cell.

    >>> sparkline([1.0, 10.0, 100.0, 1000.0], width=4)
    ' ▃▅█'
    """
    import numpy as np

    heights = np.nan_to_num(values, nan=0.0, posinf=0.0)
    peaks = np.array([cell.max() for cell in np.array_split(heights, min(width, len(heights)) or 1) if len(cell)])
    least = 10.0**-DECADES
    shares = 1.0 + np.log10(np.maximum(peaks / (peaks.max(initial=0.0) or 1.0), least)) / DECADES
    return "".join(BARS[int(step)] for step in np.rint(shares * (len(BARS) - 1)))
