"""One export, from a table of coefficients to files: what may leave, in which form, with which intervals beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.columns import in_us_units
from tpjb_ident.errors import NotTrustedError
from tpjb_ident.exports import writers
from tpjb_ident.exports.formats import (
    ROSS_VERSIONS,
    ROTOR_PROGRAMS,
    Chosen,
    ExportError,
    check_format,
    chosen_rows,
    turning_counter_clockwise,
)
from tpjb_ident.runtime.output_folder import contradiction
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

#: Tables of an output folder that hold coefficients.
_RESULT_TABLES = ("coefficients.csv", "prediction.csv")


@dataclass(frozen=True)
class Export:
    """What an export wrote.

    Attributes
    ----------
    folder : Path
    files : tuple of str
        Names in it.
    chosen : Chosen
        The points, and those left out or doubtful.
    """

    folder: Path
    files: tuple[str, ...]
    chosen: Chosen

    def __str__(self) -> str:
        rows = self.chosen.table
        if rows is None:
            return "the bearing"
        return f"{rows.groupby(list(STATIC_KEY)).ngroups} static points, {len(rows)} coefficient sets"


def export(
    source: Any,
    to: str,
    folder: str | Path,
    *,
    force: bool = False,
    name: str = "",
    ross: int | None = None,
) -> Export:
    """Write coefficients as another program reads them, with intervals and flags in the files or beside them.

    A bearing leaves for ROSS as the Python call that builds it there.

    Parameters
    ----------
    source : Identification, Prediction, DataFrame, str, Path or Bearing
        What `identify` or `predict` gives, a table as they write it, its CSV file, or a folder that holds one.
    to : str
        ``"ross"``, ``"csv"``, ``"parquet"``, ``"excel"``, ``"mat"``, ``"xltrc"``, ``"dyrobes"`` or ``"ansys"``.
    folder : str or Path
        Made if need be.
    force : bool
        Also write points that are not to be trusted, marked as such.
    name : str
        What the coefficients are of, for the files' heads; default: known from the source.
    ross : int, optional
        Version of ROSS, 2 or 3, that the files are for; default: the one that is installed, else 3.

    Returns
    -------
    Export
        Its ``chosen.doubtful`` and ``chosen.left_out`` name the points that stayed behind.

    Raises
    ------
    ExportError
        Unknown format, or a table without the columns.
    NotTrustedError
        Nothing is left that can be trusted.
    """
    check_format(to)
    options = _ross_options(to, ross)
    target = Path(folder)
    if hasattr(source, "pads"):
        if to != "ross":
            raise ExportError(f"a bearing file leaves for ROSS alone, not for {to}. Export a prediction of it.")
        target.mkdir(parents=True, exist_ok=True)
        writers.write_ross_bearing(target, source, **options)
        return Export(target, ("ross_bearing.py",), Chosen())
    frame, origin = _table(source)
    chosen = chosen_rows(frame, force)
    rows = chosen.table
    if rows is None or rows.empty:
        reasons = "\n".join(chosen.doubtful[:5])
        raise NotTrustedError(f"no point can be trusted, nothing is exported:\n{reasons}\nBy force they leave, marked.")
    target.mkdir(parents=True, exist_ok=True)
    before = set(target.iterdir())
    _write(target, rows, to, f"tpjb-ident: coefficients of {name or origin}", options)
    files = sorted(path.name for path in set(target.iterdir()) - before)
    return Export(target, tuple(files), chosen)


def _write(target: Path, rows: pd.DataFrame, to: str, source: str, options: dict[str, int]) -> None:
    """Write rows in one form; intervals, and a table in US units, beside it."""
    table_name = writers.NAME
    if to in ROTOR_PROGRAMS:
        table_name = writers.INTERVALS
        rows = turning_counter_clockwise(rows)
        writers.write_csv(target, rows, "", table_name)
    getattr(writers, f"write_{to}")(target, rows, source, **options)
    if in_us_units():
        writers.write_us(target, rows, table_name)


def _ross_options(to: str, version: int | None) -> dict[str, int]:
    if version is None:
        return {}
    if to != "ross":
        raise ExportError(f"version {version} of ROSS belongs to the format ross, not to {to}. Leave it out.")
    if version not in ROSS_VERSIONS:
        raise ExportError(f"version {version} of ROSS is not known. Use {' or '.join(map(str, ROSS_VERSIONS))}.")
    return {"version": version}


def result_table(path: Path) -> Path | None:
    """Find the table of coefficients in an output folder of tpjb."""
    if path.is_file() and path.suffix == ".csv":
        return path
    return next((path / name for name in _RESULT_TABLES if (path / name).is_file()), None)


def _table(source: Any) -> tuple[pd.DataFrame, str]:
    if isinstance(source, (str, Path)):
        path = result_table(Path(source))
        if path is None:
            raise ExportError(f"{source}: holds neither {' nor '.join(_RESULT_TABLES)}. Give results of tpjb identify.")
        if reason := contradiction(path):
            raise ExportError(f"{path}: {reason}. Run the command again, or move the file out of its results.")
        return read_table(path), path.parent.resolve().name
    if hasattr(source, "to_dataframe"):  # of what identify and predict give
        return source.to_dataframe(), getattr(source, "campaign", "a prediction")
    if not hasattr(source, "columns"):
        raise ExportError(f"source: must be a result, a table or the path of one, got {type(source).__name__}.")
    return source, "a table"
