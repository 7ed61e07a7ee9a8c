"""Universal file format, data set 58 (time records), read by pyuff."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import refuse
from rigdata.readers.series import Series, equidistant, to_temporary_file

#: Function types of data set 58 that are records over time.
_GENERAL, _TIME_RESPONSE = 0, 1
_FUNCTIONS = {1: "complex time response", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response function",
              6: "coherence", 7: "auto correlation", 9: "power spectral density", 12: "spectrum"}  # fmt: skip


def read_series(path: Path) -> list[Series]:
    """Read every time record of a universal file.

    A record is named by its ID line 1, or else by its response node and direction (``"Rsp 7+X"``).

    Parameters
    ----------
    path : Path
        ``.uff``, ``.unv`` or ``.58``.

    Raises
    ------
    RigDataError
        It holds none: says what it holds.
    """
    import pyuff

    file = pyuff.UFF(str(path))
    series: list[Series] = []
    unusable: Counter[str] = Counter()
    for index, kind in enumerate(file.get_set_types()):
        if int(kind) != 58:
            unusable[f"data set {int(kind)}"] += 1
            continue
        data = file.read_sets(index)
        function = int(data.get("func_type", 0))
        if function in (_GENERAL, _TIME_RESPONSE) and not np.iscomplexobj(data["data"]):
            series.append(_series(data, index))
        else:
            unusable[_FUNCTIONS.get(function, f"function type {function}")] += 1
    if not series:
        counts = ", ".join([f"{count} x {kind}" for kind, count in unusable.items()][:6])
        fault = f"holds no record over time, only {counts}" if counts else "holds no data set"
        raise refuse(path.name, "", fault, "Export the time records (data set 58, time response)")
    return series


def _series(data: dict[str, Any], index: int) -> Series:
    values = to_temporary_file(np.asarray(data["data"], dtype=float))
    x = data.get("x")
    step = float(data.get("abscissa_inc") or 0.0)
    time: FloatArray | None = None
    if x is not None and len(x) == len(values):
        time = to_temporary_file(np.asarray(x, dtype=float))
    elif step > 0:
        time = equidistant(len(values), step, float(data.get("abscissa_min") or 0.0))
    unit = str(data.get("ordinate_axis_units_lab") or "").strip()
    return Series(_name(data, index), "" if unit.upper() == "NONE" else unit, values, time, f"set {index + 1}")


def _name(data: dict[str, Any], index: int) -> str:
    for key in ("id1", "id4", "ordinate_axis_lab"):
        text = str(data.get(key) or "").strip()
        if text and text.upper() != "NONE":
            return text
    node, code = data.get("rsp_node"), data.get("rsp_dir")
    if not node:
        return f"set {index + 1}"
    number = int(code) if isinstance(code, (int, float)) else 0
    direction = ""
    if 1 <= abs(number) <= 3:
        direction = ("+" if number > 0 else "-") + "XYZ"[abs(number) - 1]
    return f"Rsp {node}{direction}"
