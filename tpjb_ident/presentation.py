"""How results show themselves: a line, sentences, a table in a notebook, a data frame, a picture, US units."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from tpjb_ident.columns import FAHRENHEIT, SYSTEMS
from tpjb_ident.columns import UNITS as SHOWN
from tpjb_ident.schema import KINDS, POINT_COLUMNS, STIFFNESS

if TYPE_CHECKING:
    import pandas as pd

#: Unit in a column's name: the quantity whose unit people read.
_DISPLAYED = {kind.suffix: kind.quantity for kind in KINDS.values()} | {"N": "load", "m": "length", "Pa": "pressure"}
_NAMES = re.compile(rf"(.+?)_({'|'.join(_DISPLAYED)}|deg|Hz|degC|K)((?:_[a-z0-9]+)*)")
#: Columns of coefficients that not only scripts want.
_FOR_PEOPLE = re.compile(
    rf"[kc](?:xx|xy|yx|yy)_(?:N|Ns)_per_m(?:_lo|_hi|_predicted)?|{'|'.join(POINT_COLUMNS)}|pivots|quality"
)


class Presented:
    """A result that a person looks at; subclasses give a table, sentences (`summary` or `__str__`) and the picture."""

    def to_frame(self) -> pd.DataFrame:
        """The table as it is written to disk."""
        raise NotImplementedError

    def to_dataframe(self) -> pd.DataFrame:
        """The result as a table, SI, units in the names of the columns."""
        return self.to_frame()

    def summary(self) -> str:
        """What came out, in sentences and in the units that people read."""
        return str(self)

    def plot(self, **options: Any) -> Any:
        """The picture that shows it best; further ones are in `tpjb_ident.report.plots`."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary().partition(chr(10))[0]}>"

    def _repr_html_(self) -> str:
        sentences = "".join(f"<p>{html.escape(line)}</p>" for line in self.summary().splitlines())
        return f"{sentences}{_in_display_units(self.to_dataframe()).to_html(index=False, max_rows=30)}"


def _in_display_units(frame: pd.DataFrame) -> pd.DataFrame:
    """A table in MN/m, kN s/m, kN and µm to four digits; of coefficients without the columns that only scripts want."""
    import pandas as pd

    names = list(frame.columns)
    if STIFFNESS.columns[0] in frame:
        names = [name for name in names if _FOR_PEOPLE.fullmatch(name)]
    table = {}
    for name in names:
        match = _NAMES.fullmatch(name)
        words, unit, end = match.groups() if match else (name, "", "")
        label, scale = SHOWN.get(_DISPLAYED.get(unit, ""), (unit, 1.0))
        values = frame[name]
        if pd.api.types.is_float_dtype(values):
            values = (values / scale).map("{:.4g}".format)
        table[(words + end).replace("_", " ") + (f", {label}" if label else "")] = values
    return pd.DataFrame(table)


def json_data(value: Any) -> Any:
    """A result as JSON can hold it: numbers that it cannot hold become null, what it does not know a text."""
    if isinstance(value, Mapping):
        return {str(k): json_data(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [json_data(v) for v in value]
    if hasattr(value, "dtype"):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int) or value is None else str(value)


def changed(settings: Any) -> str:
    """Settings as a call with what differs from the defaults: ``IdentifySettings(method='ols')``."""
    default = type(settings)()
    differing = []
    for setting in fields(settings):
        value = getattr(settings, setting.name)
        if value != getattr(default, setting.name):
            differing.append(f"{setting.name}={value!r}")
    return f"{type(settings).__name__}({', '.join(differing)})"


#: Unit in a column's name: unit there in US units, its size in SI, and the zero of its scale in SI.
UNITS = {"degC": ("degF", 5 / 9, -160 / 9), "K": FAHRENHEIT}
for _suffix, _quantity in _DISPLAYED.items():
    _symbol, _size = SYSTEMS["us"][_quantity]
    UNITS[_suffix] = (_symbol.replace("/", "_per_").replace(" ", ""), _size, 0.0)
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
        elif match is not None and match[2] in UNITS:
            unit, size, zero = UNITS[match[2]]
            names[name] = f"{match[1]}_{unit}{match[3]}"
            converted[name] = (frame[name] - (0.0 if _WIDTHS.search(match[3]) else zero)) / size
    return converted.rename(columns=names)
