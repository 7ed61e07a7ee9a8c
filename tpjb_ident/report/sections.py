"""What pages and commands share: what was tested, tables and panels of results, set-up, runs, raw evidence."""

import functools
import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.readers.series import Series
from rigdata.run import Run
from rigdata.survey.spectrum import Spectrum
from tpjb_ident.clearance.locus import Locus
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.columns import amount, channel_unit, degrees, size, spinning, symbol
from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.compare.comparison import Comparison
from tpjb_ident.conditions import SEVERITIES, Condition, untrusted
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.tables import Formula
from tpjb_ident.report.drawing.picture import (
    BLUE,
    CROSS,
    DIRECT,
    INK,
    constant_along,
    label,
    longest_series,
    new_pictures,
    plot,
    point_labels,
    points_table,
    thinned,
)
from tpjb_ident.report.figure import Panel
from tpjb_ident.report.page import Section, Table, plain_templates
from tpjb_ident.report.plots.coefficients import coefficient, frf
from tpjb_ident.report.plots.records import coherence, coherence_spectrum, orbit, spectra
from tpjb_ident.report.plots.static_tests import clearance_and_locus, load_deflection, pad_projection, pivot_stiffness
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.rounding import counted, fixed, with_interval
from tpjb_ident.runtime.tables import printable
from tpjb_ident.schema import DAMPING, ENTRIES, KINDS, STIFFNESS, Coefficient

#: Kinds of runs, where people do not call them by their names.
KINDS_IN_WORDS = {"locus": "shaft locus", "clearance": "clearance sweep", "dry_pivot": "dry pivot test"}


def tested_facts(campaign: Campaign | TableSource, bearing: Any, points: Sequence[PointResult]) -> dict[str, str]:
    """What was tested, for the head of a page: bearing, loads, speeds, excitation, runs, when and by whom."""
    facts = {}
    if bearing is not None:
        diameter, length = amount(bearing.journal_diameter, "size", ".4g"), amount(bearing.length, "size", ".4g")
        facts["Bearing"] = f"{bearing.name}, {len(bearing.pads)} pads, Ø {diameter} × {length}"
    facts |= set_points([p.point.key for p in points])
    amplitude = max((p.amplitude for p in points if np.isfinite(p.amplitude)), default=0.0)
    if amplitude:
        facts["Excitation"] += f", vibration up to {amount(amplitude, 'length', '.2g')} (0-peak)"
    if isinstance(campaign, TableSource):
        return facts | {"Source": campaign.description}
    counts = Counter(KINDS_IN_WORDS.get(run.kind, run.kind) for run in campaign.runs)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    measured = ", ".join(filter(None, (campaign.date, campaign.by))) or "when and by whom is not stated"
    return facts | {"Runs": f"{len(campaign.runs)} ({kinds})", "Measured": measured}


def set_points(keys: Sequence[tuple[float, float, float, float, str]]) -> dict[str, str]:
    """Loads, speeds and excitation of operating points, whose keys are given."""
    if not keys:
        return {}
    loads, directions, speeds, excitations, senses = zip(*keys)
    shaft = ", ".join(spinning(*turning) for turning in sorted(set(zip(speeds, senses))))
    at = ", ".join(f"{angle:g}°" for angle in sorted(set(directions)))
    load = _span({value / size("load") for value in loads}, symbol("load"))
    return {"Static load": f"{load} at {at}", "Shaft": shaft, "Excitation": _span(set(excitations), "Hz")}


def _span(values: set[float], unit: str) -> str:
    """The only value, or from which to which in how many steps."""
    low, high = min(values), max(values)
    return f"{low:.4g} {unit}" if len(values) == 1 else f"{low:.4g} to {high:.4g} {unit} ({len(values)} values)"


def values_table(points: Sequence[PointResult]) -> Table | None:
    """K and C of the point in the middle, with intervals."""
    solved = [p for p in points if np.isfinite(p.stiffness.h).all()]
    if not solved:
        return None
    p = solved[len(solved) // 2]
    cells, point = p.stiffness.cells(), p.point
    rows = list(zip(ENTRIES, cells[:4], cells[4:], strict=True))
    columns = ["", f"K, {STIFFNESS.display_unit}", f"C, {DAMPING.display_unit}"]
    shaft = spinning(point.shaft_speed_hz, point.rotation)
    return Table(f"Measured at {p.place}, shaft at {shaft}; 95 % intervals", columns, rows)


def interval_cells(frame: pd.DataFrame, column: str, scale: float) -> list[str]:
    """Values of a column with half their intervals."""
    ends = frame[[column, f"{column}_lo", f"{column}_hi"]].itertuples(index=False, name=None)
    return [with_interval(value, low, high, scale) for value, low, high in ends]


def coefficient_cells(frame: pd.DataFrame, kinds: Sequence[Coefficient], side: str = "") -> dict[str, list[str]]:
    """K, C or both of a table on disk with half their intervals, by headings; `side` is what their names end in."""
    cells = {}
    for kind in kinds:
        for entry in ENTRIES:
            heading = f"{kind.symbol}{entry}, {kind.display_unit}"
            cells[heading] = interval_cells(frame, kind.column(entry) + side, kind.display_scale)
    return cells


def flags_line(flags: Iterable[Iterable[Condition]], points: int) -> str:
    """The flags of a result with how often each is there, gravest first; "" where it has no points."""
    counts = Counter(itertools.chain(*flags))
    gravest_first = sorted(counts, key=lambda flag: SEVERITIES.index(flag.severity))
    texts = {flag: f"{flag} ({counts[flag]})" if counts[flag] > 1 else flag for flag in gravest_first}
    serious = untrusted(gravest_first)
    number = counted(sum(counts[flag] for flag in serious), "flag")
    against = ", ".join(map(texts.pop, serious))
    others = ", ".join(texts.values())
    if serious:
        return f"{number} against trust: {against}{others and '; others: '}{others}."
    none = f"No flags on {counted(points, 'point')}." if points else ""
    return f"Flags, none of which forbids trust: {others}." if others else none


def set_up_section(comparison: Comparison) -> Section:
    """Sensors with their calibration, bearing and oil, and what was run."""
    campaign = comparison.campaign
    tables = _bearing_tables(comparison.bearing)
    if isinstance(campaign, TableSource):
        return Section("Set-up", tables=tables)
    rows = []
    for channel in campaign.channels.values():
        unit, scale, _ = channel_unit(channel.quantity)
        if not unit:
            continue
        axis = "" if channel.axis is None else f"{math.degrees(channel.axis):g}°"
        place = axis if channel.pad is None else f"pad #{channel.pad}"
        calibration = f"{channel.slope / scale:.5g} {unit} per {channel.unit or 'unit'}"
        uncertainty = "not stated" if channel.uncertainty is None else f"{100 * channel.uncertainty:.2g} %"
        rows.append([channel.name, channel.quantity, place, calibration, uncertainty])
    columns = ["channel", "quantity", "direction or pad", "calibration", "uncertainty (1 standard deviation)"]
    return Section("Set-up", tables=[Table("Sensors", columns, rows), *tables, _run_matrix(campaign.runs)])


def _by_pad(values: Iterable[str]) -> str:
    """What all pads have, or what each has, pad #1 first."""
    listed = list(values)
    return listed[0] if len(set(listed)) == 1 else "; ".join(listed)


def _bearing_tables(bearing: Any) -> list[Table]:
    """Geometry of the bearing, its pivots and its oil; none without one."""
    if bearing is None:
        return []
    environment = plain_templates()
    environment.filters |= {
        "amount": amount,
        "by_pad": _by_pad,
        "celsius": degrees,
        "degree": lambda angle, form: format(math.degrees(angle), form),
        "figures": format,
    }
    lines = environment.get_template("bearing.txt").render(bearing=bearing).splitlines()
    return [Table("Bearing and oil", ["", "as stated"], [line.split(": ", 1) for line in lines])]


def _run_matrix(runs: Sequence[Run]) -> Table:
    """Operating points with their number of runs."""
    counts: Counter[tuple[str, ...]] = Counter()
    for run in runs:
        p, rate = run.point, "–"
        load = f"{p.static_load / size('load'):.6g}" if p.static_load else "–"
        direction = "several" if run.kind in ("locus", "dry_pivot") else f"{p.static_load_direction_deg:g}"
        shaft = f"{p.shaft_speed_hz:g} ({60 * p.shaft_speed_hz:.6g})"
        excitation = f"{p.excitation_hz:g}" if p.excitation else "–"
        with suppress(RigDataError):  # a record that cannot be read: `check` tells
            rate = f"{run.sample_rate:g}"
        counts[KINDS_IN_WORDS.get(run.kind, run.kind), load, direction, shaft, excitation, rate] += 1
    columns = ["kind", f"load, {symbol('load')}", "load direction, °", "shaft speed, Hz (rpm)", "excitation, Hz"]
    return Table("Runs", [*columns, "rate, Hz", "runs"], [[*key, str(n)] for key, n in counts.items()])


def evidence_section(campaign: Campaign, result: Identification) -> Section:
    """Orbit, spectra, coherence of one run in the middle of the campaign; h over frequency; coherence of all points."""
    panels = _run_panels(campaign, result) if result.points else []
    series = longest_series(result.to_frame(), "frequency") if result.points else None
    if series is not None:
        title = f"Dynamic stiffness h over frequency, {constant_along(series, 'frequency')}"
        panels.append(Panel("h-over-frequency", title, frf, result))
    for number, band in enumerate(result.bands, start=1):
        key = band.key()
        title = (f"Dynamic stiffness h over the band, {amount(key['static_load_N'], 'load')}, "
                 f"shaft at {spinning(key['shaft_speed_Hz'], key['rotation'])}, {key['excitation']}")  # fmt: skip
        panels.append(Panel(f"h-over-band-{number}", title, frf, band))
    if result.points:
        panels.append(Panel("coherence-points", "Force that the displacements do not explain", coherence, result))
    return Section("Raw evidence of one run", panels=panels)


def _run_panels(campaign: Campaign, result: Identification) -> list[Panel]:
    """Of the first run of the middle point that is whole."""
    point = result.points[len(result.points) // 2]
    for run in map(campaign.run, point.runs):
        try:
            label = f"run {run.id}, {point.place}"
            return [
                Panel("orbit", f"Orbit of the shaft in the housing, {label}; thick: its part at the excitation",
                      orbit(run)),
                Panel("coherence-spectrum", f"Multiple coherence of force and displacement, {label}",
                      coherence_spectrum(run)),
                Panel("spectra", f"Amplitudes of displacement and force, {label}", spectra(run)),
            ]  # fmt: skip
        except (RigDataError, ValueError):  # a damaged or short run: the next one shows the same
            continue
    return []


def budget_table(result: Identification) -> Table:
    """What the 95 % intervals of all coefficients are made of, source by source, as in ``budget.csv``."""
    sources = {}
    for p in result.points:
        sources.update(p.budget)
    rows = []
    for place, p in zip(point_labels(points_table(result.points)), result.points, strict=True):
        deviations = {name: np.sqrt(np.maximum(np.diag(part), 0.0)) for name, part in p.budget.items()}
        for i, (value, half) in enumerate(zip(p.stiffness.cells(), p.stiffness.half_width(), strict=True)):
            kind, factor = (STIFFNESS, 1.0) if i < 4 else (DAMPING, p.stiffness.omega)
            scale = kind.display_scale * factor
            digits = 2 - math.floor(math.log10(half / scale)) if 0.0 < half < math.inf else 3
            parts = [fixed(deviations[n][i] / scale, digits) if n in deviations else "–" for n in sources]
            name = f"{kind.symbol}{ENTRIES[i % 4]}, {kind.display_unit}"
            rows.append([place, name, value, *parts])
    caption = "Uncertainty budget: value ± half of its 95 % interval, then the standard uncertainty by source"
    return Table(caption, ["point", "", "value", *sources], rows)


def coefficient_sections(table: pd.DataFrame) -> list[Section]:
    """Draw every series of at least two points."""
    sections = []
    for over in ("load", "frequency"):
        series = longest_series(table, over)
        if series is None:
            continue
        for names, kind in ((DIRECT, "Stiffness and damping"), (CROSS, "Cross-coupled stiffness and damping")):
            panels = []
            for name in names:
                title = f"{name} ({KINDS[name[0]].quantity}) over {over}, at {constant_along(series, over)}"
                panels.append(Panel(f"{name}-over-{over}", title, coefficient, table, name, over))
            sections.append(Section(f"{kind} over {over}", panels=panels))
    return sections


def pivot_panels(curves: Sequence[PivotCurve], formula: Formula | None) -> list[Panel]:
    """Draw the tangent stiffness of every pad, its load steps, and how they were projected."""
    across = "Load and displacement vectors, and what of them lies on each pad's direction"
    return [
        Panel("pivot-stiffness", "Pivot tangent stiffness over load, 95 % bands", pivot_stiffness, curves, formula),
        Panel("pivot-steps", "Load steps and fitted laws, pivot and housing together", load_deflection, curves),
        Panel("pivot-projection", across, pad_projection, curves),
    ]


def position_panels(
    polygon: ClearancePolygon | None,
    drawn: tuple[FloatArray, FloatArray],
    measured: Locus | None,
    predicted: Mapping[str, FloatArray],
    sweeps: Sequence[ClearancePolygon] = (),
) -> list[Panel]:
    """Draw polygon and locus in one square panel.

    `drawn` is the drawing's (n_pads,) pad angles [rad] and clearances [m]; positions are (n, 2) [m].
    """
    if polygon is None and measured is None:
        return []
    polygons = {} if polygon is None else {"measured": polygon} | {f"run {p.run}": p for p in sweeps}
    figure = functools.partial(clearance_and_locus, polygons, measured, predicted, drawing=drawn)
    return [Panel("locus-and-clearance", "Shaft centre locus inside the clearance polygon", figure)]


#: A picture of more channels could not be read.
_MOST = 24
_ROW, _WIDTH = 1.35, 4.6
_POINTS = 4000


@plot
def quick_look(series: Sequence[Series], spectra: Mapping[str, Spectrum]) -> Figure:
    """Draw one row per channel: left over time (minima and maxima where samples are many), right its spectrum."""
    series = series[:_MOST]
    figure, grid = new_pictures(len(series), 2, width=_WIDTH, height=_ROW)
    for (over_time, spectrum), channel in zip(grid, series, strict=True):
        label(over_time, "time, s", printable(", ".join(filter(None, (channel.name, channel.unit)))))
        label(spectrum, "frequency, Hz", "")
        time = np.arange(len(channel), dtype=float) if channel.time is None else channel.time
        over_time.plot(*thinned(time, channel.values, _POINTS), color=INK, linewidth=0.6)
        frequency, amplitude = spectra[channel.name]
        spectrum.plot(frequency[4:], np.maximum(amplitude[4:], 1e-300), color=BLUE, linewidth=0.7)
        spectrum.set_yscale("log")
        over_time.locator_params(axis="y", nbins=3)
        spectrum.yaxis.set_major_locator(LogLocator(numticks=4))
        spectrum.minorticks_off()
        over_time.margins(x=0.0)
        spectrum.margins(x=0.0)
    return figure
