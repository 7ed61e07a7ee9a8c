"""Draw the pictures of docs/plots.md, one per function: ``python -m docs.make_gallery``, from the checkout.

The results behind them are those of the tests of the plots (`tests/report/plot_cases.py`): made by hand, so that every
feature of a picture shows.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

from tests.report.plot_cases import CASES, default_style

FOLDER = Path(__file__).resolve().parent / "gallery"
DPI = 90


def main() -> None:
    """Write ``gallery/NAME.png`` for every plot."""
    matplotlib.use("agg")
    FOLDER.mkdir(exist_ok=True)
    for name, draw in CASES.items():
        with default_style():
            draw().savefig(FOLDER / f"{name}.png", dpi=DPI, facecolor="white", pil_kwargs={"compress_level": 9})


if __name__ == "__main__":
    main()
