"""Ctrl-C and SIGTERM end a command in order, wherever they fall: a callback, an import, code that swallows them.

A signal is delivered again until the error that it raises is being handled or the command has said `heard`.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

#: s between two looks at what became of a signal
_PAUSE = 0.1
_STOPS = (signal.SIGINT, signal.SIGTERM)
_KINDS = (*_STOPS, *((signal.SIGALRM,) if hasattr(signal, "SIGALRM") else ()))
#: the number of the last signal that came
_signalled = 0


def listen() -> None:
    """Let both signals raise KeyboardInterrupt, SIGTERM with its number: what was begun is cleared away in both."""
    sys.unraisablehook = _without_interrupts
    for number in _KINDS:
        # a shell's job in the background ignores Ctrl-C; whoever began this process may have left the timer ignored
        if number not in _STOPS or signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _interrupt)


def _look_again(pause: float = 0.0) -> None:
    """Have the system send SIGALRM again and again, where it can: the interrupt may have been dropped."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, pause, pause)


def heard() -> None:
    """Note that a command ends, or ended, because of the signal."""
    _look_again()


def stop_listening() -> None:
    """Leave the process to its end: a signal that comes once all is cleared away would replace its exit code."""
    heard()
    for number in _STOPS:
        signal.signal(number, signal.SIG_IGN)


def leave_if_signalled(code: Any) -> None:
    """End at once if a signal came: libraries that it caught while they were loaded may fail at the very end."""
    if _signalled:
        stop_listening()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        # a library that it caught may have lost its number
        os._exit(128 + _signalled if code in (130, 143) else code)


def interrupt_behind(error: BaseException | None) -> KeyboardInterrupt | None:
    """The interrupt that an error was made of, if any."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error


def _interrupt(number: int, frame: Any) -> None:
    global _signalled
    if number in _STOPS:
        _signalled = number
        _look_again(_PAUSE)
    elif interrupt_behind(sys.exc_info()[1]) is not None:  # what is being cleared away is not interrupted again
        return
    raise KeyboardInterrupt(*(() if _signalled == signal.SIGINT else (_signalled,)))


def _without_interrupts(lost: Any) -> None:
    """Print what Python drops, as of a destructor, but not an interrupt, which comes again."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hear Ctrl-C and SIGTERM only when the block has ended: a process begun and not yet noted would never be ended.

    The end of this one would wait for it, and it for somebody who takes its answer.
    """
    held = []
    # other threads are not interrupted
    kinds = _KINDS if threading.current_thread() is threading.main_thread() else ()
    former = {kind: signal.signal(kind, lambda number, frame: held.append(number)) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in former.items():
            signal.signal(kind, handler or signal.SIG_DFL)
        for number in held[:1]:  # also where the block failed: the signal may have ended the workers that it calls
            signal.raise_signal(number)
