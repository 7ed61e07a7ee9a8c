"""Excitation over a band against the truth.

    python -m tests.studies.band_coverage [--seeds 20] [--only WORDS] [--write]

The conditions named go to the other stream.
"""

import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rigdata import load_campaign
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandPlan, BandRig, band_plans, stiffness
from tests.rigs.closed_form import vector
from tests.studies.results import report, study_parser, table
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify
from tpjb_ident.results.identification import BandResult

#: Noise of probes, cells and accelerometers, in units of `rig.NOISE`: usual, and with 5 to 20 % on the displacements.
USUAL, LOUD = (5.0, 5.0, 1.0), (15.0, 8.0, 3.0)
FOUR = (0.0, 45.0, 90.0, 135.0)
HEAD = ("excitation", "method", "lines", "h inside %", "half width %", "H1 kyy %", "kyy %", "points inside %",
        "K-C-M inside %", "kyy +- %", "refused", "reported")  # fmt: skip
#: What is a mean over the operating points, and how it is printed.
FORMS = (("inside", ".1f"), ("width", ".1f"), ("bias of H1", "+.1f"), ("bias", "+.1f"), ("points inside", ".1f"),
         ("model inside", ".1f"), ("model width", ".1f"))  # fmt: skip
MEANS = [name for name, _ in FORMS]
COLUMNS = [*MEANS, "method", "lines", "reported", "conditions", "refused"]


@dataclass(frozen=True)
class BandRow:
    """One condition of the table."""

    name: str
    rig: BandRig
    plans: Sequence[BandPlan] = field(default_factory=band_plans)


def band_rows() -> list[BandRow]:
    """Kinds of excitation, noise, directions, lengths."""
    loads = (2500.0, 5000.0, 8750.0)
    rows = []
    for noise, word in ((USUAL, ""), (LOUD, ", loud")):
        kinds = ("multisine", "periodic random", "random", "sweep", "impact")
        rows += [BandRow(kind + word, BandRig(kind=kind, noise=noise)) for kind in kinds]
    silent = replace(rows[2].rig, command=0)
    return [
        *rows,
        BandRow("random, no command", silent),
        BandRow("random, no command, loud", replace(silent, noise=LOUD)),
        BandRow("sweep, no command", replace(silent, kind="sweep")),
        BandRow("random, both actuators at once", replace(silent, command=2), band_plans(directions=(30.0,))),
        BandRow("multisine, four directions", BandRig(kind="multisine"), band_plans(directions=FOUR)),
        BandRow("random, four directions", BandRig(kind="random"), band_plans(directions=FOUR)),
        BandRow("random, runs differ by 1 %", BandRig(kind="random", run_gain=0.01), band_plans(directions=FOUR)),
        BandRow("multisine, loads missed", BandRig(kind="multisine", miss=(0.003, 0.0035)), band_plans(loads)),
        BandRow("multisine, three periods", BandRig(kind="multisine", seconds=6.1)),
        BandRow("random, 4 s", BandRig(kind="random", seconds=4.0)),
        BandRow("random, 40 s", BandRig(kind="random", seconds=40.0)),
        BandRow("random, cells' clock 30 ppm off", BandRig(kind="random", cells=30e-6)),
        BandRow("multisine, cells' clock 30 ppm off", BandRig(kind="multisine", cells=30e-6)),
        BandRow("multisine, generator 37 ppm fast", BandRig(kind="multisine", generator=37e-6)),
    ]


def true_parameters(rig: BandRig, load: float) -> np.ndarray:
    """K, C, M of the rig's bearing at a load, in the order of `FrequencyModel.parameters`."""
    film = rig.bearing
    still, slow = film.h(0.0, load), film.h(1.0, load)  # at 1 Hz
    return np.concatenate([still.real.ravel(), slow.imag.ravel() / (2 * np.pi), np.ravel(film.m)])


def judged(result: BandResult, rig: BandRig) -> dict[str, object]:
    """One operating point against the truth, shares as numbers from 0 to 1."""
    row: dict[str, object] = {"reported": bool(untrusted(result.quality)), "conditions": list(map(str, result.quality))}
    if not result.lines:
        return row
    load = result.point.static_load
    h = stiffness(rig.bearing, 2 * np.pi * result.frequencies, load)
    truth = np.concatenate([h.real.reshape(-1, 4), h.imag.reshape(-1, 4)], axis=1)
    found = np.array([line.stiffness.vector for line in result.lines])
    half = result.half_width()
    row |= {"method": result.method, "lines": len(result.lines)}
    row["inside"] = np.mean(np.abs(found - truth) <= half)
    row["width"] = np.median(half[:, [0, 3]]) / np.abs(h[:, [0, 1], [0, 1]]).mean()
    h1 = np.array([line.by_method["h1"].h[1, 1] for line in result.lines if "h1" in line.by_method])
    if len(h1):
        row["bias of H1"] = np.mean((h1 / h[: len(h1), 1, 1]).real) - 1
    row["bias"] = np.mean((result.h[:, 1, 1] / h[:, 1, 1]).real) - 1
    points = []
    for point in result.points:
        est = point.stiffness
        truth = vector(stiffness(rig.bearing, np.array([est.omega]), load)[0])
        points.append(np.mean(np.abs(est.vector - truth) <= est.half_width()))
    row["points inside"] = np.mean(points) if points else np.nan
    model = result.models.get("K-C-M")
    if model is not None:
        known = true_parameters(rig, load)
        row["model inside"] = np.mean(np.abs(model.parameters - known) <= model.half_width())
        row["model width"] = model.half_width()[3] / known[3]
        row["refused"] = model.refused
    return row


def run_row(row: BandRow, seeds: range) -> pd.DataFrame:
    """Operating points of fresh campaigns of one row."""
    rows = []
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in seeds:
            path = Path(folder) / "band.h5"
            write_band_campaign(path, row.rig, row.plans, seed)
            rows += [judged(result, row.rig) for result in identify(load_campaign(path)).bands]
            path.unlink()
    return pd.DataFrame(rows, columns=COLUMNS)


def cells(name: str, points: pd.DataFrame) -> list[str]:
    """Row of the table."""
    mean = 100 * points[MEANS].astype(float).mean()
    text = {column: "-" if np.isnan(value) else f"{value:{form}}" for (column, form), value in zip(FORMS, mean)}
    _, last = [*points.dropna(subset="method").iterrows()][-1]
    told = f"{points['reported'].sum()} of {len(points)}"
    return [name, f"`{last['method']}`", f"{last['lines']:.0f}", *text.values(), f"{points['refused'].sum():.0f}", told]


def main() -> None:
    """Command line."""
    given = study_parser(__doc__, seeds=20, first_seed=7000, only="").parse_args()
    rows = []
    for row in band_rows():
        if given.only in row.name:
            points = run_row(row, range(given.first_seed, given.first_seed + given.seeds))
            rows.append(cells(row.name, points))
            print(rows[-1], flush=True)
            print(f"{row.name}: {dict(Counter(points['conditions'].explode()))}", file=sys.stderr, flush=True)
    report(given, "band", table(HEAD, rows))


if __name__ == "__main__":
    main()
