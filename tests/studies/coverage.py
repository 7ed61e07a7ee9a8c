"""Whether the 95 % intervals of a campaign of sines hold, by directions, repeats, seconds and loads.

    python -P -m tests.studies.coverage [--seeds N] [--only WORDS] [--write]

Two counts a plan: with gains drawn from the stated uncertainty, entries of a campaign moving together; and without any
error of the sensors or statement of it, where records, loads and runs alone speak.
"""

import tempfile
from pathlib import Path

import numpy as np

from rigdata.campaign import load_campaign
from tests.rigs import closed_form as cf
from tests.rigs.acquisition import UNCERTAINTY, Acquisition, write_campaign
from tests.studies.results import report, study_parser, table
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings

THREE, FOUR = (0.0, 60.0, 120.0), (0.0, 45.0, 90.0, 135.0)
LOADS = (2500.0, 5000.0, 8750.0)
PLANS = {
    "two directions": {"directions": (0.0, 90.0), "loads": LOADS},
    "three directions": {"directions": THREE, "loads": LOADS},
    "four directions": {"directions": FOUR, "loads": LOADS},
    "eight directions, one load": {"directions": tuple(22.5 * np.arange(8))},
    "three directions, one load, one frequency": {"directions": THREE, "frequencies": (25.0,)},
    "four directions, 1.5 s": {"directions": FOUR, "seconds": 1.5},
    "three directions, three repeats": {"directions": THREE, "repeats": 3},
    "runs differ by 0.5 %": {"directions": FOUR, "loads": LOADS, "stiffness_scatter": 0.005},
}
HEAD = ("plan", "entries", "inside %, gains drawn", "inside %, no gains", "half-width %, no gains", "flags")


def counted(plan: dict[str, object], seed: int, gains: bool) -> tuple[list[bool], list[float], list[str]]:
    """Which entries of a campaign lie in their intervals, half widths of the direct ones in %, flags."""
    rig = cf.Rig(**plan)  # type: ignore[arg-type]
    campaign = cf.campaign(rig, cf.channels_of(rig), [seed, 7])
    inside, half, flags = [], [], []
    setup = Acquisition(noise=cf.noise_of(rig), uncertainty=UNCERTAINTY if gains else {})
    with tempfile.TemporaryDirectory() as folder:
        path = write_campaign(Path(folder), campaign, setup, [seed, 11])
        result = identify(load_campaign(path), IdentifySettings(methods=()))
    for p in result.points:
        truth = cf.vector(campaign.truth(p.point.static_load, p.point.excitation_hz))
        width = p.stiffness.half_width()
        inside += list(np.abs(p.stiffness.vector - truth) <= width)
        half += list(100 * width[[0, 3, 4, 7]] / np.abs(truth)[[0, 3, 4, 7]])
        flags += [str(c) for c in p.quality]
    return inside, half, flags


def row(name: str, seeds: int) -> tuple[object, ...]:
    """One plan over its seeds."""
    shares, half, flags = [], [], set()
    for gains in (True, False):
        counts = [counted(PLANS[name], seed, gains) for seed in range(seeds)]
        inside = [entry for c in counts for entry in c[0]]
        shares.append(f"{100 * np.mean(inside):.1f}")
        half = [width for c in counts for width in c[1]]
        flags |= {flag for c in counts for flag in c[2]}
    return name, len(inside), *shares, f"{np.median(half):.2f}", ", ".join(sorted(flags))


def main() -> None:
    """Print the table, or write it."""
    given = study_parser(__doc__, seeds=60, only="").parse_args()
    rows = []
    for name in PLANS:
        if given.only in name:
            rows.append(row(name, given.seeds))
            print(*rows[-1], sep=" | ", flush=True)
    report(given, "coverage", table(HEAD, rows))


if __name__ == "__main__":
    main()
