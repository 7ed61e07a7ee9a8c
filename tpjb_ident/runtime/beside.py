"""A task in another process while this one goes on with something else, and what the two tell each other."""

from __future__ import annotations

import functools
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any

from tpjb_ident.runtime.executors import Job, Outcome, Task, attempt, begin_worker, forks
from tpjb_ident.runtime.threads import one_thread_each


class Talk:
    """One end of the line between two processes."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._sending: threading.Thread | None = None

    def tell(self, value: Any) -> None:
        """Send a value; this process goes on, whether or not the other one listens yet."""
        self.settle()
        packed = ForkingPickler.dumps(value)
        self._sending = threading.Thread(target=self._send, args=(packed,), daemon=True)
        self._sending.start()

    def hear(self) -> Any:
        """Wait for the next value."""
        return self._connection.recv()

    def settle(self) -> None:
        """Wait until all that was told has been heard."""
        if self._sending is not None:
            self._sending.join()

    def _send(self, packed: Any) -> None:
        with suppress(OSError):  # nobody listens any more
            self._connection.send_bytes(packed)


class Companion(Talk):
    """The other process, as the one that began it sees it."""

    def hear(self) -> Any | None:
        """Wait for the next value, in the end for the task's own.

        None if the task had an error or its process was lost: whoever needs the value works it out again, and finds
        what was wrong.
        """
        try:
            outcome = super().hear()
        except (EOFError, ConnectionError):
            return None
        if not isinstance(outcome, Outcome):
            return outcome
        return outcome.get() if outcome.error is None else None


@contextmanager
def companion(task: Task, *job: Any) -> Iterator[Companion]:
    """Run a task in a process of its own while the block goes on; the process is ended with the block."""
    context: Any = multiprocessing.get_context("fork" if forks() else "spawn")  # a copy need not import anything again
    ours, theirs = context.Pipe()
    process = context.Process(target=_run, args=(theirs, task, job))
    with one_thread_each():
        process.start()
    theirs.close()
    try:
        yield Companion(ours)
    finally:
        _end(process)
        ours.close()


@contextmanager
def beside(task: Task, *job: Any) -> Iterator[Callable[[], Any | None]]:
    """Run one job in a process of its own while the block goes on; see `companion`."""
    with companion(_silent, task, job) as other:
        yield functools.cache(other.hear)


def _silent(_: Talk, task: Task, job: Job) -> Any:
    return task(*job)


def _run(connection: Connection, task: Task, job: Job) -> None:
    with suppress(AttributeError, OSError):  # a group with its own workers: they end with it. Not on Windows
        os.setpgid(0, 0)
    begin_worker()
    talk = Talk(connection)
    outcome = attempt(task, None, (talk, *job))
    talk.settle()
    with suppress(ConnectionError):
        connection.send(outcome)


def _end(process: Any) -> None:
    """Kill a process and its workers, at whatever they are: what they write into is cleared next."""
    if sys.platform != "win32":
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.join()
