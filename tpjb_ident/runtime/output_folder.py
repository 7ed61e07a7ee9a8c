"""The output folder of a command: written whole or not at all, and never among somebody's raw data."""

from __future__ import annotations

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

#: Full: the disk, the user's share of it, or the largest file that the system allows.
_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}


@contextlib.contextmanager
def output_folder(out: Path, command: str, inputs: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Give a temporary folder to fill; move its content to `out` when the block ends well."""
    target = _checked(out, inputs)
    staging = None
    try:
        with interrupts_held():  # a folder that has no name here yet would stay
            staging = _new_folder(target, out)
        with locked(staging):
            _clear_abandoned(target)
            yield staging
            staging.chmod(0o755)
            _bring(staging, target, command)
    except OSError as error:
        if error.errno is None or error.errno not in _FULL:
            raise
        why = os.strerror(error.errno)  # libraries wrap it into words of their own
        raise BadInputError(
            f"--out {out}: {why}; nothing was written. Make room on the disk or give a folder on another one."
        ) from error
    finally:
        with interrupts_held():
            if staging is not None and staging.exists():
                shutil.rmtree(staging)


def _new_folder(target: Path, out: Path) -> Path:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.part-"))
    except OSError as error:
        raise BadInputError(f"--out {out}: cannot be made ({error.strerror or error}). Give another folder.") from error


def _bring(staging: Path, target: Path, command: str) -> None:
    """Give the results their place: a new folder in one step, an existing one under its lock."""
    if not target.exists():
        flush(staging)
        with contextlib.suppress(OSError):  # another run has made it in this moment
            staging.rename(target)
            flush(target.parent, deep=False)
            return
    with locked(target):
        _move_in(staging, target, command)


def _clear_abandoned(target: Path) -> None:
    """Delete what killed runs into the same folder have left beside it."""
    for abandoned in target.parent.glob(f".{glob.escape(target.name)}.part-*") if fcntl is not None else ():
        with contextlib.suppress(OSError), locked(abandoned, wait=False):  # held by a run that is alive, or gone by now
            shutil.rmtree(abandoned, ignore_errors=True)  # whoever else clears it at the same time may be quicker


def _checked(out: Path, inputs: tuple[Path, ...]) -> Path:
    target = out.resolve()
    if target.exists() and not target.is_dir():
        raise BadInputError(f"--out {out}: is a file. Give a folder.")
    for folder in (target, *target.parents):
        if (folder / "campaign.toml").exists():
            raise BadInputError(f"--out {out}: {folder} holds a campaign's raw data. Give a folder outside it.")
    for source in inputs:
        real = source.resolve()
        if real.is_dir() and (target == real or real in target.parents):
            raise BadInputError(f"--out {out}: lies inside the campaign {source}, whose raw data stays untouched. "
                           "Give a folder outside it.")  # fmt: skip
    return target


RECORD = "run.json"
#: A complete set of results inside the folder that it is about to be moved into.
READY = ".tpjb-moving-in"


def former_runs(folder: Path) -> dict[str, dict]:
    """Return what run.json of an output folder tells, by command; empty if there is none."""
    try:
        commands = read_document(folder / RECORD, "tpjb-run").get("commands")
    except BadInputError:
        return {}
    return {k: v for k, v in commands.items() if isinstance(v, dict)} if isinstance(commands, dict) else {}


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
    tables = [entry.get("outputs_sha256") for entry in entries.values()]
    recorded = {table[path.name] for table in tables if isinstance(table, dict) and path.name in table}
    if recorded and path.is_file() and sha256(path) not in recorded:
        return f"is not what was computed (its SHA-256 is not that of {RECORD})"
    return ""


def record_text(commands: Mapping[str, Any]) -> str:
    """Text of run.json."""
    document = {"schema": schema("tpjb-run"), "commands": dict(commands)}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _move_in(staging: Path, target: Path, command: str) -> None:
    """Move results into an existing folder, whose lock the caller holds; drop what the command left there before."""
    _finish_moving(target)
    new = files_in(staging)
    before = former_runs(target)
    ours = {name for entry in before.values() for name in outputs_of(entry)} | {RECORD}
    foreign = [name for name in new if (target / name).exists() and name not in ours]
    if foreign:
        raise BadInputError(
            f"--out {target}: already holds {', '.join(foreign[:3])}, which tpjb did not write there. "
            "Give another folder or move the file."
        )
    mine = former_runs(staging).get(command)
    if mine is not None:  # another command may have ended here since this one began
        stale = sorted(set(outputs_of(before.get(command, {}))) - set(new))
        write_text(staging / RECORD, record_text({**before, command: mine}))
        write_text(staging / ".stale", json.dumps(stale))
    flush(staging)
    staging.replace(target / READY)
    _finish_moving(target)


def _finish_moving(target: Path) -> None:
    """Bring in what waits in `READY`, if anything does."""
    ready = target / READY
    if not ready.is_dir():
        return
    (target / RECORD).unlink(missing_ok=True)
    names = [name for name in files_in(ready) if name != ".stale"]
    for name in sorted(names, key=lambda n: n == RECORD):
        if name == RECORD:
            _drop_stale(target, ready, names)
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (ready / name).replace(target / name)
    flush(target, deep=False)
    shutil.rmtree(ready)


def _drop_stale(target: Path, ready: Path, new: list[str]) -> None:
    """Delete what the same command had written and no longer writes; never outside the folder."""
    try:
        stale = json.loads((ready / ".stale").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    for name in stale:
        old = (target / str(name)).resolve()
        if target in old.parents and name not in new:
            old.unlink(missing_ok=True)


def outputs_of(entry: Mapping[str, Any]) -> list[str]:
    """Files that an entry of run.json lists."""
    outputs = entry.get("outputs", ())
    return [name for name in outputs if isinstance(name, str)] if isinstance(outputs, list) else []


def files_in(folder: Path) -> list[str]:
    """Relative names of all files, sorted."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def flush(folder: Path, deep: bool = True) -> None:
    """Have the system write a folder, and with `deep` its files, to the disk, so that a power cut loses nothing."""
    if os.name != "posix":
        return
    paths = [folder, *(folder.rglob("*") if deep else ())]
    for path in paths:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


try:
    import fcntl
except ImportError:  # Windows: no advisory locks on folders; two runs into one folder then rely on renames alone
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def locked(folder: Path, wait: bool = True) -> Iterator[None]:
    """Hold the lock of `folder` while the block runs; wait for whoever has it, or raise OSError."""
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except OSError:
            if not wait:
                raise  # else: a file system without locks, as some network shares
        yield
    finally:
        os.close(handle)
