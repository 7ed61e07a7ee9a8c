"""`pivots.toml`: measured pivot laws in the form that `tpjb predict --pivots` reads.

Each pad is a dense table of load, deflection and tangent stiffness made from its law. The table is denser
than any reader's interpolation can spoil; no parameters are written, so a reader needs to know no law.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.runtime.tables import write_text
from tpjb_ident.schema import TANGENT

SCHEMA = "tpjb-pivots/1"
ROWS = 160
SMALLEST = 5e-4  # first load of the table, as a share of the largest measured one
EXTRAPOLATE_TO = 2.5


def table_loads(curve: PivotCurve) -> FloatArray:
    """Loads of the table [N]: zero, then geometric steps (n,)."""
    return np.r_[0.0, np.geomspace(SMALLEST * curve.valid_to, EXTRAPOLATE_TO * curve.valid_to, ROWS)]


def pivots_text(curves: Sequence[PivotCurve], source: str) -> str:
    """Text of `pivots.toml`."""
    if not curves:
        raise ArgumentError("curves must hold at least one PivotCurve")
    lines = [
        "# Measured pivot laws: pivot and housing together, as the probes on the housing see them.",
        f'schema = "{SCHEMA}"',
        f"source = {_quoted(source)}",
        "includes_housing = true",
    ]
    for curve in sorted(curves, key=lambda c: c.pad):
        lines += ["", "[[pads]]", *(f"{name} = {_toml(value)}" for name, value in pad_table(curve).items())]
    return "\n".join(lines) + "\n"


def write_pivots(path: str | Path, curves: Sequence[PivotCurve], source: str) -> Path:
    """Write `pivots.toml`, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Destination.
    curves : sequence of PivotCurve
        One per pad.
    source : str
        Id of the campaign.

    Returns
    -------
    Path
        The destination.
    """
    target = Path(path)
    write_text(target, pivots_text(curves, source))
    return target


def pad_table(curve: PivotCurve) -> dict[str, Any]:
    """Numbers of one pad as they stand in the file, rounded.

    What is made of them is what a reader of the file makes.
    """
    loads = table_loads(curve)
    positive = loads[1:]
    stiffness = curve.stiffness(positive)
    return {
        "pad": curve.pad,
        "law": curve.law.name,
        "valid_from_N": _Number(f"{curve.valid_from:.6g}"),
        "valid_to_N": _Number(f"{curve.valid_to:.6g}"),
        "relative_calibration": _Number(f"{curve.relative_calibration:.4g}"),
        "force_N": _rounded(loads, 9),
        "deflection_m": _rounded(np.r_[0.0, curve.deflection(positive)], 9),
        # at zero load Hertz's laws have no stiffness at all: the first value belongs to the first positive load
        TANGENT: _rounded(np.r_[stiffness[0], stiffness], 7),
        "stiffness_relative_se": _rounded(np.r_[0.0, curve.relative_stiffness_se(positive)], 3),
    }


class _Number(float):
    """A number that keeps the digits it was written with."""

    def __new__(cls, text: str) -> _Number:
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def _rounded(values: FloatArray, digits: int) -> list[_Number]:
    texts = (f"{value:.{digits}g}" for value in values)
    # TOML tells integers from floats: a reader of floats should meet only floats
    return [_Number(text if any(c in text for c in ".en") else text + ".0") for text in texts]


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(number.text for number in value) + "]"
    return value.text if isinstance(value, _Number) else _quoted(value) if isinstance(value, str) else str(value)


def _quoted(text: str) -> str:
    escaped = "".join(
        c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in text.replace("\\", "\\\\").replace('"', '\\"')
    )
    return f'"{escaped}"'
