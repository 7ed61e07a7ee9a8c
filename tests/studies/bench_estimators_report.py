"""The estimator study on paper: its figures as JSON, its table as Markdown, accuracy and coverage as plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tests.studies.bench_estimators import Row

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- study: begin -->", "<!-- study: end -->"
COLOURS = {"ols": "0.6", "rlm:huber": "#d55e00", "rlm:tukey": "#e69f00", "mm": "#56b4e9", "iv": "#009e73",
           "mm-eiv": "#0072b2"}  # fmt: skip


def write_report(
    rows: Sequence[Row], methods: Sequence[str], run: tuple[int, int], out: Path | None, docs: bool
) -> None:
    """Write study.json and the plots into `out`; table and plots into docs/ if asked for.

    Parameters
    ----------
    rows : sequence of Row
    methods : sequence of str
    run : tuple of int
        Replicates and seed.
    out : Path or None
    docs : bool
    """
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        data = {"replicates": run[0], "seed": run[1], "rows": [asdict(row) for row in rows]}
        (out / "study.json").write_text(json.dumps(data, indent=1, default=_plain), encoding="utf-8")
        plot_study(rows, methods, [out / "estimators.svg", out / "estimators.png"])
    if docs:
        page = DOCS / "estimators.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        page.write_text(f"{before}{BEGIN}\n{table(rows, methods, run)}\n{END}{after}", encoding="utf-8")
        plot_study(rows, methods, [DOCS / "estimators.svg"])


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else float(value)


def table(rows: Sequence[Row], methods: Sequence[str], run: tuple[int, int]) -> str:
    """The study as a Markdown table."""
    lines = [
        f"{run[0]} replicates (a quarter of them for all but `{methods[-1]}`), seed {run[1]}. Entries: RMSE of H "
        "in % of its norm (bias of kxx, of kyy in %; coverage of the 95 % intervals in %).",
        "",
        "| case | " + " | ".join(f"`{m}`" for m in methods) + " |",
        "|---|" + "---|" * len(methods),
    ]
    lines += [f"| {row.case} | " + " | ".join(str(row.scores[m]).strip() for m in methods) + " |" for row in rows]
    full = [row for row in rows if row.windows == 20]
    reference = np.median([row.scores["rlm:huber"].milliseconds for row in full])
    ratios = [np.median([row.scores[m].milliseconds for row in full]) / reference for m in methods]
    lines.append("| time per H, `rlm:huber` = 1 | " + " | ".join(f"{r:.2f}" for r in ratios) + " |")
    return "\n".join(lines)


def plot_study(rows: Sequence[Row], methods: Sequence[str], paths: Sequence[Path]) -> None:
    """Coverage and RMSE of every method over the cases."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"svg.hashsalt": "tpjb-ident", "font.size": 8}):
        figure = Figure(figsize=(9, 6.5), layout="constrained")
        cover, accuracy = figure.subplots(2, 1, sharex=True)
        place = np.arange(len(rows))
        cover.axhspan(93, 98, color="0.92", label="target 93-98 %")
        accuracy.axhline(1.0, color="0.8", label="target 1 %")
        for method in methods:
            style = {"color": COLOURS[method], "marker": "o" if method == methods[-1] else ".", "lw": 0.8, "ms": 4}
            cover.plot(place, [row.scores[method].coverage for row in rows], label=method, **style)
            accuracy.plot(place, [row.scores[method].rmse for row in rows], label=method, **style)
        cover.set(ylabel="coverage of 95 % intervals [%]", ylim=(0, 102), title="Estimators: coverage and accuracy")
        accuracy.set(ylabel="RMSE of H [% of its norm]", yscale="log")
        accuracy.set_xticks(place, [row.case for row in rows], rotation=60, ha="right")
        cover.legend(ncols=4, loc="lower left")
        accuracy.legend(ncols=4, loc="upper left")
        for path in paths:
            figure.savefig(path, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)
