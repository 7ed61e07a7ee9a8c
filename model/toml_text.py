"""TOML from a stranger: parsed, or refused with a `ModelError` or tomllib's own before it can take long."""

import re
import tomllib
from pathlib import Path
from typing import Any

from model.errors import ModelError

#: Keys with more dots than this nest deeper than any file of ours; parsing them takes the square of their length.
MAX_DEPTH = 64
#: A step of a dotted key: a bare or quoted piece and its dot.
_STEP = re.compile(r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*""")


def read_page(path: Path, refuse: type[ModelError], kind: str, missing: str, megabytes: int = 1) -> str:
    """Text of a file, refused by name where there is none, where it is no page of its kind, or cannot be read."""
    try:
        if path.stat().st_size <= 1_000_000 * megabytes:
            return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise refuse(f"{path}: no such file. {missing}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise refuse(f"{path}: cannot be read ({error}). Save it as UTF-8 text.") from error
    raise refuse(f"{path.name}: larger than {megabytes} MB. {kind}; check the path.")


def read_table(text: str, place: str, schema: str, refuse: type[ModelError]) -> dict[str, Any]:
    """Parse the text of a file of a schema, or refuse it by the name of its place."""
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise refuse(f"{place}: cannot be read, not valid TOML: {error}. Mend that line.") from error
    found = data.get("schema", schema)
    if found != schema:
        raise refuse(f"{place}, schema: {found!r} is not known. This version reads {schema!r}.")
    return data


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML text."""
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") > MAX_DEPTH and not line.lstrip().startswith("#") and _longest_key(line) > MAX_DEPTH:
            raise ModelError(f"line {number} nests far too deeply")
    try:
        data = tomllib.loads(text)
    except RecursionError as error:
        raise ModelError("nested far too deeply") from error
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # Python refuses to read whole numbers of more than 4300 digits
        raise ModelError("a whole number has thousands of digits") from error
    _check_integers(data)
    return data


def _check_integers(data: dict[str, Any]) -> None:
    """Reject whole numbers that Python does not print: hexadecimal ones are read at any length."""
    values: list[Any] = [data]
    while values:
        value = values.pop()
        if isinstance(value, dict):
            values.extend(value.values())
        elif isinstance(value, list):
            values.extend(value)
        elif isinstance(value, int) and value.bit_length() > 13_000:
            raise ModelError("a whole number has thousands of digits")


def _longest_key(line: str) -> int:
    """Most dots of one dotted key in `line`."""
    longest = run = at = 0
    for step in _STEP.finditer(line):
        run = run + 1 if step.start() == at else 1
        at = step.end()
        longest = max(longest, run)
    return longest
