"""`tpjb verify`: whether results are still what was computed, and their inputs still the same bytes."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tpjb_ident.cli.command import Command, command, refuse_special
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.rounding import counted, listed
from tpjb_ident.runtime.output_folder import READY, RECORD, former_runs, outputs_of, texts_of
from tpjb_ident.runtime.provenance import sha256, versions

#: What may have become of a file since its SHA-256 was recorded.
STATES = {"same": "is the same", "differs": "is not what it was", "missing": "is missing"}


@command("tpjb verify tpjb-identify-out", "tpjb verify tpjb-identify-out --input campaigns/rocker-A")
def verify(c: Command, results: Path, given: list[Path] | None = None) -> None:
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
    files: list[dict[str, str]] = []
    for name, entry in entries.items():
        files += files_of(results, name, entry, given or ())
    if not files:
        raise BadInputError(f"{results}: {RECORD} names no results. Run the command again.")
    mismatches = [file for file in files if file["state"] != "same"]
    count = f"{len(files) - len(mismatches)} of {len(files)}" if mismatches else "all"
    c.print(f"{results}: {count} results and inputs are the same bytes as when the commands ended.")
    differing, missing = [], []
    for file in mismatches:
        c.print(f"{file['command']}: {file['role']} {file['file']} {STATES[file['state']]}")
        if (file["role"], file["state"]) == ("input", "missing"):
            missing.append(file["file"])
        else:
            differing.append(file["file"])
    for name, entry in entries.items():
        former = texts_of(entry, "versions")
        changed = [f"{key} {former[key]} (now {now})" for key, now in versions().items() if former.get(key, now) != now]
        if changed:
            c.note(f"{name} was computed with {', '.join(changed)}")
    c.next("rerun", results)
    if c.out is not None:
        c.options = {"results": results}
        with c.results():
            c.json("verify.json", {"schema": "tpjb-verify/1", "folder": results.name, "files": files})
    if differing:
        raise NotTrustedError(f"{results}: not as it was computed: {listed(differing)}. Run the command again.")
    if missing:
        raise BadInputError(
            f"{results}: the results are unchanged, but not where they were: {counted(len(missing), 'input')} "
            f"({listed(missing, 1)}). Give --input PATH of the campaign."
        )


def recorded(results: Path) -> dict[str, dict[str, Any]]:
    """Entries of run.json by command."""
    if not results.is_dir():
        raise BadInputError(f"{results}: is no folder. Give an output folder of tpjb, with its {RECORD}.")
    if (results / READY).is_dir():
        raise NotTrustedError(f"{results}: a command was killed while its results moved in. Run it again into it.")
    entries = former_runs(results)
    if not entries:
        raise BadInputError(f"{results}: has no {RECORD} that can be read. Give an output folder of tpjb commands.")
    for name, entry in entries.items():
        if set(outputs_of(entry)) - set(texts_of(entry, "outputs_sha256")):
            raise BadInputError(f"{results}: {RECORD} has no SHA-256 of every result of {name}. Run it again.")
    return entries


def files_of(results: Path, name: str, entry: Mapping[str, Any], inputs: Sequence[Path]) -> Iterator[dict[str, str]]:
    """Compare the files of one command with its entry: as verify.json lists them."""
    from rigdata.campaign import campaign_place

    hashes = texts_of(entry, "outputs_sha256")
    for file in outputs_of(entry):
        yield {"command": name, "role": "result", "file": file, "state": _state([results], file, hashes[file])}
    folders = []
    for place in inputs or [results / place for place in texts_of(entry, "inputs_at").values()]:
        inner = campaign_place(place)
        folders += [inner if inner.is_dir() else inner.parent, *([place] if place.is_dir() else ())]
    around = []
    for folder in folders:
        around += folder.resolve().parents
    for file, recorded_hash in texts_of(entry, "inputs_sha256").items():
        if recorded_hash != "missing":  # it was not there then either
            # its folder tells it from another file of its name
            state = _state([*folders, *(around if "/" in file else ())], file, recorded_hash)
            yield {"command": name, "role": "input", "file": file, "state": state}


def _state(folders: Iterable[Path], name: str, recorded_hash: str) -> str:
    """Compare the files of this name; one that is the same is enough, since two inputs may share a name."""
    from rigdata.campaign import inside
    from rigdata.problem import RigDataError

    state = "missing"
    for folder in folders:
        try:
            path = inside(folder, name, RECORD, "")
        except RigDataError:  # a name that leaves the folder: a record that tpjb did not write
            continue
        if path.is_file():
            if sha256(path) == recorded_hash:
                return "same"
            state = "differs"
    return state
