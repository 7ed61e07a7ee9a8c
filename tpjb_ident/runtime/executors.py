"""Where jobs run: here, in processes of this machine, on a Dask cluster. The answers are the same everywhere.

A job is a module-level function and its arguments. It depends on nothing else, so that it may run anywhere, and
once more where a worker was lost with it. Whoever has work to spread takes a `Workers`:

```python
with open_workers(count=4) as workers:   # or open_workers(scheduler="tcp://host:8786")
    for answer in workers.map(task, [(argument,), ..]):
        ...
```
"""

import functools
import gc
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from tpjb_ident.errors import TpjbError
from tpjb_ident.runtime.interrupts import interrupts_held
from tpjb_ident.runtime.provenance import versions
from tpjb_ident.runtime.threads import one_thread

Task = Callable[..., Any]
Job = tuple[Any, ...]
#: Jobs handed out per worker before the first comes back: enough that nobody waits, few enough to be given up.
_AHEAD = 4
#: Losses in a row, without any job done between them, after which the workers are given up.
_MAX_LOSSES = 3
#: Seconds without any job done after which somebody looks whether there are workers at all.
_STALLED = 60.0


class LostJobsError(TpjbError):
    """Workers were lost again and again with the jobs they had."""


@dataclass(frozen=True)
class Outcome:
    """What became of a job: its value, or the error that it ended with."""

    value: Any = None
    error: Exception | None = None
    warned: tuple[tuple[str, type[Warning], str, int], ...] = ()

    def get(self) -> Any:
        """Return the value; warn as the job did and raise what it raised."""
        for warning in self.warned:
            warnings.warn_explicit(*warning)
        if self.error is not None:
            raise self.error
        return self.value


class Workers:
    """A place where jobs run; this one is the process itself, one job after the other."""

    count = 1  #: jobs that run at a time

    def map(self, task: Task, jobs: Sequence[Job], shared: Any = None) -> Iterator[Any]:
        """Yield the values of ``task(*job)`` in the order of the jobs; raise the error of the first that has one.

        The task is one of a module, so that other processes find it. What is `shared` is every job's first argument; a
        worker unpacks it once, so a task must not change it.
        """
        call = _with_shared(task, shared)
        for job in jobs:
            yield call(*job)


def _with_shared(task: Task, shared: Any) -> Task:
    return task if shared is None else functools.partial(task, shared)


class PoolWorkers(Workers):
    """Jobs spread by any `concurrent.futures.Executor`; one that breaks is replaced and its jobs are run again."""

    def __init__(self, opened: Callable[[], Executor], count: int, alive: Callable[[], bool] = lambda: True) -> None:
        self._opened, self.count, self._alive = opened, count, alive
        self.executor = opened()

    def submit(self, *call: Any) -> Future[Any]:
        """Hand a call to the executor."""
        with interrupts_held():
            return self.executor.submit(*call)

    def map(self, task: Task, jobs: Sequence[Job], shared: Any = None) -> Iterator[Any]:
        """See `Workers`; raises `LostJobsError`."""
        packed = pickle.dumps(_with_shared(task, shared), protocol=5)
        futures = {}  # by number of the job
        first = losses = 0
        while first < len(jobs):
            try:
                for number in range(first, min(first + _AHEAD * self.count, len(jobs))):
                    if number not in futures:
                        futures[number] = self.submit(_attempt, packed, jobs[number])
                ended = wait([futures[first]], timeout=_STALLED).done
                outcomes = [future.result() for future in ended]
            except Exception as error:  # every executor has its own way to say that a worker is gone
                losses += 1
                if losses == _MAX_LOSSES:
                    raise LostJobsError(
                        f"workers were lost {losses} times in a row, last with {type(error).__name__}: {error}. "
                        "Is memory short? Use fewer workers, or look at the workers' own messages"
                    ) from error
                broken = isinstance(error, BrokenExecutor)  # takes all of its jobs with it
                self.executor = self._opened() if broken else self.executor
                for number, future in list(futures.items()):
                    # of a lost worker: what the job itself raises comes as a value
                    if broken or future.cancelled() or (future.done() and future.exception() is not None):
                        del futures[number]
                continue
            if not outcomes and not self._alive():
                raise LostJobsError("all workers are gone, and none came back. Start some again")
            for outcome in outcomes:
                losses = 0
                del futures[first]
                first += 1
                yield outcome.get()


def _attempt(packed: bytes, job: Job) -> Outcome:
    """Run a job on a worker; whatever it raises or warns of travels back as a value."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")  # the process that asked decides what a warning means
        try:
            value, error = _unpacked(packed)(*job), None
        except Exception as raised:  # whoever asked gets it from the outcome
            value, error = None, _portable(raised)
    return Outcome(value, error, tuple((str(w.message), w.category, w.filename, w.lineno) for w in caught))


#: The task and what all jobs share, unpacked once.
_unpacked = functools.lru_cache(maxsize=1)(pickle.loads)


def _portable(error: Exception) -> Exception:
    """The error with its traceback as a note, or its text where it cannot travel."""
    text = "".join(traceback.format_exception(error))
    try:
        error.add_note(f"on a worker:\n{text}")
        pickle.loads(pickle.dumps(error))
    except Exception:  # classes fail to unpickle in their own ways
        return RuntimeError(text)
    return error


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a copy of the parent has its handler
    one_thread()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)  # nobody is left to hear of it


def forks() -> bool:
    """Whether a process may begin as a copy of this one, with all that is loaded: on Linux, and without threads."""
    return sys.platform.startswith("linux") and threading.active_count() == 1


def cores() -> int:
    """Cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux only
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _context(start: str | None = None) -> Any:
    """What processes begin with: as copies of this one, which need not import anything again, where that can be."""
    return multiprocessing.get_context(start or ("fork" if forks() else "spawn"))


@contextmanager
def local_workers(count: int, start: str | None = None) -> Iterator[Workers]:
    """Open processes on this machine, which end with the block; one alone is this process itself."""
    if count <= 1:
        yield Workers()
        return
    context = _context(start)
    gc.freeze()  # copies share the memory of this process as long as no collector walks through it
    pool = PoolWorkers(lambda: ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker), count)
    try:
        if context.get_start_method() == "fork":  # copies are best made before there are threads, as a bar's
            pool.submit(int).result()
        yield pool
    finally:
        gc.unfreeze()
        processes = getattr(pool.executor, "_processes", None) or {}
        for process in list(processes.values()):  # nobody waits for what they are still at
            process.terminate()
        pool.executor.shutdown(cancel_futures=True)


@contextmanager
def background_job(task: Task, *job: Any) -> Iterator[Callable[[], Any | None]]:
    """Run one job in a process of its own while the block goes on, and end that process with the block.

    Gives what waits for the job's value. None where there is no second core, the job had an error, or its process was
    lost: whoever needs the value computes it again, and finds what was wrong. No executor: its thread would be there
    where the block makes copies of this process.
    """
    if cores() < 2:
        yield lambda: None
        return
    context = _context()
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send_outcome, args=(sender, pickle.dumps(task), job))
    try:
        with interrupts_held():
            process.start()
        sender.close()
        yield functools.cache(lambda: _received_value(receiver))
    finally:
        if process.pid is not None:
            process.kill()
            process.join()
        receiver.close()


def _send_outcome(sender: Any, packed: bytes, job: Job) -> None:
    _begin_worker()
    with suppress(ConnectionError):  # nobody waits for it any more
        sender.send(_attempt(packed, job))


def _received_value(receiver: Any) -> Any | None:
    try:
        outcome = receiver.recv()
    except (EOFError, ConnectionError):
        return None
    return outcome.get() if outcome.error is None else None


def open_workers(
    count: int | None = None, scheduler: str | None = None, start: str | None = None
) -> AbstractContextManager[Workers]:
    """Open the workers that were asked for."""
    return local_workers(count or cores(), start) if scheduler is None else dask_workers(scheduler)


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
        raise ClusterError(
            f"no Dask scheduler answers at {address} ({_reason(error)}). "
            "Start one with `dask scheduler` and give the address that it prints"
        ) from error
    with client:
        _refuse_other_versions(client, address, patience)
        # pure: a job is known by a hash of all that it is given, which took longer here than the job did there
        opened = functools.partial(client.get_executor, pure=False)
        # without a scheduler nobody knows of workers
        yield PoolWorkers(opened, sum(client.nthreads().values()), lambda: bool(client.scheduler_info().get("workers")))


def _refuse_other_versions(client: Any, address: str, patience: float) -> None:
    """Look at what the workers have installed."""
    try:
        client.wait_for_workers(1, timeout=patience)
        installed = client.run(versions)
    except Exception as error:  # what a worker without this package raises depends on its versions
        raise ClusterError(
            f"no worker of {address} can run tpjb-ident ({_reason(error)}). "
            f"Start some with `dask worker {address} --nthreads 1` where it is installed"
        ) from error
    ours = versions()
    for worker, theirs in installed.items():
        conflicts = [f"{name} {theirs[name]} (here {ours[name]})" for name in _SAME if theirs[name] != ours[name]]
        if conflicts:
            raise ClusterError(f"worker {worker} has {', '.join(conflicts)}. Install the same versions on all machines")


def _reason(error: Exception) -> str:
    return str(error).partition("\n")[0][:120] or type(error).__name__
