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
    """Open the workers that were asked for.

    Parameters
    ----------
    count : int, optional
        Processes on this machine; default one per core. Not with `scheduler`.
    scheduler : str, optional
        Address of a Dask scheduler, ``"tcp://host:8786"``, or of the file that it wrote.
    preload : sequence of str
        See `local_workers`.
    start : str, optional
        See `local_workers`.

    Yields
    ------
    Workers

    Raises
    ------
    tpjb_ident.runtime.cluster.ClusterError
        There is no such scheduler, or its workers cannot do these jobs.
    """
    if scheduler is None:
        with local_workers(cores() if count is None else count, start, preload) as workers:
            if start == "fork" and isinstance(workers, PoolWorkers):
                workers.begin()
            yield workers
        return
    with dask_workers(scheduler) as workers:
        yield workers
