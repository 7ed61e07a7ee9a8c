"""`tpjb export`: coefficients in the form that rotordynamic programs read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_campaign
from tpjb_ident.cli.common.options import Method, Norm, Out, one_of, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import note_line, print_line, progress
from tpjb_ident.errors import NotTrustedError
from tpjb_ident.exports.formats import FORMATS, export_format
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.exports.formats import Chosen

Source = Annotated[
    Path,
    typer.Argument(metavar="CAMPAIGN|DIR", help="A campaign (identified first), or results of identify or predict."),
]
Force = Annotated[
    bool, typer.Option("--force", help="Also write points that are not to be trusted, marked; exit code 3 stays.")
]


@guarded
def export(
    source: Source,
    to: Annotated[str, typer.Option("--to", help=f"{', '.join(FORMATS)}.", autocompletion=one_of(*FORMATS))],
    method: Method = "mm-eiv",
    norm: Norm = None,
    force: Force = False,
    out: Out = None,
) -> None:
    """Write coefficients as other programs read them.

    With their intervals and flags: ROSS bearing elements (one TOML file per static point), tables (CSV,
    Parquet, Excel), a MATLAB file, or text over shaft speed for XLTRC, Dyrobes and ANSYS (one file per load and
    excitation frequency). Where the form holds no intervals and flags, bearing_coefficients_intervals.csv
    beside it does. Points that are not to be trusted stay behind (exit code 3).
    """
    from tpjb_ident.exports.write import export as write_export
    from tpjb_ident.exports.write import result_table

    form = export_format(to)
    frame, name, inputs = _coefficients(source, method, norm)
    target = out_folder(out, "export")
    with output_folder(target, f"export {to}", (source,) if not result_table(source) else ()) as folder:
        written = write_export(frame, to, folder, force=force, name=name)
        options = {"source": source, "to": to, "method": method, "norm": norm, "force": force}
        write_record(folder, target, f"export {to}", options, inputs, written.chosen.doubtful)
    print_line(str(written))
    print_line(f"Results: {target}")
    if form.note:
        note_line("note", form.note)
    _refuse_doubtful(written.chosen, force)


def _refuse_doubtful(chosen: Chosen, forced: bool) -> None:
    """End with exit code 3 if a point stayed behind, or left because that was forced."""
    parts = []
    if chosen.left_out:
        parts.append(f"left out, because their coefficients are not finite: {'; '.join(chosen.left_out[:5])}")
    if chosen.doubtful:
        what = "written because of --force, marked" if forced else "left out (--force writes them, marked)"
        more = [f"... and {len(chosen.doubtful) - 5} more"] if len(chosen.doubtful) > 5 else []
        parts.append("\n".join([f"{counted(len(chosen.doubtful), 'point')}, {what}:", *chosen.doubtful[:5], *more]))
    if parts:
        raise NotTrustedError("\n".join(parts))


def _coefficients(source: Path, method: str, norm: str | None) -> tuple[pd.DataFrame, str, dict[str, str]]:
    from tpjb_ident.exports.write import read_result_table, result_table

    path = result_table(source)
    if path is not None:
        return read_result_table(path), path.parent.resolve().name, {path.name: sha256(path)}
    from tpjb_ident.cli.commands.identify import identify_settings
    from tpjb_ident.dynamic.identify import identify as run_identification

    campaign = open_campaign(source)
    settings = identify_settings(campaign, method, norm)
    with progress("identifying") as show:
        result = run_identification(campaign, settings, show)
    return result.to_frame(), campaign.id, campaign.fingerprint()
