"""Every option and argument that can be typed, by command and name: the table `options.csv`."""

import csv
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from typer import Argument, Option
from typer.models import ParameterInfo

from rigdata.near_names import hint
from tpjb_ident.errors import BadInputError

#: Bundled files that the examples use, from the folder of the sources.
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"


_TABLE = Path(__file__).with_name("options.csv").read_text("utf-8")
#: Options by the name of their parameter, those of one command alone behind its name.
_OPTIONS = {row["parameter"]: row for row in csv.DictReader(_TABLE.splitlines())}


def choices(parameter: str) -> tuple[str, ...]:
    """Names that an option takes, to which a half-typed one is completed."""
    return tuple(_OPTIONS[parameter]["completes"].split())


def option(command: str, parameter: str) -> ParameterInfo:
    """What can be typed for a parameter of a command."""
    row = _OPTIONS.get(f"{command} {parameter}") or _OPTIONS[parameter]
    candidates = row["completes"].split()
    about: dict[str, Any] = {"metavar": row["metavar"] or None, "help": row["help"].format(names=", ".join(candidates))}
    for end in ("min", "max"):
        if row[end]:
            about[end] = json.loads(row[end])
    if row["names"] == "argument":
        return Argument(**about)
    if candidates:
        about["autocompletion"] = lambda incomplete: [name for name in candidates if name.startswith(incomplete)]
    return Option(*row["names"].split(), **about)


def refuse_unknown(value: str, candidates: Iterable[str], option: str) -> None:
    """Let a known name pass; answer another with the nearest."""
    names = tuple(candidates)
    if value not in names:
        raise BadInputError(f"{option}: {value!r} is not known. {hint(value, names, 'Use one of')}")


def known_names(text: str, candidates: Iterable[str], option: str) -> tuple[str, ...]:
    """Names in a list with commas, each once; at least one."""
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip())) or ("",)
    for name in names:
        refuse_unknown(name, candidates, option)
    return names
