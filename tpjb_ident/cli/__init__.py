"""The `tpjb` command. Nothing else imports this package."""

import gc
import os
import sys
from typing import Any

from tpjb_ident.runtime import interrupts
from tpjb_ident.runtime.threads import THREAD_VARIABLES


def main() -> None:
    """Run the command line; the entry point of `tpjb` and of ``python -m tpjb_ident``."""
    _one_thread_for_small_matrices()
    gc.set_threshold(100_000)  # most of what a command makes stays: to walk through it all again and again frees little
    interrupts.listen()
    stream: Any
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # else there is none at all (pythonw), or it is a caller's own
            # a terminal or a pipe that has no µ or ± shows a question mark: no result is lost to a sign. UTF-8 lacks
            # only what stands for a file name's broken bytes; written as an escape, that is valid JSON too
            stream.reconfigure(errors="backslashreplace" if "utf" in (stream.encoding or "").lower() else "replace")
    try:
        from tpjb_ident.cli.commands.app import app

        app(prog_name="tpjb")
    except KeyboardInterrupt as error:  # while the libraries are loaded, before any command has begun
        print("tpjb: interrupted: no results were written.", file=sys.stderr)
        interrupts.leave_if_signalled(143 if error.args else 130)
    except SystemExit as end:
        interrupts.leave_if_signalled(end.code)
        raise
    except OSError as error:  # of the streams: commands turn their own into messages
        print(f"tpjb: error: cannot print: {error.strerror or error}.", file=sys.stderr)
        sys.exit(2)
    finally:
        interrupts.stop_listening()


def _one_thread_for_small_matrices() -> None:
    """Keep the libraries of linear algebra to one thread, unless the user says otherwise; before they are loaded.

    Matrices here have a few hundred rows: threads wait for each other more than they help (a diagnosis took 53 s
    instead of 22 s), and the last bits of a result depend on their number.
    """
    if "numpy" not in sys.modules:
        for name in THREAD_VARIABLES:
            os.environ.setdefault(name, "1")
