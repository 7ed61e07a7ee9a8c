"""One object for one run of a command, and the decorator that makes a command of a function.

A command is a function in a file of `tpjb_ident.cli.commands`, decorated with ``@command(..)`` and listed in its `app`.
Its first argument is the `Command`: it opens what the user gave, takes tables, messages and the next command, and at
the end writes run.json, prints the document of ``--json`` and turns errors into exit codes.
"""

from __future__ import annotations

import contextlib
import datetime
import functools
import inspect
import io
import json
import os
import re
import sys
import tempfile
import traceback
import typing
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigdata.problem import Problem, RigError
from tpjb_ident.cli.options import DEMO, ROCKER, option
from tpjb_ident.cli.terminal import Progress, Terminal
from tpjb_ident.columns import in_us_units, use_units
from tpjb_ident.conditions import Condition, sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError, TpjbError
from tpjb_ident.runtime.interrupts import heard, interrupt_behind
from tpjb_ident.runtime.output_folder import RECORD, contradiction, files_in, output_folder, record_text
from tpjb_ident.runtime.provenance import TABLE_SCHEMA, sha256, versions
from tpjb_ident.runtime.tables import write_csv, write_table, write_text

if TYPE_CHECKING:
    import pandas as pd

    from model.bearing import Bearing
    from rigdata.campaign import Campaign
    from tpjb_ident.report.figure import Panel

_BUG, _BAD_INPUT, _NOT_TRUSTED, _INTERRUPTED, _TERMINATED = 1, 2, 3, 130, 143
#: What numpy says of single operations is for programmers: run.json lists it, people are told by conditions.
_ARITHMETIC = re.compile(r"encountered in|empty slice|All-NaN|[Dd]egrees of freedom|poorly conditioned")
#: A result table of more rows is named in the document of ``--json``, not repeated in it.
_MOST_ROWS = 5000
REPORT = "report.html"
#: Every command by its name, as its file is imported.
COMMANDS: dict[str, Callable[..., None]] = {}
#: Options that change how a command runs, not what it computes.
_UNRECORDED = ("workers", "scheduler")


class Command(Terminal):
    """One run of a command: its options, what it opened, its output folder, what it prints, and how it ends."""

    folder: Path  #: the temporary one that is filled inside `results`

    def __init__(self, name: str, options: Mapping[str, Any], out: Path | None = None, silent: bool = False) -> None:
        super().__init__(silent)
        self.name, self.out = name, out
        self.options, self.typed = dict(options), dict(options)  #: as run.json records them, and as they were typed
        self.remarks: Sequence[str] = ()  #: flags that run.json repeats
        self.doubt = ""  #: why the results are not to be trusted
        self.arithmetic: dict[str, None] = {}  #: warnings of single operations, in order
        self.target = out or Path(f"tpjb-{name}-out")
        self.frames: dict[str, pd.DataFrame] = {}  #: tables that were written, by file name
        self._sources: list[Path] = []
        self._opened: list[Campaign | Path] = []
        self._outputs: dict[str, None] = {}

    def open(self, path: Path) -> Campaign:
        """Open a campaign."""
        from rigdata import load_campaign

        refuse_special(path)
        self._sources.append(path)
        campaign = load_campaign(path)
        self._opened.append(campaign)
        return campaign

    def file(self, path: Path) -> Path:
        """Note an ordinary file that the command reads; devices and pipes are refused.

        A result that is not what run.json beside it recorded is named.
        """
        refuse_special(path)
        if reason := contradiction(path):
            self.warn(f"{path}: {reason}")
        self._opened.append(path)
        return path

    def bearing(self, path: Path) -> Bearing:
        """Load a bearing file."""
        from model.bearing_file import load_bearing

        return load_bearing(self.file(path))

    def has_bearing(self, campaign: Campaign) -> bool:
        """Whether there is a bearing to load: the file of ``--bearing``, or what the campaign carries."""
        return bool(self.typed.get("bearing") or campaign.bearing_text)

    def bearing_of(self, campaign: Campaign) -> Bearing:
        """Load the bearing that a campaign carries, or the file of ``--bearing`` in its place."""
        from model.bearing_file import parse_bearing

        path = self.typed.get("bearing")
        if "bearing" in self.options:
            self.options["bearing"] = path or campaign.bearing_name
        if path is not None:
            return self.bearing(path)
        if not campaign.bearing_text:
            raise BadInputError(
                f"campaign {campaign.id}: carries no bearing file ({campaign.bearing_name or 'none is named'}). "
                "Give one with --bearing FILE."
            )
        return parse_bearing(campaign.bearing_text, campaign.bearing_name)

    @functools.cached_property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of everything that was opened, by file, with its folder where another file has its name."""
        hashes: dict[str, str] = {}
        for source in self._opened:
            files = {source.name: sha256(source)} if isinstance(source, Path) else source.fingerprint()
            path = (source if isinstance(source, Path) else source.path).resolve()
            folder, prefix = path if path.is_dir() else path.parent, ""
            while any(hashes.get(prefix + name, digest) != digest for name, digest in files.items()):
                folder, prefix = folder.parent, f"{folder.name}/{prefix}"
            for name, digest in files.items():
                hashes[prefix + name] = digest
        return hashes

    @property
    def origin(self) -> dict[str, Any]:
        """How a page came about, by the fields of `Page`: settings, inputs, and the command that comes next."""
        return {"settings": _plain(self.options), "inputs": self.inputs, "then": self.following}

    @contextlib.contextmanager
    def results(self, activity: str = "", entry: str = "") -> Iterator[Progress]:
        """Fill a temporary folder; when the block ends well it gets a run.json and moves to the output folder.

        With an activity the block's progress is shown.
        """
        entry = entry or self.name
        shown = self.progress(activity) if activity else contextlib.nullcontext(lambda *_: None)
        with output_folder(self.target, entry, tuple(self._sources)) as self.folder, shown as show:
            yield show
            notes = {"remarks": list(self.remarks), "arithmetic": list(self.arithmetic), "options": _plain(self.typed)}
            notes["campaign"] = ", ".join(source.id for source in self._opened if not isinstance(source, Path))
            names = write_record(self.folder, self.target, entry, self.options, self.inputs, notes)
        self.wrote(*names)

    def table(self, name: str, frame: pd.DataFrame) -> None:
        """Write a table of the results as CSV and Parquet."""
        self.frames[name] = frame
        write_table(self.folder, name, frame)
        if in_us_units():
            from tpjb_ident.presentation import us_table

            write_csv(self.folder / f"{name}_us.csv", us_table(frame))

    def json(self, name: str, document: Mapping[str, Any]) -> None:
        """Write a JSON file of the results."""
        write_text(self.folder / name, json.dumps(document, indent=1, ensure_ascii=False) + "\n")

    def draw(self, panels: Sequence[Panel]) -> None:
        """Write the figures of the results."""
        from tpjb_ident.report.figure import save_panels

        save_panels(panels, self.folder / "figures")

    def warn_of(self, problems: Sequence[Problem]) -> list[str]:
        """Warn of problems; give back those that are errors, for `judge`."""
        errors = []
        for problem in problems:
            if problem.severity == "error":
                errors.append(str(problem))
            else:
                self.warn(str(problem))
        return errors

    def judge(self, parts: Mapping[str, Sequence[Condition]], missing: Sequence[str] = ()) -> None:
        """Note the conditions of named parts, each once; end with exit code 3 if one forbids trust, or parts miss."""
        places = defaultdict(list)
        serious: list[str] = []
        for name, conditions in parts.items():
            for text in sentences(conditions):
                places[text].append(name)
            serious += sentences(untrusted(conditions))
        notes = {text: f"{', '.join(names)}: {text}" for text, names in places.items()}
        for note in notes.values():
            self.note(note)
        if serious or missing:
            raise NotTrustedError("; ".join([*(notes[text] for text in dict.fromkeys(serious)), *missing]))

    def distrust(self, doubt: str) -> None:
        """Note why the results are not to be trusted, if so: the exit code is 3, and the records come first."""
        self.doubt = doubt
        if doubt and self._sources:
            self.next("check", self._sources[-1])

    def wrote(self, *names: str) -> None:
        """Note files that are in the output folder now."""
        self._outputs |= dict.fromkeys(names)

    def run(self, function: Callable[..., None], options: Mapping[str, Any]) -> int:
        """Run the command, and print where its results are and, last of all, the command that comes next."""
        exit_code = self._ended(function, options)
        if exit_code in (0, _BAD_INPUT, _NOT_TRUSTED):
            with contextlib.suppress(BrokenPipeError):
                if REPORT in self._outputs:
                    self.print(f"Report: {self.target / REPORT}")
                elif self._outputs:
                    self.print(f"Results: {self.target}")
                self.close()
        return exit_code

    def _ended(self, function: Callable[..., None], options: Mapping[str, Any]) -> int:
        """Run the command; any end of it is a result, one clear message, or a named bug, never a traceback."""
        try:
            with warnings.catch_warnings():
                warnings.showwarning = self._show_warning  # type: ignore[assignment]
                use_units(self.options.get("units", "si"))
                function(self, **options)
            if self.doubt:
                raise NotTrustedError(self.doubt)
        except BrokenPipeError:  # the reader of our output went away, as `| head` does
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (open until the process ends)
        except (Exception, KeyboardInterrupt) as error:
            exit_code, kind, message = _end_of(error)
            self.say(kind, message)
            if exit_code == _NOT_TRUSTED:
                self.distrust(message)
            return exit_code
        finally:
            use_units("si")
        return 0

    def _show_warning(
        self, message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object
    ) -> None:
        text = f"{category.__name__}: {message} ({filename}:{lineno})"
        if _ARITHMETIC.search(str(message)):
            self.arithmetic[text] = None
        else:
            self.warn(text)

    def print_document(self, exit_code: int) -> None:
        """Print everything as one JSON document."""
        from tpjb_ident.presentation import json_data

        # escapes where standard output is not UTF-8, which every program that reads JSON expects
        ascii_only = "utf" not in (sys.stdout.encoding or "").lower()
        document = json_data(self.document(exit_code))
        typer.echo(json.dumps(document, indent=1, ensure_ascii=ascii_only, allow_nan=False))

    def document(self, exit_code: int) -> dict[str, Any]:
        """Everything printed, as plain data; ``data`` holds the result tables and JSON files themselves."""
        data = {}
        for name in self._outputs:
            stem, ending = os.path.splitext(name)
            if ending == ".parquet":
                frame = self.frames.get(stem)
                if frame is None:  # of an export
                    from pyarrow.parquet import ParquetFile

                    content = io.BytesIO((self.target / name).read_bytes())  # no thread of the library's holds it
                    frame = ParquetFile(content).read(use_threads=False).to_pandas()
                few = len(frame) <= _MOST_ROWS
                data[stem] = frame.to_dict("records") if few else {"rows": len(frame), "file": name}
            elif ending == ".json" and name != RECORD:
                data[stem] = json.loads((self.target / name).read_text("utf-8"))
        return {
            "schema": "tpjb-command/1",
            "command": self.name,
            "exit_code": exit_code,
            "results": str(self.target) if self._outputs else None,
            "outputs": list(self._outputs),
            "said": self.lines,
            "remarks": self.messages,
            "tables": self.tables,
            "data": data,
        }


def command(*examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a function that takes a `Command` and then its options: --out, --json, --quiet come with it.

    The examples are printed below its help; what can be typed for each parameter is in `options`.
    """

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        name = function.__name__
        declared = list(inspect.signature(function).parameters.values())[1:]

        def run(
            out: Path | None = None, as_json: bool = False, units: str = "si", quiet: bool = False, **options: Any
        ) -> None:
            recorded = {p.name: options[p.name] for p in declared if p.name not in _UNRECORDED}
            recorded |= {"units": units} if units != "si" else {}
            c = Command(name, recorded, out, as_json or quiet)
            exit_code = c.run(function, options)
            if as_json:
                c.print_document(exit_code)
            if exit_code:
                raise typer.Exit(exit_code)

        hints = typing.get_type_hints(function) | typing.get_type_hints(run)
        *common, _ = inspect.signature(run).parameters.values()
        functools.update_wrapper(run, function)
        parameters = []
        for parameter in (*declared, *common):
            annotation = Annotated[hints[parameter.name], option(name, parameter.name)]  # type: ignore
            run.__annotations__[parameter.name] = annotation
            parameters.append(parameter.replace(annotation=annotation, kind=inspect.Parameter.KEYWORD_ONLY))
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.examples = [text.format(DEMO=DEMO, ROCKER=ROCKER) for text in examples]  # type: ignore[attr-defined]
        COMMANDS[name] = run
        return run

    return decorate


def _end_of(error: BaseException) -> tuple[int, str, str]:
    """Exit code, kind of message and message of a command that did not end well."""
    if isinstance(error, NotTrustedError):
        return _NOT_TRUSTED, "not to be trusted", str(error)
    interrupt = interrupt_behind(error)  # an import that it fell into makes an error of its own of it
    if interrupt is not None:
        heard()
        ended = (_TERMINATED, "terminated") if interrupt.args else (_INTERRUPTED, "interrupted")
        return *ended, "no results were written."
    model = sys.modules.get("model.errors")  # not loaded: then it is none of the model's
    refusals = (TpjbError, RigError, *((model.ModelError,) if model else ()))
    if isinstance(error, refusals) or (isinstance(error, ImportError) and "named 'model'" in str(error)):
        return _BAD_INPUT, "error", str(error)
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return _BAD_INPUT, "error", f"{place}{error.strerror}. Check the path, its rights and the room on the disk."
    if isinstance(error, MemoryError):
        return _BAD_INPUT, "error", "not enough memory for this campaign. Close other programs or split the campaign."
    return _BUG, "bug", _bug_report(error)


def _bug_report(error: BaseException) -> str:
    """Write the traceback to a temporary file and say where it is."""
    with tempfile.NamedTemporaryFile(
        "w", prefix="tpjb-traceback-", suffix=".txt", delete=False, encoding="utf-8", errors="replace"
    ) as file:
        file.write(" ".join(sys.argv) + "\n\n")
        file.writelines(traceback.format_exception(error))
    return (
        f"{type(error).__name__}: {str(error)[:300]}. This is a fault of tpjb-ident, not of your data; nothing was "
        f"written. Please report it with the traceback in {file.name}"
    )


def refuse_special(path: Path) -> None:
    """Let ordinary files, folders and names of nothing pass; refuse devices and pipes."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise BadInputError(f"{path}: is a device or a pipe, not a file. Give an ordinary file.")


def write_record(
    staging: Path,
    target: Path,
    entry: str,
    settings: Mapping[str, Any],
    inputs: Mapping[str, str],
    notes: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write run.json into the temporary folder of a command, last; the files that it lists."""
    outputs = files_in(staging)
    record = {
        "tables": TABLE_SCHEMA,
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "settings": _plain(settings),
        "versions": versions(),
        "inputs_sha256": dict(inputs),
        "outputs": outputs,
        "outputs_sha256": {name: sha256(staging / name) for name in outputs},
        "inputs_at": _places(settings, target),
        **{name: note for name, note in (notes or {}).items() if note},
    }
    write_text(staging / RECORD, record_text({entry: record}))
    return outputs


def _places(settings: Mapping[str, Any], target: Path) -> dict[str, str]:
    """Where files and folders among `settings` are, as seen from the output folder; only those that exist.

    Several of one option are numbered: ``prediction.0``.
    """
    values = {}
    for name, value in settings.items():
        values[name] = value
        for number, item in enumerate(value) if isinstance(value, list | tuple) else ():
            values[f"{name}.{number}"] = item
    places = {}
    for key, path in values.items():
        if isinstance(path, Path) and path.exists():
            with contextlib.suppress(ValueError):  # another drive: there is no relative way
                places[key] = Path(os.path.relpath(path.resolve(), target.resolve())).as_posix()
    return places


def _plain(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as JSON holds them; of a file its name: its place is of no use elsewhere, its SHA-256 tells which."""
    return json.loads(json.dumps(options, default=lambda value: getattr(value, "name", str(value))))
