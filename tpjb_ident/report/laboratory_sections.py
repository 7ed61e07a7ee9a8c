"""What a test laboratory's report holds beside results: set-up, sensors, bearing and oil, run matrix, raw evidence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.problem import RigDataError
from tpjb_ident.columns import amount, channel_unit, degrees, per, size, spinning, symbol
from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.conditions import SEVERITIES
from tpjb_ident.report.drawing.series import constant_along, longest_series, point_label, point_labels, points_table
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.page import Section, Table, plain_templates
from tpjb_ident.report.plots.coefficients import frf
from tpjb_ident.report.plots.records import coherence, coherence_spectrum, orbit, spectra
from tpjb_ident.rounding import counted, fixed, with_interval
from tpjb_ident.schema import DAMPING, ENTRIES, STIFFNESS, Coefficient

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.calibration import Channel
    from rigdata.campaign import Campaign
    from rigdata.run import Run
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.conditions import Condition
    from tpjb_ident.pivot import PivotCurve
    from tpjb_ident.results.identification import Identification
    from tpjb_ident.results.point_result import PointResult

_KINDS_IN_WORDS = {"dynamic": "dynamic", "locus": "shaft locus", "clearance": "clearance sweep",
                  "dry_pivot": "dry pivot test"}  # fmt: skip
_EVIDENCE = "Raw evidence of one run"


def tested_facts(campaign: Campaign | TableSource, bearing: Any, points: Sequence[PointResult]) -> dict[str, str]:
    """What was tested, for the head of a page: bearing, loads, speeds, excitation, runs, when and by whom."""
    facts = {}
    if bearing is not None:
        diameter, length = (amount(v, "size", ".4g") for v in (bearing.journal_diameter, bearing.length))
        facts["Bearing"] = f"{bearing.name}, {len(bearing.pads)} pads, Ø {diameter} × {length}"
    facts |= set_points([p.point.key for p in points])
    amplitude = max((p.amplitude for p in points if np.isfinite(p.amplitude)), default=0.0)
    if amplitude:
        facts["Excitation"] += f", vibration up to {amount(amplitude, 'length', '.2g')} (0-peak)"
    if isinstance(campaign, TableSource):
        return facts | {"Source": campaign.description}
    counts = Counter(_KINDS_IN_WORDS.get(run.kind, run.kind) for run in campaign.runs)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    measured = ", ".join(text for text in (campaign.date, campaign.by) if text)
    return facts | {
        "Runs": f"{len(campaign.runs)} ({kinds})",
        "Measured": measured or "date and by are not in campaign.toml",
    }


def set_points(keys: Sequence[tuple[float, float, float, float, str]]) -> dict[str, str]:
    """Loads, speeds and excitation of operating points, whose keys are given."""
    if not keys:
        return {}
    loads, directions, speeds, excitations, senses = zip(*keys, strict=True)
    shaft = ", ".join(spinning(*turning) for turning in sorted(set(zip(speeds, senses, strict=True))))
    at = ", ".join(f"{angle:g}°" for angle in sorted(set(directions)))
    load = _span({value * per("load") for value in loads}, symbol("load"))
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
    cells = p.stiffness.cells()
    rows = [[entry, cells[i], cells[4 + i]] for i, entry in enumerate(ENTRIES)]
    columns = ["", *(f"{kind.symbol.upper()}, {kind.display_unit}" for kind in (STIFFNESS, DAMPING))]
    caption = (
        f"Measured at {point_label(p)}, shaft at {spinning(p.point.shaft_speed_hz, p.point.rotation)}; 95 % intervals"
    )
    return Table(caption, columns, rows)


def interval_cells(frame: pd.DataFrame, column: str, scale: float) -> list[str]:
    """Values of a column with half their intervals."""
    ends = (frame[column + end] for end in ("", "_lo", "_hi"))
    return [with_interval(value, low, high, scale) for value, low, high in zip(*ends, strict=True)]


def coefficient_cells(frame: pd.DataFrame, kinds: Sequence[Coefficient], side: str = "") -> dict[str, list[str]]:
    """K, C or both of a table on disk with half their intervals, by headings; `side` is what their names end in."""
    cells = {}
    for kind in kinds:
        for entry in ENTRIES:
            heading = f"{kind.symbol}{entry}, {kind.display_unit}"
            cells[heading] = interval_cells(frame, kind.column(entry) + side, kind.display_scale)
    return cells


def flags_line(flags: Iterable[Iterable[Condition]], points: int) -> str:
    """The flags of a result with how often each is there, gravest first."""
    counts = Counter((str(c), c.severity) for conditions in flags for c in conditions)
    texts = []
    for grave in SEVERITIES:
        texts += [f"{name} ({n})" if n > 1 else name for (name, severity), n in counts.items() if severity == grave]
    bad = sum(n for (_, severity), n in counts.items() if severity == "error")
    head = f"{counted(bad, 'flag')} against trust" if bad else f"Flags on {points} points, none forbids trust"
    return f"{head}: {', '.join(texts)}." if texts else f"No flags on {counted(points, 'point')}."


def set_up_section(comparison: Comparison) -> Section:
    """Sensors with their calibration, bearing and oil, and what was run."""
    campaign = comparison.campaign
    tables = _bearing_tables(comparison.bearing)
    if not isinstance(campaign, TableSource):
        tables = [_sensor_table(tuple(campaign.channels.values())), *tables, _run_matrix(campaign.runs)]
    return Section("Set-up", tables=tables)


def _sensor_table(channels: Sequence[Channel]) -> Table:
    """Channels with their calibration."""
    rows = []
    for channel in channels:
        unit, scale = channel_unit(channel.quantity)
        if not unit:
            continue
        axis = "" if channel.axis is None else f"{math.degrees(channel.axis):g}°"
        place = axis if channel.pad is None else f"pad #{channel.pad}"
        uncertainty = "not stated" if channel.uncertainty is None else f"{100 * channel.uncertainty:.2g} %"
        rows.append(
            [
                channel.name,
                channel.quantity,
                place,
                f"{channel.slope / scale:.5g} {unit} per {channel.unit or 'unit'}",
                uncertainty,
            ]
        )
    columns = ["channel", "quantity", "direction or pad", "calibration", "uncertainty (1 standard deviation)"]
    return Table("Sensors", columns, rows)


def stiffness_cell(curve: PivotCurve, load: float) -> str:
    """Tangent stiffness of a pivot at a load [N], with its interval."""
    low, high = (float(v) for v in curve.stiffness_band(load))
    return with_interval(float(curve.stiffness(load)), low, high, size("stiffness"))


def clearance_cells(polygon: ClearancePolygon, calibrated: bool = False) -> list[str]:
    """Clearance of every pad at zero push load with its interval, `calibrated` with that of the probes' gains."""
    gain = polygon.relative_calibration if calibrated else 0.0
    ends = zip(polygon.clearance, 1.96 * np.hypot(polygon.clearance_se, gain * polygon.clearance), strict=True)
    return [with_interval(value, value - half, value + half, size("length")) for value, half in ends]


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
    counted: dict[tuple[str, ...], int] = {}
    for run in runs:
        p = run.point
        several = run.kind in {"locus", "dry_pivot"}
        key = (
            _KINDS_IN_WORDS.get(run.kind, run.kind), f"{p.static_load * per('load'):.6g}" if p.static_load else "–",
            "several" if several else f"{p.static_load_direction_deg:g}",
            f"{p.shaft_speed_hz:g} ({60 * p.shaft_speed_hz:.6g})",
            f"{p.excitation_hz:g}" if p.excitation else "–", f"{run.sample_rate:g}",
        )  # fmt: skip
        counted[key] = counted.get(key, 0) + 1
    columns = [
        "kind",
        f"load, {symbol('load')}",
        "load direction, °",
        "shaft speed, Hz (rpm)",
        "excitation, Hz",
        "rate, Hz",
        "runs",
    ]
    return Table("Runs", columns, [[*key, str(n)] for key, n in counted.items()])


def evidence_sections(campaign: Campaign, result: Identification) -> list[Section]:
    """Orbit, spectra, coherence of one run in the middle of the campaign; h over frequency.

    Coherence of every point.
    """
    panels = [*_run_panels(campaign, result), *_stiffness_panels(result)]
    if result.points:
        title = "Force that the displacements do not explain"
        panels.append(panel("coherence-points", title, coherence, result))
    return [Section(_EVIDENCE, panels=panels)] if panels else []


def _run_panels(campaign: Campaign, result: Identification) -> list[Panel]:
    """Of the first run of the middle point that is whole."""
    if not result.points:
        return []
    point = result.points[len(result.points) // 2]
    for run in (r for r in campaign.of_kind("dynamic") if r.id in point.runs):
        try:
            label = f"run {run.id}, {point_label(point)}"
            return [
                panel("orbit", f"Orbit of the shaft in the housing, {label}; thick: its part at the excitation",
                      orbit(run)),
                panel("coherence-spectrum", f"Multiple coherence of force and displacement, {label}",
                      coherence_spectrum(run)),
                panel("spectra", f"Amplitudes of displacement and force, {label}", spectra(run)),
            ]  # fmt: skip
        except (RigDataError, ValueError):  # a damaged or short run: the next one shows the same
            continue
    return []


def _stiffness_panels(result: Identification) -> list[Panel]:
    """The dynamic stiffness h itself, over the excitation frequencies of sines and over every band."""
    panels = []
    series = longest_series(result.to_frame(), "frequency") if result.points else None
    if series is not None:
        title = (
            f"Dynamic stiffness h over frequency, {constant_along(series, 'frequency')}; a line: the model that fits"
        )
        panels.append(panel("h-over-frequency", title, frf, result))
    for number, band in enumerate(result.bands, start=1):
        key = band.key()
        title = (f"Dynamic stiffness h over the band, {amount(key['static_load_N'], 'load')}, "
                 f"shaft at {spinning(key['shaft_speed_Hz'], key['rotation'])}, {key['excitation']}")  # fmt: skip
        panels.append(panel(f"h-over-band-{number}", title, frf, band))
    return panels


def budget_table(result: Identification) -> Table:
    """What the 95 % intervals of all coefficients are made of, source by source, as in ``budget.csv``."""
    sources = list(dict.fromkeys(name for p in result.points for name in p.budget))
    rows = []
    for place, p in zip(point_labels(points_table(result.points)), result.points, strict=True):
        deviations = {name: np.sqrt(np.maximum(np.diag(part), 0.0)) for name, part in p.budget.items()}
        for i, (value, half) in enumerate(zip(p.stiffness.cells(), p.stiffness.half_width(), strict=True)):
            kind, factor = (STIFFNESS, 1.0) if i < 4 else (DAMPING, p.stiffness.omega)
            scale = kind.display_scale * factor
            digits = 2 - math.floor(math.log10(half / scale)) if 0.0 < half < math.inf else 3
            parts = [fixed(float(deviations[n][i]) / scale, digits) if n in deviations else "–" for n in sources]
            name = f"{kind.symbol}{ENTRIES[i % 4]}, {kind.display_unit}"
            rows.append([place, name, value, *parts])
    caption = "Uncertainty budget: value ± half of its 95 % interval, then the standard uncertainty by source"
    return Table(caption, ["point", "", "value", *sources], rows)
