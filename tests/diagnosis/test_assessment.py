"""Evidence, scales of the model's error, and unseen folds, on vectors whose answer is known."""

import numpy as np
import pytest

from tpjb_ident.diagnosis.observations.folds import Fold
from tpjb_ident.diagnosis.search.assessment import Basis, Linear, assess
from tpjb_ident.diagnosis.search.components import HIGHEST, NOTHING, Component

N = 40


def basis():
    rows = np.arange(N)
    smooth = np.exp(-0.5 * ((rows[:, None] - rows[None, :]) / 10.0) ** 2)
    folds = tuple(Fold(str(k), np.arange(8 * k, 8 * k + 8)) for k in range(5))
    parts = (Component("scatter", rows, 1e-2 * np.eye(N), NOTHING), Component("h", rows, smooth),
             Component("beyond", rows, smooth, NOTHING, HIGHEST))  # fmt: skip
    return Basis(1e-2 * np.eye(N), parts, folds)


def linear(residual, columns=None, width=1.0):
    columns = np.zeros((N, 0)) if columns is None else columns
    return Linear(residual, columns, np.full(columns.shape[1], width))


def test_a_fold_is_told_by_all_others_as_by_leaving_it_out():
    rng = np.random.default_rng(1)
    column = np.linspace(0.0, 1.0, N)[:, None]
    found = assess(basis(), linear(0.7 * column[:, 0] + 0.1 * rng.standard_normal(N), column, 2.0))
    fold = found.folds[1]
    kept = np.setdiff1d(np.arange(N), fold.members)
    total = np.linalg.inv(found.inverse)
    weight = np.linalg.solve(total[np.ix_(kept, kept)], found.linear.residual[kept])
    assert found.unseen(fold) == pytest.approx(4.0 * column[kept].T @ weight)


def test_an_error_of_the_model_is_learnt_and_never_below_a_tenth_of_what_is_stated():
    rng = np.random.default_rng(2)
    noise = 0.1 * rng.standard_normal(N)
    clean = assess(basis(), linear(noise))
    wrong = assess(basis(), linear(noise + 5.0 * np.sin(np.arange(N) / 8.0)))
    assert np.sqrt(clean.scales[1]) == pytest.approx(0.1, rel=0.5)
    assert np.sqrt(wrong.scales[1:].sum()) > 2.0
    assert clean.evidence > wrong.evidence + 10.0


def test_unseen_points_want_a_column_that_is_there_and_no_other():
    rng = np.random.default_rng(3)
    there = np.cos(np.arange(N) * 1.3)[:, None]
    other = rng.standard_normal((N, 1))
    residual = 2.0 * there[:, 0] + 0.1 * rng.standard_normal(N)
    nothing, right, wrong = (
        float(assess(basis(), linear(residual, c, 3.0)).scores().sum()) for c in (None, there, other)
    )
    assert right > nothing + 20.0
    assert wrong < nothing + 5.0
