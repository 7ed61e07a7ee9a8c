"""File names of records: which suffix which reader takes."""

from __future__ import annotations

from pathlib import Path

from rigdata.near_names import nearest_name

#: Text in any national spelling.
TEXT = (".csv", ".txt", ".asc", ".dat", ".tsv")
#: Suffix -> module of `rigdata.readers`, extra that brings its library.
FORMATS = {
    ".tdms": ("formats.tdms", "tdms"),
    ".lvm": ("text.lvm", ""),
    ".uff": ("formats.uff58", "uff"),
    ".unv": ("formats.uff58", "uff"),
    ".58": ("formats.uff58", "uff"),
    ".mf4": ("formats.mdf4", "mdf"),
    ".mdf": ("formats.mdf4", "mdf"),
    ".mat": ("formats.mat", ""),
    ".parquet": ("formats.parquet", ""),
}
#: Suffixes of loggers and programs that write one of the known kinds on request.
_EXPORTABLE = {
    ".tdm": ".tdms or .csv", ".tdx": ".tdms or .csv", ".xlsx": ".csv", ".xls": ".csv", ".ods": ".csv", ".bin": ".csv",
    ".dxd": ".mat or .csv", ".d7d": ".mat or .csv", ".ltd": ".uff", ".lms": ".uff", ".pro": ".uff",
    ".wav": ".csv", ".npy": ".csv", ".npz": ".csv", ".rec": ".csv", ".sie": ".csv", ".tst": ".csv",
}  # fmt: skip


def suffix_hint(path: Path) -> str:
    """What to do about a suffix that no reader is known by; "" where it is known.

    Parameters
    ----------
    path : Path
        Of a record, or of what was taken for one.
    """
    suffix = path.suffix.lower()
    known = (*TEXT, *FORMATS)
    if suffix in known:
        return ""
    if suffix in _EXPORTABLE:
        return f"{suffix} files are not read; export it as {_EXPORTABLE[suffix]}"
    near = nearest_name(suffix, known)
    hint = f"did you mean {near}?" if near else f"known are {', '.join(known)}"
    return f"the suffix {suffix or '(none)'} is not known; {hint}"
