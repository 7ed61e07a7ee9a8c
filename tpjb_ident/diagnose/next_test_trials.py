"""How often the suggested next test would settle what a campaign cannot tell, beside a test picked blindly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from model.setup import Setup
from tpjb_ident.diagnose.bench import Bench
from tpjb_ident.diagnose.candidates import Candidate
from tpjb_ident.diagnose.next_test import options_for, rank_designs, suggested, together
from tpjb_ident.diagnose.settings import DiagnoseSettings

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]
#: d' of the true effect in the campaign that could not tell.
SIZE = 9.0


def alike_pairs(bench: Bench, below: float = 3.0) -> list[tuple[Candidate, Candidate]]:
    """Pairs of different effects that a bench's campaign could not tell apart at d' = 6, most alike first."""
    factor = bench.factor(1.0)
    columns = np.column_stack([_unit(bench, c, factor) for c in bench.pool])
    apart = 6.0 * np.sqrt(1.0 - np.clip(columns.T @ columns, -1.0, 1.0) ** 2)
    n = len(bench.pool)
    found = [(apart[i, j], i, j) for i in range(n) for j in range(i + 1, n) if apart[i, j] < below]
    return [(bench.pool[i], bench.pool[j]) for _, i, j in sorted(found) if bench.pool[i].name != bench.pool[j].name]


def _unit(bench: Bench, candidate: Candidate, factor: FloatArray) -> FloatArray:
    table = bench.surrogate.tables[bench.pool.index(candidate)]
    small = 0.02 * max(table.amplitudes - candidate.neutral, key=abs)
    white = np.linalg.solve(factor, table.at(candidate.neutral + small))
    return np.asarray(white / max(float(np.linalg.norm(white)), 1e-300))


def next_test_table(bench: Bench, setup: Setup, pairs: Sequence[tuple[Candidate, Candidate]]) -> pd.DataFrame:
    """Expected separation and chance of success of the best test and of a random one, per pair.

    A test succeeds when chi-square of the wrong effect, over the campaign and the new test, exceeds that of the right
    one by 9; with a separation d of both together that has the probability Phi((d^2 - 9) / 2 d).
    """
    import pandas as pd
    from scipy.stats import norm

    factor, settings = bench.factor(1.0), DiagnoseSettings()
    options = options_for(setup, bench.observations.layout)
    rows = []
    for one, other in pairs:
        effect = bench.sized(one, SIZE, 1.0, factor) or bench.sized(one, SIZE, -1.0, factor)
        if effect is None:
            continue
        change = np.linalg.solve(factor, bench.surrogate((effect,)) - bench.surrogate.base)
        table = bench.surrogate.tables[bench.pool.index(other)]
        amplitudes = np.linspace(table.amplitudes[0], table.amplitudes[-1], 801)
        miss = [float(np.linalg.norm(change - np.linalg.solve(factor, table.at(a)))) for a in amplitudes]
        best = int(np.argmin(miss))
        if miss[best] > 4.0:  # not alike in this direction: the campaign tells them
            continue
        ranked = rank_designs(
            setup, (effect,), (other.effect(float(amplitudes[best])),), options, settings.certificates
        )
        d = np.hypot([r.expected for r in ranked], miss[best])
        # nothing apart: the right explanation wins by 9 never
        chance = norm.cdf((d**2 - 9.0) / (2.0 * np.maximum(d, 1e-9)))
        chosen = suggested(ranked)
        then = float(np.hypot(together(chosen), miss[best]))
        rows.append(
            {
                "effect": one.label, "taken_for": other.label, "apart_now": miss[best],
                "next_test": " and ".join(t.design.words for t in chosen), "apart_by_it": together(chosen),
                "apart_then": then, "success": float(norm.cdf((then**2 - 9.0) / (2.0 * then))),
                "success_of_a_random_test": float(np.mean(chance)),
            }
        )  # fmt: skip
    return pd.DataFrame(rows)
