"""The workers that were asked for: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from tpjb_ident.runtime.cluster import dask_workers
from tpjb_ident.runtime.executors import PoolWorkers, Workers, cores, local_workers


@contextmanager
def open_workers(
    count: int | None = None,
    scheduler: str | None = None,
    preload: Sequence[str] = (),
    start: str | None = None,
) -> Iterator[Workers]:
    """Open the workers that were asked for."""
    if scheduler is None:
        with local_workers(cores() if count is None else count, start, preload) as workers:
            if start == "fork" and isinstance(workers, PoolWorkers):
                workers.begin()
            yield workers
        return
    with dask_workers(scheduler) as workers:
        yield workers
