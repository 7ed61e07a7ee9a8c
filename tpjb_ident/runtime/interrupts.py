"""Ctrl-C and SIGTERM end a command in order, wherever they fall: a callback, an import, code that swallows them.

A signal is delivered again until the error that it raises is being handled or the command has said `heard`.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

#: s between two looks at what became of a signal
_PAUSE = 0.1
#: the signal that nobody has heard yet, and the number of the last one that came
_open: object | None = None
_signalled = 0


def listen() -> None:
    """Let both signals raise KeyboardInterrupt, SIGTERM with its number: what was begun is cleared away in both."""
    sys.unraisablehook = _without_interrupts
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell's job in the background ignores it
        signal.signal(signal.SIGINT, _interrupt)


def heard() -> None:
    """Note that a command ends, or ended, because of the signal."""
    global _open
    _open = None


def stop_listening() -> None:
    """Leave the process to its end: a signal that comes once all is cleared away would replace its exit code."""
    heard()
    for number in (signal.SIGINT, signal.SIGTERM):
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
    global _open, _signalled
    _signalled = number
    if _open is None:
        _open = object()
        _thread.start_new_thread(_deliver_again, (number, _open))  # threading's own locks may be held here
    raise KeyboardInterrupt(*(() if number == signal.SIGINT else (number,)))


def _deliver_again(number: int, signalled: object) -> None:
    main_thread = threading.main_thread().ident or 0
    while True:
        time.sleep(_PAUSE)
        if _open is not signalled:
            return
        handled = sys._current_exceptions().get(main_thread)
        if interrupt_behind(handled[1] if isinstance(handled, tuple) else handled) is None:
            if hasattr(signal, "pthread_kill"):  # wakes a thread that waits, which the other one does not
                signal.pthread_kill(main_thread, number)
            else:
                _thread.interrupt_main(signal.Signals(number))


def _without_interrupts(lost: Any) -> None:
    """Print what Python drops, as of a destructor, but not an interrupt, which comes again."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hear Ctrl-C and SIGTERM only when the block has ended: a process begun and not yet noted would never be ended.

    The end of this one would wait for it, and it for somebody who takes its answer.
    """
    held: list[int] = []
    # other threads are not interrupted
    kinds = (signal.SIGINT, signal.SIGTERM) if threading.current_thread() is threading.main_thread() else ()
    former = {kind: signal.signal(kind, lambda number, frame: held.append(number)) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in former.items():
            signal.signal(kind, handler or signal.SIG_DFL)
        for number in held[:1]:  # also where the block failed: the signal may have ended the workers that it calls
            signal.raise_signal(number)
