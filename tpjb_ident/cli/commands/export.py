"""`tpjb export`: coefficients in the form that rotordynamic programs read."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_campaign
from tpjb_ident.cli.common.options import Method, Norm, Out, one_of, out_folder
from tpjb_ident.cli.common.record import write_record
from tpjb_ident.cli.common.terminal import note_line, progress, say
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256

if TYPE_CHECKING:
    import pandas as pd

FORMATS = ("ross", "csv", "parquet", "excel", "mat", "xltrc", "dyrobes", "ansys")
TABLES = ("coefficients.csv", "prediction.csv")
Source = Annotated[
    Path,
    typer.Argument(metavar="CAMPAIGN|DIR", help="A campaign (identified first), or results of identify or predict."),
]


@guarded
def export(
    source: Source,
    to: Annotated[str, typer.Option("--to", help=f"{', '.join(FORMATS)}.", autocompletion=one_of(*FORMATS))],
    method: Method = "mm-eiv",
    norm: Norm = None,
    out: Out = None,
) -> None:
    """Write coefficients as other programs read them.

    ROSS bearing elements (one TOML file per static point), tables (CSV, Parquet, Excel), a MATLAB file, or text over
    shaft speed for XLTRC, Dyrobes and ANSYS (one file per load and excitation frequency).
    """
    from tpjb_ident.export import WRITERS, static_points

    if to not in WRITERS:
        near = difflib.get_close_matches(to, WRITERS, n=1)
        hint = f"Did you mean {near[0]!r}?" if near else f"Use one of {', '.join(WRITERS)}."
        raise BadInputError(f"--to: {to!r} is not known. {hint}")
    frame, name, inputs = _coefficients(source, method, norm)
    points, left_out = static_points(frame)
    target = out_folder(out, "export")
    with output_folder(target, f"export {to}", (source,) if not _result_table(source) else ()) as folder:
        WRITERS[to](folder, points, f"tpjb-ident: coefficients of {name}")
        options = {"source": source, "to": to, "method": method, "norm": norm}
        write_record(folder, target, f"export {to}", options, inputs)
    say(f"{len(points)} static points, {sum(len(p.frequency) for p in points)} coefficient sets")
    say(f"Results: {target}")
    if to == "ross":
        note_line("note", "ROSS extrapolates outside the frequencies given; K holds Re h, the masses are zero.")
    if to in ("xltrc", "dyrobes", "ansys"):
        note_line("note", "these programs know K and C over shaft speed only: one file per excitation frequency.")
    if left_out:
        raise NotTrustedError(f"left out, because their coefficients are not finite: {'; '.join(left_out[:5])}")


def _result_table(source: Path) -> Path | None:
    """Find the table in an output folder of tpjb; None if `source` is not one."""
    if source.is_file() and source.suffix == ".csv":
        return source
    found = [source / name for name in TABLES if (source / name).is_file()]
    return found[0] if found else None


def _coefficients(source: Path, method: str, norm: str | None) -> tuple[pd.DataFrame, str, dict[str, str]]:
    path = _result_table(source)
    if path is not None:
        import pandas as pd

        try:
            frame = pd.read_csv(path)
        except (ValueError, UnicodeDecodeError) as error:  # pandas' own errors are ValueErrors
            raise BadInputError(f"{path}: is no table ({error}). Give the results of tpjb identify.") from error
        return frame, path.parent.resolve().name, {path.name: sha256(path)}
    from tpjb_ident.cli.commands.identify import identify_settings
    from tpjb_ident.dynamic.identify import identify as run_identification

    campaign = open_campaign(source)
    settings = identify_settings(campaign, method, norm)
    with progress("identifying") as show:
        result = run_identification(campaign, settings, show)
    return result.to_frame(), campaign.id, campaign.fingerprint()
