"""The output folder of a command: written whole or not at all, and never among somebody's raw data."""

from __future__ import annotations

import contextlib
import json
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tpjb_ident.cli.errors import BadInputError

RECORD = "run.json"


@contextlib.contextmanager
def output_folder(out: Path, command: str, inputs: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Give a temporary folder to fill; move its content to `out` when the block ends well.

    Parameters
    ----------
    out : Path
        Where the results shall be. Made if missing. In an existing folder only files that a former run of tpjb
        wrote are replaced.
    command : str
        Name of the command, the key of its entry in run.json.
    inputs : tuple of Path
        Campaigns and files that were read; `out` must not lie among them.

    Yields
    ------
    Path
        The temporary folder, beside `out`.

    Raises
    ------
    BadInputError
        `out` is a file, lies in a campaign, or holds files of the same names that tpjb did not write.
    """
    target = _checked(out, inputs)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.part-"))
    except OSError as error:
        raise BadInputError(f"--out {out}: cannot be made ({error.strerror or error}). Give another folder.") from error
    try:
        yield staging
        staging.chmod(0o755)
        if target.exists():
            _merge(staging, target, command)
        else:
            staging.rename(target)
    finally:
        if staging.exists():
            shutil.rmtree(staging)


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


def former_runs(folder: Path) -> dict[str, dict]:
    """Return what run.json of an output folder tells, by command; empty if there is none."""
    try:
        data = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(data, dict) or data.get("schema") != "tpjb-run/1":
        return {}
    return {k: v for k, v in data.get("commands", {}).items() if isinstance(v, dict)}


def _merge(staging: Path, target: Path, command: str) -> None:
    """Move file by file into an existing folder; drop what the same command left there before."""
    new = sorted(p.relative_to(staging).as_posix() for p in staging.rglob("*") if p.is_file())
    before = former_runs(target)
    ours = {name for entry in before.values() for name in entry.get("outputs", ())} | {RECORD}
    foreign = [name for name in new if (target / name).exists() and name not in ours]
    if foreign:
        raise BadInputError(
            f"--out {target}: already holds {', '.join(foreign[:3])}, which tpjb did not write there. "
            "Give another folder or move the file."
        )
    for name in new:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (staging / name).replace(target / name)
    for name in set(before.get(command, {}).get("outputs", ())) - set(new):
        stale = (target / name).resolve()
        if target in stale.parents:
            stale.unlink(missing_ok=True)
