"""The output folder of a command: written whole or not at all, and never among somebody's raw data."""

import contextlib
import errno
import glob
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.interrupts import interrupts_held
from tpjb_ident.runtime.provenance import read_document, schema, sha256
from tpjb_ident.runtime.tables import write_text

try:
    import fcntl
except ImportError:  # Windows: no advisory locks on folders; two runs into one folder then rely on renames alone
    fcntl = None  # type: ignore[assignment]

#: Full: the disk, the user's share of it, or the largest file that the system allows.
_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
RECORD = "run.json"
#: A complete set of results inside the folder that it is about to be moved into, and the files that go in exchange.
READY, _STALE = ".tpjb-moving-in", ".stale"


@contextlib.contextmanager
def output_folder(out: Path, command: str, inputs: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Give a temporary folder to fill; move its content to `out` when the block ends well."""
    target = _checked(out, inputs)
    staging = None
    try:
        with contextlib.ExitStack() as locks:
            while staging is None or not staging.exists():  # before it is locked, another run may take it for abandoned
                with interrupts_held():  # a folder that has no name here yet would stay
                    staging = _new_folder(target, out)
                with contextlib.suppress(FileNotFoundError):
                    locks.enter_context(locked(staging))
            # what killed runs into the same folder have left beside it goes
            for abandoned in target.parent.glob(f".{glob.escape(target.name)}.part-*") if fcntl is not None else ():
                # held by a run that is alive, or gone by now; whoever else clears it at the same time may be quicker
                with contextlib.suppress(OSError), locked(abandoned, wait=False):
                    shutil.rmtree(abandoned, ignore_errors=True)
            yield staging
            staging.chmod(0o755)
            flush(staging)
            _bring(staging, target, command)
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise BadInputError(
            f"--out {out}: {os.strerror(error.errno or 0)}; nothing was written. "
            "Make room on the disk or give a folder on another one."
        ) from error
    finally:
        with interrupts_held():
            if staging is not None and staging.exists():
                shutil.rmtree(staging)


def _checked(out: Path, inputs: tuple[Path, ...]) -> Path:
    """The folder, resolved; refused where it lies among raw data."""
    target = out.resolve()
    if target.exists() and not target.is_dir():
        raise BadInputError(f"--out {out}: is a file. Give a folder.")
    folders = {source.resolve() for source in inputs if source.is_dir()}
    for folder in (target, *target.parents):
        if folder in folders or (folder / "campaign.toml").exists():
            raise BadInputError(
                f"--out {out}: {folder} holds a campaign's raw data, which stays untouched. Give a folder outside it."
            )
    return target


def _new_folder(target: Path, out: Path) -> Path:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.part-"))
    except OSError as error:
        raise BadInputError(f"--out {out}: cannot be made ({error.strerror or error}). Give another folder.") from error


def _bring(staging: Path, target: Path, command: str) -> None:
    """Give the results their place: a new folder in one step, an existing one under its lock."""
    if not target.exists():
        with contextlib.suppress(OSError):  # another run has made it in this moment
            staging.rename(target)
            flush(target.parent, deep=False)
            return
    with locked(target):
        _finish_moving(target)
        _join_records(staging, target, command)
        flush(staging)
        staging.replace(target / READY)
        _finish_moving(target)


def _join_records(staging: Path, target: Path, command: str) -> None:
    """Have run.json tell of the folder's other commands too, an entry each, and note what this one no longer writes."""
    new, before = files_in(staging), former_runs(target)
    ours = {RECORD}
    for entry in before.values():
        ours.update(outputs_of(entry))
    foreign = [name for name in new if (target / name).exists() and name not in ours]
    if foreign:
        raise BadInputError(
            f"--out {target}: already holds {', '.join(foreign[:3])}, which tpjb did not write there. "
            "Give another folder or move the file."
        )
    stale = sorted(set(outputs_of(before.get(command, {}))) - set(new))
    write_text(staging / RECORD, record_text(before | former_runs(staging)))
    write_text(staging / _STALE, json.dumps(stale))


def _finish_moving(target: Path) -> None:
    """Bring in what waits in `READY`, if anything does; its run.json last, once nothing former is left."""
    ready = target / READY
    if not ready.is_dir():
        return
    if (ready / RECORD).exists():
        (target / RECORD).unlink(missing_ok=True)
    for name in files_in(ready):
        if name not in (RECORD, _STALE):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (ready / name).replace(target / name)
    if (ready / RECORD).exists():
        for name in json.loads((ready / _STALE).read_text("utf-8")):
            former = (target / name).resolve()
            if target in former.parents:  # never outside the folder
                former.unlink(missing_ok=True)
        (ready / RECORD).replace(target / RECORD)
    flush(target, deep=False)
    shutil.rmtree(ready)


def former_runs(folder: Path) -> dict[str, dict]:
    """Return what run.json of an output folder tells, by command; empty if there is none."""
    try:
        commands = read_document(folder / RECORD, "tpjb-run").get("commands")
    except BadInputError:
        return {}
    return _of_kind(commands, dict)


def contradiction(path: Path) -> str:
    """What run.json beside a file says against it: it is not what was computed. "" where there is no record of it."""
    folder = path.parent
    if (folder / READY).is_dir():
        return "a command was killed while its results moved in"
    if path.name == RECORD or not (folder / RECORD).exists():
        return ""
    entries = former_runs(folder)
    if not entries:
        return f"{RECORD} beside it cannot be read"
    recorded = {texts_of(entry, "outputs_sha256").get(path.name) for entry in entries.values()} - {None}
    if recorded and path.is_file() and sha256(path) not in recorded:
        return f"is not what was computed (its SHA-256 is not that of {RECORD})"
    return ""


def record_text(commands: Mapping[str, Any]) -> str:
    """Text of run.json."""
    document = {"schema": schema("tpjb-run"), "commands": dict(commands)}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def outputs_of(entry: Mapping[str, Any]) -> list[str]:
    """Files that an entry of run.json lists."""
    outputs = entry.get("outputs", ())
    return [name for name in outputs if isinstance(name, str)] if isinstance(outputs, list) else []


def texts_of(entry: Mapping[str, Any], name: str) -> dict[str, str]:
    """Texts by name in a table of an entry of run.json, whoever wrote it."""
    return _of_kind(entry.get(name), str)


def _of_kind(table: Any, kind: type) -> dict[str, Any]:
    """Entries of a table that are of a kind; none of what is no table."""
    return {k: v for k, v in table.items() if isinstance(v, kind)} if isinstance(table, dict) else {}


def files_in(folder: Path) -> list[str]:
    """Relative names of all files, sorted."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def flush(folder: Path, deep: bool = True) -> None:
    """Have the system write a folder, and with `deep` its files, to the disk, so that a power cut loses nothing."""
    for path in [folder, *(folder.rglob("*") if deep else ())] if os.name == "posix" else ():
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextlib.contextmanager
def locked(folder: Path, wait: bool = True) -> Iterator[None]:
    """Hold the lock of `folder` while the block runs; wait for whoever has it, or raise OSError."""
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        # where it waits, an error is of a file system without locks, as some network shares
        with contextlib.suppress(*((OSError,) if wait else ())):
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(handle)
