"""Files of TOML from a stranger: read and parsed, or refused with a `ModelError` of their kind."""

from pathlib import Path
from typing import Any

from model.errors import ModelError
from rigdata.problem import parse_toml


def read_page(path: Path, refuse: type[ModelError], kind: str, missing: str, megabytes: int = 1) -> str:
    """Text of a file, refused by name where there is none, where it is no page of its kind, or cannot be read."""
    try:
        if path.stat().st_size <= 1_000_000 * megabytes:
            return path.read_text(encoding="utf-8-sig")
    except (FileNotFoundError, IsADirectoryError) as error:
        fault = "is a folder" if path.is_dir() else "no such file"
        raise refuse(f"{path}: {fault}. {missing}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise refuse(f"{path}: cannot be read ({error}). Give a file of UTF-8 text.") from error
    raise refuse(f"{path.name}: larger than {megabytes} MB. {kind}; check the path.")


def read_table(text: str, place: str, schema: str, refuse: type[ModelError]) -> dict[str, Any]:
    """Parse the text of a file of a schema, or refuse it by the name of its place."""
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise refuse(f"{place}: cannot be read, not valid TOML: {error}. Mend that line.") from error
    version = data.get("schema", schema)
    if version != schema:
        raise refuse(f"{place}, schema: {version!r} is not known. This version reads {schema!r}.")
    return data
