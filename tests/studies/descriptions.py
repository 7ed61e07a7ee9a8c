"""Sensor descriptions that are off by ten to a thousand: does `check` say so, does `identify` trust the numbers?

    python -m tests.studies.descriptions [--write]

The demo campaign's dynamic runs at two loads, alone and with its dry, locus and clearance runs; one entry of the
manifest is scaled at a time, the bearing's drawing is at hand, as it is on the command line. "silent" is a coefficient
that is off by more than a twentieth at a point without a flag.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py

from model.bearing_file import parse_bearing
from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.studies.results import report, study_parser, table
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.compare.static_tests import bearing_problems
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings

DEMO = Path(__file__).resolve().parents[2] / "rigdata" / "samples" / "demo.h5"
SENSORS = {
    "both probes": ("X1A", "X1B"),
    "one probe": ("X1A",),
    "both cells": ("L1H", "L1V"),
    "one cell": ("L1H",),
    "both accelerometers": ("A1H", "A1V"),
    "one accelerometer": ("A1H",),
    "thermometers": ("T1", "T2", "T3", "T4", "T5"),
    "speed": ("K1",),
}
FACTORS = (1000.0, 100.0, 10.0, 0.1, 0.01, 0.001)
#: Of the housing's mass.
MASSES = (1000.0, 100.0, 10.0, 3.0, 0.1, 0.01)
#: Of the sample rate that the file states.
RATES = (2.0, 0.5, 1000.0, 0.001)
OFF = 0.05


def scaled_sensors(text: str, names: tuple[str, ...], factor: float) -> str:
    """The manifest with the sensitivities of some channels times a factor."""
    for name in names:
        head, _, tail = text.partition(f"[channels.{name}]")
        number = re.search(r'sensitivity = "([0-9.]+) ', tail)
        assert number is not None
        tail = tail[: number.start(1)] + f"{float(number[1]) * factor:.10g}" + tail[number.end(1) :]
        text = f"{head}[channels.{name}]{tail}"
    return text


def variants(text: str) -> Iterator[tuple[str, float, str, float]]:
    """Name, factor, manifest, factor of the stored rate."""
    yield "nothing", 1.0, text, 1.0
    for sensor, names in SENSORS.items():
        for factor in FACTORS:
            yield sensor, factor, scaled_sensors(text, names, factor), 1.0
    for factor in MASSES:
        yield "housing mass", factor, text.replace('"30 kg"', f'"{30 * factor:g} kg"'), 1.0
    for factor in RATES:
        yield "rate in the file", factor, text, factor


def shortened(text: str, all_kinds: bool) -> str:
    """The demo's manifest with dynamic runs of two loads, and the others where they are wanted."""
    head, *runs = text.split("[[runs]]\n")
    chosen = []
    for run in runs:
        is_dynamic = 'kind = "dynamic"' in run
        if ('id = "d-02500-25' in run or 'id = "d-05000-25' in run) if is_dynamic else all_kinds:
            chosen.append(run)
    return "[[runs]]\n".join([head, *chosen])


def written(folder: Path, text: str, rate: float) -> Path:
    """A copy of the demo with another manifest and another stored rate."""
    path = folder / "c.h5"
    shutil.copy(DEMO, path)
    with h5py.File(path, "r+") as file:
        file.attrs["manifest"] = text
        for group in file["runs"].values():
            group.attrs["sample_rate_hz"] = rate * float(group.attrs["sample_rate_hz"])
    return path


def answers(path: Path, truth: dict[object, list[float]]) -> tuple[str, str, str]:
    """Worst finding of `check`, its words, and whether `identify` trusts what is wrong."""
    found = check_campaign(path)
    campaign = load_campaign(path)
    drawing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
    if campaign.of_kind("clearance"):
        found += bearing_problems(campaign, drawing, found)
    problems = [p for p in sorted(found, key=lambda p: p.severity) if p.severity != "note"]
    worst = problems[0].severity if problems else "-"
    words = f"{problems[0].place}: {problems[0].what}"[:110] if problems else ""
    try:
        clearance = min(pad.assembled_clearance for pad in drawing.pads)
        points = identify(campaign, IdentifySettings(methods=(), method="ols", clearance=clearance)).points
    except (RigDataError, ValueError) as error:
        return worst, words, f"refused ({str(error).splitlines()[0][:60]})"
    wrong = flagged = 0
    for point in points:
        values = point.stiffness.vector.tolist()
        right = truth.setdefault(point.point, values)
        off = [abs(v - r) > OFF * abs(right[i // 4 * 4]) for i, (v, r) in enumerate(zip(values, right, strict=True))]
        wrong += any(off)
        flagged += any(off) and bool(point.quality)
    return worst, words, "right" if not wrong else "flagged" if flagged == wrong else f"{wrong - flagged} SILENT"


def main() -> None:
    asked = study_parser(__doc__).parse_args()
    with h5py.File(DEMO) as file:
        whole = str(file.attrs["manifest"])
    cells: dict[tuple[str, str], list[str]] = {}
    silent = count = 0
    with tempfile.TemporaryDirectory() as folder:
        for all_kinds in (False, True):
            truth: dict[object, list[float]] = {}
            for sensor, factor, text, rate in variants(shortened(whole, all_kinds)):
                path = written(Path(folder), text, rate)
                worst, words, identified = answers(path, truth)
                runs = "all kinds" if all_kinds else "dynamic"
                print(runs, sensor, f"{factor:g}", worst, identified, words, sep="\t", flush=True)
                cells.setdefault((sensor, runs), []).append(f"{factor:g}: {worst}, {identified.partition(' (')[0]}")
                silent += "SILENT" in identified
                count += 1
    text = f"{count} cases, {silent} with a wrong number that nothing flags. Factor: `check`, `identify`.\n\n"
    rows = [(sensor, runs, "; ".join(outcomes)) for (sensor, runs), outcomes in cells.items()]
    text += table(("description", "runs", "factor: check, identify"), rows)
    report(asked, "descriptions", text)


if __name__ == "__main__":
    main()
