"""run.json: what was run, with which settings and versions, on which bytes."""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tpjb_ident.cli.outdir import RECORD, former_runs
from tpjb_ident.cli.voice import voice
from tpjb_ident.provenance import versions
from tpjb_ident.tables import write_text


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

    Parameters
    ----------
    staging : Path
        What `output_folder` gave; its files are listed as the outputs.
    target : Path
        The final folder, whose former run.json is carried on.
    command : str
    settings : mapping
        Options as they were used.
    inputs : mapping of str to str
        SHA-256 by file name.
    remarks : sequence of str
        What the command has to say about its results.

    Returns
    -------
    dict
        The command's entry.
    """
    outputs = sorted(p.relative_to(staging).as_posix() for p in staging.rglob("*") if p.is_file())
    entry = {
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "settings": {name: _plain(value) for name, value in settings.items()},
        "versions": versions(),
        "inputs_sha256": dict(inputs),
        "outputs": outputs,
        **({"remarks": list(remarks)} if remarks else {}),
    }
    commands = {**former_runs(target), command: entry}
    text = json.dumps({"schema": "tpjb-run/1", "commands": commands}, indent=1, ensure_ascii=False) + "\n"
    write_text(staging / RECORD, text)
    voice().wrote(target, outputs)
    return entry


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return value.name  # where it lay is of no use elsewhere; its SHA-256 says what it was
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)
