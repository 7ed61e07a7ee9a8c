"""Count the files and the types that five walks through the house pass.

    python tests/studies/walks.py [--campaign rigdata/samples/demo.h5]

A file counts where one of its functions runs, a type where one of its objects is made.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("rigdata", "model", "tpjb_ident")


def passed(walk: Callable[[], object]) -> tuple[set[str], set[str]]:
    """Files whose functions run during a walk, and types that are made."""
    codes, types = set(), set()

    def note(frame: object, event: str, _: object) -> None:
        if event == "call":
            code = frame.f_code
            codes.add(code.co_filename)
            if code.co_name in ("__init__", "__post_init__") and "self" in frame.f_locals:
                kind = type(frame.f_locals["self"])
                if kind.__module__.split(".")[0] in PACKAGES:
                    types.add(f"{kind.__module__}.{kind.__qualname__}")

    sys.setprofile(note)
    try:
        walk()
    finally:
        sys.setprofile(None)
    ours = {str(Path(c).relative_to(ROOT)) for c in codes if any(c.startswith(f"{ROOT}/{p}/") for p in PACKAGES)}
    return ours, types


def walks(campaign_path: str, out: Path) -> dict[str, Callable[[], object]]:
    """Walks by name; what each one needs beforehand is made here."""
    import numpy as np

    import tpjb_ident as ti

    campaign = ti.load_campaign(campaign_path)
    bearing = ti.load_bearing(ROOT / "model" / "bearings" / "rocker.toml")
    angles = [pad.pivot_angle for pad in bearing.pads]
    point = {"load": 5000.0, "speed": 2 * np.pi * 22, "excitation": 2 * np.pi * 25}
    ti.predict(bearing, **point)
    result = ti.identify(campaign)
    curves = ti.fit_pivots(campaign, angles)
    return {
        "probe sample -> K, C": lambda: ti.identify(ti.load_campaign(campaign_path)).to_frame(),
        "dry step -> pivots.toml": lambda: ti.write_pivots(
            out / "pivots.toml", ti.fit_pivots(ti.load_campaign(campaign_path), angles), "x"
        ),
        "bearing.toml -> kyy": lambda: (
            ti.predict(ti.load_bearing(ROOT / "model" / "bearings" / "rocker.toml"), **point).kyy
        ),
        "result -> plot": lambda: (ti.plots.direct_coefficients({"a": result}), ti.plots.pivot_stiffness(curves)),
    }


def main() -> None:
    """Print one line per walk."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaign", default=str(ROOT / "rigdata" / "samples" / "demo.h5"))
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    with tempfile.TemporaryDirectory() as folder:
        for name, walk in walks(options.campaign, Path(folder)).items():
            files, types = passed(walk)
            print(f"{name}: {len(files)} files, {len(types)} types")
            if options.list:
                print(*sorted(files), *sorted(types), sep="\n  ")


if __name__ == "__main__":
    main()
