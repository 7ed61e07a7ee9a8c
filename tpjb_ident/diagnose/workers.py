"""Workers: the same model runs on both cores; answers do not depend on how many there are."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from tpjb_ident.diagnose.forward import ForwardModel

_forward: ForwardModel | None = None


def _initialise(forward: ForwardModel) -> None:
    global _forward
    _forward = forward


def _run(job: tuple[Callable[..., Any], tuple[Any, ...]]) -> Any:
    task, arguments = job
    assert _forward is not None
    # every job starts from the baseline's equilibria: its answer depends on nothing that ran before it
    return task(_forward.fresh(), *arguments)


Map = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Iterator[Any]]


@contextmanager
def workers(forward: ForwardModel, count: int | None = None) -> Iterator[Map]:
    """Open a pool whose tasks get a `Forward` as their first argument.

    Parameters
    ----------
    forward : Forward
        Warmed up: its equilibria are the common start.
    count : int, optional
        Processes; 1 runs everything here. Default: the cores this process may use.

    Yields
    ------
    callable
        ``run(task, [(argument, ..), ..])`` yields ``task(forward, argument, ..)`` in order.
    """
    count = count or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    if count == 1 or "fork" not in multiprocessing.get_all_start_methods():
        yield lambda task, jobs: (task(forward.fresh(), *arguments) for arguments in jobs)
        return
    # fork: effects that the user registered are known in the workers too
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(count, mp_context=context, initializer=_initialise, initargs=(forward,)) as pool:
        yield lambda task, jobs: pool.map(_run, [(task, arguments) for arguments in jobs])
