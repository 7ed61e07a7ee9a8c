"""A table of results in pounds, inches, mils and rpm, beside the one in SI."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from tpjb_ident.columns import SYSTEMS

if TYPE_CHECKING:
    import pandas as pd

_US = SYSTEMS["us"]
#: Unit in a column's name: unit there in US units, its size in SI, and the zero of its scale in SI.
UNITS = {
    "N_per_m": ("lbf_per_in", _US["stiffness"][1], 0.0),
    "Ns_per_m": ("lbfs_per_in", _US["damping"][1], 0.0),
    "N": ("lbf", _US["load"][1], 0.0),
    "m": ("mil", _US["length"][1], 0.0),
    "kg": ("lb", _US["mass"][1], 0.0),
    "Pa": ("psi", _US["pressure"][1], 0.0),
    "degC": ("degF", 5 / 9, -160 / 9),
    "K": ("degF", 5 / 9, 459.67 * 5 / 9),
}
_NAMES = re.compile(rf"(.+?)_({'|'.join(UNITS)})((?:_[a-z0-9]+)*)")
#: Endings of what is a difference, which has no zero.
_WIDTHS = re.compile(r"_se|_difference|95")


def us_table(frame: pd.DataFrame) -> pd.DataFrame:
    """The table with its columns converted and renamed; what has no US unit stays.

    >>> import pandas as pd
    >>> us_table(pd.DataFrame({"kxx_N_per_m_lo": [175126835.2], "shaft_speed_Hz": [22.0]})).round(3).to_dict("list")
    {'kxx_lbf_per_in_lo': [1000000.0], 'shaft_speed_rpm': [1320.0]}
    """
    converted = frame.copy()
    names = {}
    for name in frame.columns:
        match = _NAMES.fullmatch(str(name))
        if frame[name].dtype.kind not in "fi":
            continue
        if name == "shaft_speed_Hz":
            names[name], converted[name] = "shaft_speed_rpm", 60.0 * frame[name]
        elif match is not None:
            unit, size, zero = UNITS[match[2]]
            names[name] = f"{match[1]}_{unit}{match[3]}"
            converted[name] = (frame[name] - (0.0 if _WIDTHS.search(match[3]) else zero)) / size
    return converted.rename(columns=names)
