"""Error, bias and coverage of every estimator in the simulated situation of `tests/rigs/estimator_cases.py`.

    python -m tests.studies.estimators [--replicates 400] [--seed 2026] [--write]

RMSE of H in % of its norm, bias of kxx and kyy in %, coverage of the 95 % intervals in % (all eight entries), and
milliseconds per H. The default method gets all replicates, the others a quarter of them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from tests.rigs.estimator_cases import H_TRUE, OMEGA, Case, draw
from tests.studies.results import report, study_parser, table
from tpjb_ident.dynamic.estimators.estimate import estimate_dynamic_stiffness

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
        return f"{self.rmse:.2f} ({self.bias[0]:+.2f} {self.bias[1]:+.2f}, {self.coverage:.0f})"


def score(case: Case, method: str, replicates: int, seed: int) -> Score:
    """Run one method on `replicates` fresh draws."""
    name, _, norm = method.partition(":")
    errors, biases, inside, times = [], [], [], []
    for replicate in range(replicates):
        s = draw(case, seed, replicate)
        command = s.command if name == "iv" else None
        began = time.process_time()
        est = estimate_dynamic_stiffness(
            s.D, s.F, OMEGA, s.direction, method=name, norm=norm or None, reference=command
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


def main() -> None:
    """Score every method in every case; times are of the cases with all windows."""
    asked = study_parser(__doc__, replicates=400, seed=2026).parse_args()
    rows, times = [], []
    for case in CASES:
        scores = []
        for method in METHODS:
            count = asked.replicates if method == DEFAULT else max(asked.replicates // 4, 1)
            scores.append(score(case, method, count, asked.seed))
        rows.append([case.name, *map(str, scores)])
        print(*rows[-1], sep=" | ", flush=True)
        if case.windows == Case().windows:
            times.append([s.milliseconds for s in scores])
    middle = np.median(times, axis=0)
    ratios = middle / middle[METHODS.index("rlm:huber")]
    rows.append(["time per H, `rlm:huber` = 1", *(f"{ratio:.2f}" for ratio in ratios)])
    note = f"{asked.replicates} replicates, seed {asked.seed}: RMSE % of H (bias kxx, kyy %, coverage %).\n\n"
    report(asked, "estimators", note + table(["case", *(f"`{method}`" for method in METHODS)], rows))


if __name__ == "__main__":
    main()
