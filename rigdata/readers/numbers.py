"""What counts as a number and as a missing value in a text export."""

from __future__ import annotations

import re

#: Ways in which loggers and spreadsheets write "no value".
MISSING = (
    "",
    "NaN",
    "nan",
    "NAN",
    "-NaN",
    "-nan",
    "-nan(ind)",
    "-",
    "--",
    "---",
    "----",
    "-----",
    "*",
    "***",
    "?",
    "NA",
    "N/A",
    "n/a",
    "#N/A",
    "#NA",
    "#NV",
    "#VALUE!",
    "#WERT!",
    "#DIV/0!",
    "null",
    "NULL",
    "None",
    "none",
    "1.#QNAN",
    "-1.#QNAN",
    "1.#IND",
    "-1.#IND",
    "1.#INF",
    "-1.#INF",
    "1,#QNAN",
    "-1,#QNAN",
    "1,#IND",
    "-1,#IND",
    "1,#INF",
    "-1,#INF",
    "1.#R",
    "OVL",
    "+OVL",
    "-OVL",
    "OL",
    "+OL",
    "-OL",
    "OVER",
    "OVERLOAD",
    "OVERFLOW",
    "Overflow",
    "INVALID",
    "Invalid",
    "ERR",
    "inf",
    "-inf",
    "+inf",
    "Inf",
    "-Inf",
    "INF",
    "-INF",
)
_MISSING = frozenset(MISSING)
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:[0-9]+(?:{re.escape(mark)}[0-9]*)?|{re.escape(mark)}[0-9]+)(?:[eE][+-]?[0-9]+)?")
    for mark in ".,"
}


def is_missing(cell: str) -> bool:
    """Whether `cell` (stripped) stands for no value.

    Parameters
    ----------
    cell : str
        Stripped.
    """
    return cell in _MISSING


def is_number(cell: str, decimal: str) -> bool:
    """Whether `cell` (stripped) is a number with that decimal mark.

    Parameters
    ----------
    cell : str
        Stripped.
    decimal : str
        Decimal mark, a point or a comma.
    """
    return _NUMBER[decimal].fullmatch(cell) is not None


def looks_like(cell: str) -> bool:
    """Whether `cell` is a number with either decimal mark.

    Parameters
    ----------
    cell : str
        Stripped.
    """
    return is_number(cell, ".") or is_number(cell, ",")


def number_pattern(decimal: str) -> str:
    """Regular expression (RE2) of a number, for whole columns.

    Parameters
    ----------
    decimal : str
        Decimal mark, a point or a comma.
    """
    return f"^(?:{_NUMBER[decimal].pattern})$"
