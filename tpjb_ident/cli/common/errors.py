"""Every way a command can end, turned into one message and an exit code."""

from __future__ import annotations

import functools
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from typing import Any, TextIO, TypeVar

import typer

from rigdata.problem import RigError
from tpjb_ident.cli.common.terminal import error_line, note_line
from tpjb_ident.errors import NotTrustedError, TpjbError

BUG, BAD_INPUT, NOT_TRUSTED = 1, 2, 3
INTERRUPTED = 130
Command = TypeVar("Command", bound=Callable[..., None])


def guarded(command: Command) -> Command:
    """Wrap a command: any end of it is a result, one clear message, or a named bug. Never a traceback."""

    @functools.wraps(command)
    def wrapper(*args: Any, **kwargs: Any) -> None:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            try:
                command(*args, **kwargs)
            except NotTrustedError as error:
                error_line("not to be trusted", str(error))
                raise typer.Exit(NOT_TRUSTED) from None
            except KeyboardInterrupt:
                error_line("interrupted", "nothing was written.")
                raise typer.Exit(INTERRUPTED) from None
            except BrokenPipeError:  # the reader of our output went away, as `| head` does
                sys.stdout = _Sink()
                raise typer.Exit(0) from None
            except Exception as error:
                message = _bad_input_message(error)
                if message is None:
                    _report_bug(error)
                    raise typer.Exit(BUG) from None
                error_line("error", message)
                raise typer.Exit(BAD_INPUT) from None

    return wrapper  # type: ignore[return-value]


class _Sink:
    def write(self, text: str) -> int:
        return len(text)

    def flush(self) -> None:
        """Nothing is kept."""


def _bad_input_message(error: Exception) -> str | None:
    """Say what is wrong with the input; None if `error` is no fault of the input."""
    if _is_refusal(error):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return f"{place}{error.strerror}. Check the path, its rights and the room on the disk."
    if isinstance(error, MemoryError):
        return "not enough memory for this campaign. Close other programs or split the campaign."
    if isinstance(error, ImportError) and "named 'model'" in str(error):
        return str(error)
    return None


def _is_refusal(error: Exception) -> bool:
    """Whether it says so itself: of each of the three packages the command line knows one base of all refusals."""
    model = sys.modules.get("model.errors")  # not loaded: then it is none of the model's
    return isinstance(error, (TpjbError, RigError, *((model.ModelError,) if model else ())))


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    note_line("warning", f"{category.__name__}: {message} ({filename}:{lineno})")


def _report_bug(error: Exception) -> None:
    with tempfile.NamedTemporaryFile(
        "w", prefix="tpjb-traceback-", suffix=".txt", delete=False, encoding="utf-8", errors="replace"
    ) as file:
        file.write(" ".join(sys.argv) + "\n\n")
        file.writelines(traceback.format_exception(error))
    error_line(
        "bug",
        f"{type(error).__name__}: {str(error)[:300]}. This is a fault of tpjb-ident, not of your data; nothing was "
        f"written. Please report it with the traceback in {file.name}",
    )
