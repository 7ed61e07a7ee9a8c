"""`tpjb export`: coefficients in the form that rotordynamic programs read."""

from pathlib import Path
from typing import Any

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import identified
from tpjb_ident.errors import NotTrustedError
from tpjb_ident.exports.formats import FORMATS, check_format
from tpjb_ident.rounding import counted, listed


@command(
    "tpjb export tpjb-identify-out --to ross",
    "tpjb export tpjb-predict-out --to excel",
    "tpjb export bearing.toml --to ross",
    "tpjb export {DEMO} --to mat",
)
def export(
    c: Command,
    source: Path,
    to: str,
    method: str = "mm-eiv",
    norm: str | None = None,
    force: bool = False,
    ross: int | None = None,
) -> None:
    """Write coefficients as other programs read them.

    ROSS elements (TOML), tables (CSV, Parquet, Excel), a MATLAB file, or text over speed for XLTRC, Dyrobes and ANSYS.
    With --units us the text is in lbf and in; tables stay SI, with one in US units beside them; ROSS takes SI alone.
    Where a form holds no intervals and flags, bearing_coefficients_intervals.csv beside it does. Points that are not
    to be trusted stay behind (exit code 3).
    """
    from tpjb_ident.exports.write import export as write_export

    check_format(to)
    coefficients, name = _coefficients(c, source)
    with c.results(entry=f"export {to}"):
        written = write_export(coefficients, to, c.folder, force=force, name=name, ross=ross)
        c.remarks = written.chosen.doubtful
    c.print(f"{written}: {listed(written.files, 4)}")
    c.next("verify", c.target)
    if FORMATS[to]:
        c.note(FORMATS[to])
    parts = []
    if left_out := written.chosen.left_out:
        parts.append(f"left out, because their coefficients are not finite: {listed(left_out, between='; ')}")
    if doubtful := written.chosen.doubtful:
        action = "written because of --force, marked" if force else "left out (--force writes them, marked)"
        parts += [f"{counted(len(doubtful), 'point')}, {action}:", listed(doubtful, between="\n")]
    if parts:
        raise NotTrustedError("\n".join(parts))


def _coefficients(c: Command, source: Path) -> tuple[Any, str]:
    """What is exported, a file of coefficients, a campaign identified for it or a bearing, and its name."""
    if source.suffix == ".toml" and source.is_file() and b"tpjb-rig/" not in source.read_bytes():
        return c.bearing(source), source.stem
    from tpjb_ident.exports.write import result_table

    path = result_table(source)
    if path is not None:
        return c.file(path), path.parent.resolve().name
    campaign = c.open(source)
    return identified(c, campaign), campaign.id
