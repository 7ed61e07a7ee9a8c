"""Moving finished results into a folder that already holds some: a kill on the way leaves nothing half done for good.

The whole set first takes the name `READY` inside the folder, in one step: from then on it will come in. Then run.json
goes, which vouches for what is there, then the files are moved, run.json last. What a kill leaves of it is finished by
the next command that writes there; `tpjb verify` tells of it.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

RECORD = "run.json"
#: A complete set of results inside the folder that it is about to be moved into.
READY = ".tpjb-moving-in"


def former_runs(folder: Path) -> dict[str, dict]:
    """Return what run.json of an output folder tells, by command; empty if there is none."""
    try:
        data = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(data, dict) or data.get("schema") != "tpjb-run/1" or not isinstance(data.get("commands"), dict):
        return {}
    return {k: v for k, v in data["commands"].items() if isinstance(v, dict)}


def record_text(commands: Mapping[str, Any]) -> str:
    """Text of run.json."""
    return json.dumps({"schema": "tpjb-run/1", "commands": dict(commands)}, indent=1, ensure_ascii=False) + "\n"


def move_in(staging: Path, target: Path, command: str) -> None:
    """Move results into an existing folder, whose lock the caller holds; drop what the command left there before."""
    finish_moving(target)
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
    finish_moving(target)


def finish_moving(target: Path) -> bool:
    """Bring in what waits in `READY`; whether there was anything."""
    ready = target / READY
    if not ready.is_dir():
        return False
    (target / RECORD).unlink(missing_ok=True)
    names = [name for name in files_in(ready) if name != ".stale"]
    for name in sorted(names, key=lambda n: n == RECORD):
        if name == RECORD:
            _drop_stale(target, ready, names)
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (ready / name).replace(target / name)
    flush(target, deep=False)
    shutil.rmtree(ready)
    return True


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
