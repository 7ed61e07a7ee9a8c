"""`tpjb rerun`: the same computed again, with the options and inputs of a run.json, and what differs."""

import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import typer

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.commands.verify import STATES, files_of, recorded
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError, NotTrustedError, TpjbError
from tpjb_ident.rounding import listed
from tpjb_ident.runtime.output_folder import RECORD, contradiction, outputs_of, texts_of

#: Commands whose results hang on their options and inputs alone.
_REPEATABLE = (
    "check", "identify", "pivot", "locus", "predict", "compare", "diagnose", "plan", "simulate", "demo", "export",
)  # fmt: skip
#: Options of this command itself: a record from elsewhere decides neither where to write nor whom to connect to.
_OURS = ("out", "as_json", "quiet", "workers", "scheduler")
_WORDS = {"same": "the same bytes", "numbers": "the same but for rounding", "differs": "differs"} | {
    "not judged": "other bytes, not judged", "missing": "is not written any more", "new": "is not there"
}  # fmt: skip


@command("tpjb rerun tpjb-identify-out/run.json", "tpjb rerun tpjb-compare-out --out again")
def rerun(c: Command, record: Path, tolerance: float = 1e-6) -> None:
    """Compute the same again and say what differs.

    With the options and inputs that run.json names, into a temporary folder: tables and documents are compared number
    by number, pictures and pages by their bytes. Exit code 0 where nothing beyond the tolerance differs, 3 where
    something does, 2 where an input is gone or changed. With --out, rerun.json lists every file.
    """
    from typer.main import get_command

    from tpjb_ident.cli.commands.app import app
    from tpjb_ident.runtime.differences import compared

    group: Any = get_command(app)
    folder = record if record.is_dir() else record.parent
    if not record.is_dir() and record.name != RECORD:
        raise BadInputError(f"{record}: is no {RECORD}. Give that of an output folder, or the folder.")
    repeated = {}
    for name, entry in recorded(folder).items():
        if name.split(" ")[0] not in _REPEATABLE:
            c.note(f"{name} is not repeated")
            continue
        repeated[name] = entry
        for source in files_of(folder, name, entry, ()):
            if source["role"] == "input" and source["state"] != "same":
                place = f"{folder}: input {source['file']} of {name}"
                raise BadInputError(f"{place} {STATES[source['state']]}. Bring it back to where it was.")
    if not repeated:
        raise BadInputError(f"{record}: names no command that can be repeated ({', '.join(_REPEATABLE)}).")
    pairs = []
    with tempfile.TemporaryDirectory(prefix="tpjb-rerun-") as scratch:
        for number, (name, entry) in enumerate(repeated.items()):
            again = Path(scratch) / str(number)
            c.doing(f"{name} again")
            program = group.commands[name.split(" ")[0]]
            typed = [f"--out={again}", "--quiet", *_typed(program.params, entry, folder)]
            try:
                code = program.main(typed, prog_name="tpjb", standalone_mode=False)
            except typer.Exit as end:
                code = end.exit_code
            except Exception as error:  # what the parser says of options that this version does not have
                raise BadInputError(f"{name}: cannot be repeated ({error}). Run it by hand.") from error
            if code not in (None, 0, 3):
                raise TpjbError(f"{name}: ended with exit code {code}, see above; nothing was compared.")
            for file in outputs_of(entry):
                if reason := contradiction(folder / file):
                    c.warn(f"{folder / file}: {reason}")
                pairs.append((name, compared(folder, again, file, tolerance)))
    different = [f"{d.file} {_WORDS[d.state]} {d.where}".strip() for _, d in pairs if d.matters]
    count = f"{len(different)} of {len(pairs)} files differ" if different else f"{len(pairs)} files: nothing differs"
    c.print(f"{folder}: {count} by more than {tolerance:g}.")
    c.next("verify", folder)
    rows = [[name, d.file, _WORDS[d.state], f"{d.size:.1e}" if d.size else "-"] for name, d in pairs]
    c.show(f"{folder}: computed again", [*words("command", "file", "state"), "largest difference"], rows)
    if c.out is not None:
        files = [{"command": name, **vars(difference)} for name, difference in pairs]
        with c.results():
            c.json("rerun.json", {"schema": "tpjb-rerun/1", "folder": folder.name, "files": files})
    if different:
        raise NotTrustedError(f"{folder}: {len(different)} of {len(pairs)} files:\n{listed(different, 8, chr(10))}")


def _typed(parameters: Iterable[Any], entry: Mapping[str, Any], folder: Path) -> list[str]:
    """Words of a command line from the options of an entry; files by their place."""
    options, places = entry.get("options"), texts_of(entry, "inputs_at")
    if not isinstance(options, dict):
        raise BadInputError(f"{folder / RECORD}: names no options. It was written by an older version: run it by hand.")
    flags, arguments = [], []
    for parameter in parameters:
        if parameter.name in _OURS:
            continue
        option = options.get(parameter.name)
        files = [str(folder / place) for key, place in places.items() if key.partition(".")[0] == parameter.name]
        values = option if isinstance(option, list) else [option]
        for value in files or values:
            if isinstance(value, bool):
                flags += (parameter.opts if value else parameter.secondary_opts)[:1]
            elif value is not None and parameter.param_type_name == "argument":
                arguments.append(str(value))
            elif value is not None:
                flags.append(f"{parameter.opts[0]}={value}")
    return [*flags, "--", *arguments]
