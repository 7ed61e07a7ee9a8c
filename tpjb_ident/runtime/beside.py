"""One job in another process while this one goes on with something else."""

from __future__ import annotations

import functools
import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

from tpjb_ident.runtime.executors import Job, Outcome, Task, attempt, begin_worker, forks, one_thread_each


@contextmanager
def beside(task: Task, *job: Any) -> Iterator[Callable[[], Any | None]]:
    """Run one job in a process of its own while the block goes on; the process is ended with the block.

    Parameters
    ----------
    task : callable
        Of a module, so that another process finds it.
    *job : object
        Its arguments.

    Yields
    ------
    callable
        Waits for the value; None if the job had an error or its process was lost: whoever needs the value works it out
        again, and finds what was wrong. Called a second time, it gives the same.
    """
    context: Any = multiprocessing.get_context("fork" if forks() else "spawn")  # a copy need not import anything again
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send_outcome, args=(sender, task, job), daemon=True)
    with one_thread_each():
        process.start()
    sender.close()

    @functools.cache
    def value() -> Any | None:
        try:
            outcome: Outcome = receiver.recv()
        except EOFError:
            return None
        return outcome.get() if outcome.error is None else None

    try:
        yield value
    finally:
        receiver.close()
        process.kill()
        process.join()


def _send_outcome(sender: Connection, task: Task, job: Job) -> None:
    begin_worker()
    sender.send(attempt(task, None, job))
