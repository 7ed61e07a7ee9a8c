"""Every question that the check asks a run: from which answer on it is told, where, in which words, and what to do.

A question is one row of `questions.csv`: it compares one number with its limits; which number it is, the other files of
this folder say. An empty limit is never reached.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rigdata.arrays import BoolArray, FloatArray


class Question(NamedTuple):
    """Limits beyond which an answer is a note, a warning, an error; `{names}` are the channels that are asked."""

    limits: tuple[float, ...]
    place: str
    text: str
    cure: str
    of_channels: bool  #: whether it is the channels' nature, in whatever run they serve


def _questions() -> dict[str, Question]:
    table = {}
    text = Path(__file__).with_suffix(".csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        limits = tuple(float(row[level] or math.inf) for level in ("note", "warning", "error"))
        table[row["name"]] = Question(limits, row["place"], row["text"], row["cure"], bool(row["of_channels"]))
    return table


#: Every question by its name.
QUESTIONS = _questions()


def far(distances: FloatArray, least: float, many: float, count: int = 4) -> BoolArray:
    """Which of some values lie further off than the others: by `many` times their median distance, `least` at least.

    None where they are fewer than `count`.
    """
    if len(distances) < count:
        return np.zeros(len(distances), dtype=bool)
    return np.asarray(distances > max(least, many * float(np.median(distances))))
