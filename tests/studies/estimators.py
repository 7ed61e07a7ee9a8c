"""Regenerate the estimator study: ``python -m tests.studies.estimators [--replicates 400] [--write]``.

Prints, for every case of `estimator_cases` and every method: RMSE of H in % of its norm, bias of kxx
and kyy in %, coverage of the 95 % intervals in % (all eight entries), milliseconds per H. The default
method gets all replicates, the others a quarter of them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from tests.rigs.estimator_cases import H_TRUE, OMEGA, Case, draw
from tests.studies.results import study_parser, table, typed, write_section
from tpjb_ident.dynamic.estimators.estimate import estimate_dynamic_stiffness
from tpjb_ident.runtime.executors import local_workers, map_ordered

METHODS = ("ols", "rlm:huber", "rlm:tukey", "mm", "iv", "mm-eiv")
CASES = (
    Case(),
    Case(relx=0.02),
    Case(relx=0.10),
    Case(relx=0.20),
    Case("lev", 0.05),
    *(Case(kind, share) for kind in ("force", "forcesys", "lev", "gain") for share in (0.1, 0.2, 0.3, 0.4)),
    *(Case(directions=g, windows=1) for g in (3, 4, 5, 8)),
)
DEFAULT = "mm-eiv"
TRUE = np.concatenate([H_TRUE.real.ravel(), H_TRUE.imag.ravel()])


@dataclass(frozen=True)
class Score:
    """What one method does in one case."""

    rmse: float  #: ||H - H_true||_F / ||H_true||_F [%]
    bias: np.ndarray  #: (2,), of kxx, kyy [%]
    coverage: float  #: of the 95 % intervals, all entries [%]
    milliseconds: float  #: median processor time per H
    worst: float  #: largest relative error of any replicate [%]

    def __str__(self) -> str:
        return f"{self.rmse:6.2f} ({self.bias[0]:+.2f} {self.bias[1]:+.2f}, {self.coverage:.0f})"


@dataclass(frozen=True)
class Row:
    """One case of the study: windows per direction."""

    case: str
    windows: int
    scores: dict[str, Score]


def score(case: Case, method: str, replicates: int, seed: int) -> Score:
    """Run one method on `replicates` fresh draws."""
    name, _, norm = method.partition(":")
    errors, biases, inside, times = [], [], [], []
    for replicate in range(replicates):
        s = draw(case, seed, replicate)
        began = time.process_time()
        est = estimate_dynamic_stiffness(
            s.D,
            s.F,
            OMEGA,
            s.direction,
            method=name,
            norm=norm or None,
            reference=s.command if name == "iv" else None,
        )
        times.append(time.process_time() - began)
        errors.append(np.linalg.norm(est.h - H_TRUE) / np.linalg.norm(H_TRUE))
        biases.append(np.diag(est.k) / np.diag(H_TRUE.real) - 1)
        lo, hi = est.interval(0.95)
        inside.append((lo <= TRUE) & (hi >= TRUE))
    return Score(
        100 * float(np.sqrt(np.mean(np.square(errors)))),
        100 * np.mean(biases, axis=0),
        100 * float(np.mean(inside)),
        1e3 * float(np.median(times)),
        100 * float(np.max(errors)),
    )


def study(replicates: int, seed: int, count: int) -> list[Row]:
    """Score every method in every case, `count` cases at a time; print each row as it comes."""
    jobs = [(case, replicates, seed) for case in CASES]
    rows = []
    with local_workers(count) as workers:
        for row in map_ordered(workers, score_case, jobs):
            print(f"| {row.case} | " + " | ".join(str(row.scores[m]) for m in METHODS) + " |", flush=True)
            rows.append(row)
    return rows


def score_case(case: Case, replicates: int, seed: int) -> Row:
    """Score every method in one case."""
    scores = {}
    for method in METHODS:
        scores[method] = score(case, method, replicates if method == DEFAULT else max(replicates // 4, 1), seed)
    return Row(case.name, case.windows, scores)


def main() -> None:
    """Print the table."""
    parser = study_parser(__doc__)
    parser.add_argument("--replicates", type=int, default=400)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    print(f"{options.replicates} replicates, seed {options.seed}: RMSE % (bias kxx, kyy %, coverage %)")
    print("| case | " + " | ".join(METHODS) + " |")
    print("|---|" + "---|" * len(METHODS))
    rows = study(options.replicates, options.seed, options.workers)
    if options.write:
        full = [row for row in rows if row.windows == 20]
        times = [np.median([row.scores[m].milliseconds for row in full]) for m in METHODS]
        ratios = ["time per H, `rlm:huber` = 1", *(f"{t / times[METHODS.index('rlm:huber')]:.2f}" for t in times)]
        entries = [[row.case, *(str(row.scores[m]).strip() for m in METHODS)] for row in rows]
        note = f"{options.replicates} replicates, seed {options.seed}: RMSE % of H (bias kxx, kyy %, coverage %).\n\n"
        head = ["case", *(f"`{m}`" for m in METHODS)]
        write_section("estimators", typed(), note + table(head, [*entries, ratios]))


if __name__ == "__main__":
    main()
