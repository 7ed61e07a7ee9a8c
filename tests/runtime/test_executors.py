"""Jobs come out the same wherever they run, and a lost worker loses nothing."""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy  # noqa: F401  (has to be loaded)
import pytest

from tpjb_ident.runtime import executors
from tpjb_ident.runtime.executors import (
    LostJobsError,
    PoolWorkers,
    Workers,
    background_job,
    local_workers,
    open_workers,
)
from tpjb_ident.runtime.interrupts import interrupts_held
from tpjb_ident.runtime.threads import THREAD_VARIABLES


def doubled(x):
    return 2 * x


def refused(x):
    if x in (3, 5):
        raise ValueError(f"no {x}")
    return x


def with_shared(shared, x):
    return shared["offset"] + x


def warned(x):
    warnings.warn(f"mind {x}", RuntimeWarning, stacklevel=1)
    return x


def dies_once(folder, x):
    """Kill the worker, the first time that job 4 is tried."""
    mark = Path(folder) / "died"
    if x == 4 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 3 * x


def dies(x):
    os.kill(os.getpid(), signal.SIGKILL)


def has_own_class():
    class Odd(Exception):
        def __init__(self, a, b):
            super().__init__(a)

    raise Odd(1, 2)


@pytest.fixture(scope="module")
def two():
    with local_workers(2) as workers:
        yield workers


def jobs(n):
    return [(i,) for i in range(n)]


class Backwards(Executor):
    """Ends its jobs in the wrong order."""

    def __init__(self):
        self.held = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.held.append((future, fn, args))
        if len(self.held) == 4:
            for held, task, arguments in reversed(self.held):
                held.set_result(task(*arguments))
            self.held.clear()
        return future


def test_answers_stand_in_order_even_if_they_end_in_another():
    workers = PoolWorkers(Backwards, 2)
    assert list(workers.map(doubled, jobs(8))) == [2 * i for i in range(8)]


@pytest.mark.slow
def test_here_and_in_processes_alike(two):
    shared = {"offset": 100}
    for workers in (Workers(), two):
        assert list(workers.map(doubled, jobs(9))) == [2 * i for i in range(9)]
        assert list(workers.map(with_shared, jobs(3), shared)) == [100, 101, 102]
        assert list(workers.map(doubled, [])) == []


@pytest.mark.slow
def test_the_first_error_in_order_is_raised_where_it_stands(two):
    for workers in (Workers(), two):
        answers = workers.map(refused, jobs(8))
        assert [next(answers) for _ in range(3)] == [0, 1, 2]
        with pytest.raises(ValueError, match="no 3"):
            next(answers)


def test_a_warning_on_a_worker_is_a_warning_here(two):
    with pytest.warns(RuntimeWarning, match="mind 7"):
        assert list(two.map(warned, [(7,)])) == [7]


def test_an_error_that_cannot_travel_comes_as_its_text(two):
    with pytest.raises(RuntimeError, match="Odd"):
        list(two.map(has_own_class, [()]))


@pytest.mark.slow
def test_a_killed_process_loses_nothing(tmp_path):
    with local_workers(2) as workers:
        assert list(workers.map(dies_once, [(str(tmp_path), i) for i in range(12)])) == [3 * i for i in range(12)]
    assert (tmp_path / "died").exists()


@pytest.mark.slow
def test_a_job_that_kills_every_worker_is_given_up():
    with local_workers(2) as workers, pytest.raises(LostJobsError, match=r"3 times in a row.*memory"):
        list(workers.map(dies, jobs(1)))


def test_one_worker_is_this_process():
    with open_workers(1) as workers:
        assert type(workers) is Workers


def _threads() -> tuple[set[str], int]:
    pools = [path for path in Path("/proc/self/maps").read_text().split() if "openblas" in path]
    for name in ("scipy_openblas_get_num_threads64_", "openblas_get_num_threads64_", "openblas_get_num_threads"):
        if pools and hasattr(library := ctypes.CDLL(pools[0]), name):
            return {os.environ[variable] for variable in THREAD_VARIABLES}, getattr(library, name)()
    return {"1"}, 1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="lists what is loaded")
def test_linear_algebra_that_is_loaded_takes_one_thread_in_workers():
    """Processes that are forked have numpy already: the environment does not reach it."""
    with local_workers(2, start="fork") as workers:
        assert next(workers.map(_threads, [()])) == ({"1"}, 1)


@pytest.mark.slow
def test_a_background_job_gives_its_value_or_nothing(tmp_path, monkeypatch):
    with background_job(doubled, 4) as value:
        assert value() == value() == 8
    with background_job(len, bytes(10**7)) as value:
        assert value() == 10**7
    with background_job(refused, 3) as value:  # whoever needs the value computes it again, and finds what was wrong
        assert value() is None
    with background_job(dies_once, str(tmp_path), 4) as value:
        assert value() is None
    monkeypatch.setattr(executors, "cores", lambda: 1)
    with background_job(doubled, 4) as value:
        assert value() is None


def test_a_background_job_adds_no_thread_here():
    """The block makes copies of this process, as for its pictures, and a copy of one with threads may hang."""
    before = threading.active_count()
    with background_job(doubled, 4) as value:
        assert value() in (8, None)
        assert threading.active_count() == before


@pytest.mark.slow
def test_a_background_job_ends_with_its_block():
    with background_job(time.sleep, 600.0):
        began = time.monotonic()
    assert time.monotonic() - began < 60.0


def _interrupted_while_starting(ready):
    """A process in which Ctrl-C comes between the start of a worker and the line that notes it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    start = multiprocessing.process.BaseProcess.start

    def started(self):
        start(self)
        signal.raise_signal(signal.SIGINT)

    multiprocessing.process.BaseProcess.start = started
    for opened in (lambda: background_job(bytes, 10**7), lambda: local_workers(2, start="fork")):
        try:
            with opened() as work:
                ready.send(f"not interrupted: {work}")
        except KeyboardInterrupt:
            ready.send([child.is_alive() for child in multiprocessing.active_children()])


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="copies of a process")
def test_an_interrupt_while_a_process_starts_leaves_none_that_the_end_would_wait_for():
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_interrupted_while_starting, args=(sender,))
    process.start()
    sender.close()
    assert [receiver.recv(), receiver.recv()] == [[], []]
    process.join(30.0)
    assert process.exitcode == 0


def test_a_signal_that_is_held_is_heard_where_the_block_fails_too():
    def call_a_worker():
        with interrupts_held():
            signal.raise_signal(signal.SIGINT)
            raise RuntimeError("the same signal ended the worker")

    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            call_a_worker()
    finally:
        signal.signal(signal.SIGINT, former)
