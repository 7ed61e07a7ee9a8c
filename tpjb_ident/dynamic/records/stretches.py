"""A run opened for many requests, stretch by stretch; reading itself is `rigdata.rows`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rigdata.rows import RowReader as Stretches
from tpjb_ident.dynamic.records.run_data import MeasuredRun


@contextmanager
def open_stretches(run: MeasuredRun, quantities: Sequence[str]) -> Iterator[Stretches]:
    """Open a run for many requests.

    Parameters
    ----------
    run : MeasuredRun
    quantities : sequence of str
        With X and Y: ``"displacement"``, ``"force"``, ``"acceleration"``.
    """
    with run.kept_open():
        yield run.row_reader(quantities)


__all__ = ["Stretches", "open_stretches"]
