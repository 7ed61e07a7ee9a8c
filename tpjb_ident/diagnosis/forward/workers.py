"""Workers: the same model runs on both cores; answers do not depend on how many there are."""

import itertools
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.runtime.executors import Workers, cores, local_workers

#: What the workers of this process share: they are forked from it and have it from there. Sent with every job it would
#: be megabytes of equilibria each time.
_shared: dict[int, tuple[Forward, Any]] = {}
_numbers = itertools.count()


def _run(number: int, task: Callable[..., Any], *arguments: Any) -> Any:
    forward, problem = _shared[number]
    # every job starts from the baseline's equilibria: its answer depends on nothing that ran before it
    return task(forward.fresh(), problem, *arguments)


@dataclass(frozen=True)
class Map:
    """Maps a task over jobs, in this process or in workers."""

    opened: Workers
    number: int

    def __call__(self, task: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        """Yield ``task(forward, problem, argument, ..)`` for every job, in order."""
        return self.opened.map(_run, [(self.number, task, *arguments) for arguments in jobs])


@contextmanager
def workers(forward: Forward, problem: Any, count: int | None = None) -> Iterator[Map]:
    """Open workers whose tasks get a `Forward` and what else they share as their first arguments."""
    number = next(_numbers)
    _shared[number] = (forward, problem)
    try:
        # fork: effects that the user registered are known in the workers too
        able = "fork" in multiprocessing.get_all_start_methods()
        with local_workers((count or cores()) if able else 1, start="fork") as opened:
            yield Map(opened, number)
    finally:
        del _shared[number]
