"""`tpjb verify`: whether results are still what was computed, and their inputs still the same bytes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import campaign_place, refuse_special
from tpjb_ident.cli.common.options import Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import note_line, print_line, table
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.output_folder import READY, RECORD, former_runs, output_folder, outputs_of
from tpjb_ident.runtime.provenance import sha256, versions
from tpjb_ident.runtime.tables import write_text

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Output folder of tpjb commands, with its run.json.")]
Inputs = Annotated[
    list[Path] | None,
    typer.Option("--input", metavar="PATH", help="Campaign or file the results came from, if moved; repeatable."),
]
State = Literal["same", "changed", "missing", "not found", "not recorded"]


@dataclass(frozen=True)
class Checked:
    """One file held against its recorded fingerprint."""

    command: str
    role: Literal["result", "input"]
    file: str
    state: State


@guarded
def verify(results: Folder, given: Inputs = None, out: Out = None) -> None:
    """Check a result folder against its SHA-256 record.

    Exit code 0 if all are the same bytes as when the command ended, 3 if a result or an input differs or a result is
    missing, 2 if that cannot be told: no record, or inputs that are not where they were (give --input). Writes nothing
    but, with --out, verify.json.
    """
    entries = recorded(results)
    for path in given or ():
        refuse_special(path)
        if not path.exists():
            raise BadInputError(f"--input {path}: no such file or folder. Check the path.")
    checked = [one for command, entry in entries.items() for one in _check_entry(results, command, entry, given or ())]
    _show_checked(results, entries, checked)
    if out is not None:
        _write_checked(out_folder(out, "verify"), results, checked)
    judge(results, checked)


def recorded(results: Path) -> dict[str, dict[str, Any]]:
    """Entries of run.json by command."""
    if not results.is_dir():
        raise BadInputError(f"{results}: is no folder. Give an output folder of tpjb, with its {RECORD}.")
    if (results / READY).is_dir():
        raise NotTrustedError(f"{results}: a command was killed while its results moved in. Run it again into it.")
    entries = former_runs(results)
    if not entries:
        raise BadInputError(f"{results}: has no {RECORD} that can be read. Give an output folder of tpjb commands.")
    return entries


def _check_entry(results: Path, command: str, entry: dict[str, Any], given: Sequence[Path]) -> Iterator[Checked]:
    """Hold the files of one command against its entry."""
    marks = _texts(entry.get("outputs_sha256"))
    for name in outputs_of(entry):
        yield Checked(command, "result", name, _state([results], name, marks.get(name), "missing"))
    places = given or [results / place for place in _texts(entry.get("inputs_at")).values()]
    folders = list(dict.fromkeys(folder for place in places for folder in _folders(place)))
    for name, mark in _texts(entry.get("inputs_sha256")).items():
        if mark == "missing":  # it was not there then either
            continue
        yield Checked(command, "input", name, _state(folders, name, mark, "not found"))


def _texts(table_of: Any) -> dict[str, str]:
    if not isinstance(table_of, dict):
        return {}
    return {k: v for k, v in table_of.items() if isinstance(v, str)}


def _folders(place: Path) -> list[Path]:
    """Folders in which files named by a record may lie, for one path that a command was given."""
    if place.is_dir():
        inner = campaign_place(place)
        return [place] if inner == place else [inner if inner.is_dir() else inner.parent, place]
    return [place.parent]


def _state(folders: Sequence[Path], name: str, mark: str | None, absent: State) -> State:
    """Compare the files of this name; one that is the same is enough, since two inputs may share a name."""
    from rigdata.problem import RigDataError
    from rigdata.safe_path import inside

    if mark is None:
        return "not recorded"
    state = absent
    for folder in folders:
        try:
            path = inside(folder, name, RECORD, "")
        except RigDataError:  # a name that leaves the folder: a record that tpjb did not write
            continue
        if path.is_file():
            if sha256(path) == mark:
                return "same"
            state = "changed"
    return state


def _show_checked(results: Path, entries: dict[str, dict[str, Any]], checked: Sequence[Checked]) -> None:
    """Print counts per command, what differs by name, and which versions are others now."""
    rows = []
    for command, entry in entries.items():
        mine = [one for one in checked if one.command == command]
        cells = []
        for role in ("result", "input"):
            count = [one.state == "same" for one in mine if one.role == role]
            cells.append(f"{sum(count)} of {len(count)}")
        rows.append([command, str(entry.get("finished", "")), *cells])
    table(f"{results}: unchanged files", ["command", "finished", "results", "inputs"], rows, words=(0, 1))
    for one in checked:
        if one.state != "same":
            print_line(f"{one.command}: {one.role} {one.file} {_WORDS[one.state]}")
    now = versions()
    for command, entry in entries.items():
        then = _texts(entry.get("versions"))
        others = [f"{name} {then[name]} (now {now[name]})" for name in now if then.get(name, now[name]) != now[name]]
        if others:
            note_line("note", f"{command} was computed with {', '.join(others)}")


_WORDS: dict[State, str] = {
    "changed": "is not what it was",
    "missing": "is missing",
    "not found": "is not where it was",
    "not recorded": "has no recorded SHA-256",
    "same": "is the same",
}


def _write_checked(target: Path, results: Path, checked: Sequence[Checked]) -> None:
    """Write verify.json."""
    with output_folder(target, "verify") as folder:
        answer = {"schema": "tpjb-verify/1", "folder": results.name, "files": [asdict(one) for one in checked]}
        write_text(folder / "verify.json", json.dumps(answer, indent=1, ensure_ascii=False) + "\n")
        write_record(folder, target, "verify", {"results": results}, {})


def judge(results: Path, checked: Sequence[Checked]) -> None:
    """Turn the states into the command's end."""
    differing = [one.file for one in checked if one.state in ("changed", "missing")]
    if differing:
        more = f" and {len(differing) - 5} more" if len(differing) > 5 else ""
        raise NotTrustedError(
            f"{results}: not as it was computed: {', '.join(differing[:5])}{more}. Run the command again."
        )
    unseen = [one for one in checked if one.state == "not found"]
    if unseen:
        raise BadInputError(
            f"{results}: the results are unchanged, but {len(unseen)} inputs ({unseen[0].file}, ..) are not where they "
            "were. Give --input PATH of the campaign."
        )
    if any(one.state == "not recorded" for one in checked):
        raise BadInputError(f"{results}: was written by a version that recorded no SHA-256 of results. Run it again.")
    print_line("All results and inputs are the same bytes as when the commands ended.")
