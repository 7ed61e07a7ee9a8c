"""run.json: what was run, with which settings and versions, on which bytes."""

from __future__ import annotations

import contextlib
import datetime
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tpjb_ident.cli.common.output import command_output
from tpjb_ident.runtime.output_folder import RECORD, former_runs, record_text
from tpjb_ident.runtime.provenance import sha256, versions
from tpjb_ident.runtime.tables import write_text


def write_record(
    staging: Path,
    target: Path,
    command: str,
    settings: Mapping[str, Any],
    inputs: Mapping[str, str],
    remarks: Sequence[str] = (),
) -> dict[str, Any]:
    """Write run.json into the temporary folder of a command, last.

    Commands that share an output folder share its run.json: one entry each.
    """
    outputs = sorted(p.relative_to(staging).as_posix() for p in staging.rglob("*") if p.is_file())
    entry = {
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "settings": {name: _plain(value) for name, value in settings.items()},
        "versions": versions(),
        "inputs_sha256": dict(inputs),
        "outputs": outputs,
        "outputs_sha256": {name: sha256(staging / name) for name in outputs},
        "inputs_at": places(settings, target),
        **({"remarks": list(remarks)} if remarks else {}),
    }
    write_text(staging / RECORD, record_text({**former_runs(target), command: entry}))
    command_output().add_files(target, outputs)
    return entry


def places(settings: Mapping[str, Any], target: Path) -> dict[str, str]:
    """Where the files and folders among `settings` lie, as seen from the output folder; only those that exist."""
    found = {}
    for name, value in settings.items():
        if isinstance(value, Path) and value.exists():
            with contextlib.suppress(ValueError):  # another drive: there is no relative way
                found[name] = Path(os.path.relpath(value.resolve(), target.resolve())).as_posix()
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return value.name  # where it lay is of no use elsewhere; its SHA-256 says what it was
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)
