"""The workers that were asked for: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from tpjb_ident.errors import TpjbError
from tpjb_ident.runtime.executors import PoolWorkers, Workers, cores, local_workers
from tpjb_ident.runtime.provenance import versions


def open_workers(
    count: int | None = None, scheduler: str | None = None, preload: Sequence[str] = (), start: str | None = None
) -> AbstractContextManager[Workers]:
    """Open the workers that were asked for."""
    if scheduler is not None:
        return dask_workers(scheduler)
    return local_workers(cores() if count is None else count, start, preload)


#: Seconds to wait for the scheduler, and for its first worker.
_PATIENCE = 20.0
#: Versions that numbers depend on.
_SAME = ("tpjb-ident", "numpy", "scipy", "h5py", "statsmodels", "numba")


class ClusterError(TpjbError):
    """The cluster cannot be used; the message says why and what to do."""


@contextmanager
def dask_workers(address: str, patience: float = _PATIENCE) -> Iterator[Workers]:
    """Open the workers of a running Dask scheduler."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ClusterError("a scheduler needs the extra `cluster`: pip install 'tpjb-ident[cluster]'") from error
    place = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
    try:
        client = Client(**place, timeout=patience, set_as_default=False, name="tpjb-ident")
    except (OSError, ValueError, TimeoutError) as error:
        why = str(error).partition("\n")[0][:120] or type(error).__name__
        raise ClusterError(
            f"no Dask scheduler answers at {address} ({why}). "
            "Start one with `dask scheduler` and give the address that it prints"
        ) from error
    with client:
        count = _checked(client, address, patience)
        # pure: a job is known by a hash of all that it is given, which took longer here than the job did there
        opened = functools.partial(client.get_executor, pure=False)
        # without a scheduler nobody knows of workers
        pool = PoolWorkers(opened, count, lambda: bool(client.scheduler_info().get("workers")))
        try:
            yield pool
        finally:
            pool.close(wait=False)


def _checked(client: Any, address: str, patience: float) -> int:
    """Threads of all workers, after a look at what they have installed."""
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as error:
        raise ClusterError(
            f"the scheduler at {address} has no workers. Start some with `dask worker {address} --nthreads 1`"
        ) from error
    ours = {name: versions()[name] for name in _SAME}
    try:
        theirs = client.run(versions)
    except Exception as error:  # what a worker without this package raises depends on its versions
        raise ClusterError(
            f"the workers of {address} cannot run tpjb-ident ({type(error).__name__}: {str(error)[:160]}). "
            "Install the same tpjb-ident there"
        ) from error
    for worker, installed in theirs.items():
        differences = [
            f"{name} {installed[name]} (here {ours[name]})" for name in _SAME if installed[name] != ours[name]
        ]
        if differences:
            text = ", ".join(differences)
            raise ClusterError(f"worker {worker} has {text}. Install the same versions on all machines")
    return max(1, sum(client.nthreads().values()))
