"""`pivots.toml`: measured pivot laws in the form that `tpjb predict --pivots` reads.

Each pad is a dense table of load, deflection and tangent stiffness made from its law. The table is denser
than any reader's interpolation can spoil; no parameters are written, so a reader needs to know no law.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.pivot.curve import PivotCurve

FloatArray = NDArray[np.float64]

SCHEMA = "tpjb-pivots/1"
ROWS = 160
SMALLEST = 5e-4  # first load of the table, as a share of the largest measured one
EXTRAPOLATE_TO = 2.5


def table_loads(curve: PivotCurve) -> FloatArray:
    """Loads of the table [N]: zero, then geometric steps (n,)."""
    return np.r_[0.0, np.geomspace(SMALLEST * curve.valid_to, EXTRAPOLATE_TO * curve.valid_to, ROWS)]


def pivots_text(curves: Sequence[PivotCurve], source: str) -> str:
    """Text of `pivots.toml`.

    Parameters
    ----------
    curves : sequence of PivotCurve
        One per pad.
    source : str
        Id of the campaign.

    Returns
    -------
    str
        TOML; loads [N], deflections [m], stiffnesses [N/m].
    """
    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    lines = [
        "# Measured pivot laws: pivot and housing together, as the probes on the housing see them.",
        f'schema = "{SCHEMA}"',
        f"source = {_quoted(source)}",
        "includes_housing = true",
    ]
    for curve in sorted(curves, key=lambda c: c.pad):
        lines += ["", *_pad_lines(curve)]
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
    text = pivots_text(curves, source)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".tmp")
    temporary = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return target


def _pad_lines(curve: PivotCurve) -> list[str]:
    loads = table_loads(curve)
    positive = loads[1:]
    stiffness = curve.stiffness(positive)
    return [
        "[[pads]]",
        f"pad = {curve.pad}",
        f"law = {_quoted(curve.law.name)}",
        f"valid_from_N = {curve.valid_from:.6g}",
        f"valid_to_N = {curve.valid_to:.6g}",
        f"relative_calibration = {curve.relative_calibration:.4g}",
        f"force_N = {_array(loads, 9)}",
        f"deflection_m = {_array(np.r_[0.0, curve.deflection(positive)], 9)}",
        # at zero load Hertz's laws have no stiffness at all: the first value belongs to the first positive
        # load
        f"stiffness_N_per_m = {_array(np.r_[stiffness[0], stiffness], 7)}",
        f"stiffness_relative_se = {_array(np.r_[0.0, curve.relative_stiffness_se(positive)], 3)}",
    ]


def _array(values: FloatArray, digits: int) -> str:
    return "[" + ", ".join(_float(v, digits) for v in values) + "]"


def _float(value: float, digits: int) -> str:
    text = f"{value:.{digits}g}"
    # TOML tells integers from floats: a reader of floats should meet only floats
    return text if any(c in text for c in ".en") else text + ".0"


def _quoted(text: str) -> str:
    escaped = "".join(
        c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in text.replace("\\", "\\\\").replace('"', '\\"')
    )
    return f'"{escaped}"'
