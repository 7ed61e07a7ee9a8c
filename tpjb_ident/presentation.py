"""How results show themselves in Python: one line, sentences, a table in a notebook, a data frame, a picture."""

from __future__ import annotations

import html
import importlib
import re
from typing import TYPE_CHECKING, Any

from tpjb_ident.schema import KINDS

if TYPE_CHECKING:
    import pandas as pd

#: Rows of a table in a notebook.
MOST_ROWS = 30


class Presented:
    """A result that a person looks at; subclasses give the frame, the sentences and the picture."""

    def to_dataframe(self) -> pd.DataFrame:
        """The result as a table, SI, units in the names of the columns."""
        raise NotImplementedError

    def summary(self) -> str:
        """What came out, in sentences and in the units that people read."""
        raise NotImplementedError

    def plot(self, **options: Any) -> Any:
        """The picture that shows it best; further ones are in `tpjb_ident.report.plots`.

        Parameters
        ----------
        **options
            Of the function in `tpjb_ident.report.plots`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary().partition(chr(10))[0]}>"

    def _repr_html_(self) -> str:
        sentences = "".join(f"<p>{html.escape(line)}</p>" for line in self.summary().splitlines())
        return f"{sentences}{in_display_units(self.to_dataframe()).to_html(index=False, max_rows=MOST_ROWS)}"


def in_display_units(frame: pd.DataFrame) -> pd.DataFrame:
    """Coefficients in MN/m and kN s/m to four digits, loads in kN, without the columns that only scripts want.

    Parameters
    ----------
    frame : DataFrame
        SI, as the tables on disk.
    """
    import pandas as pd

    shown: dict[str, Any] = {}
    for name in frame.columns:
        kind = KINDS.get(name[0])
        found = re.fullmatch(r"([kc](?:xx|xy|yx|yy))_(?:N|Ns)_per_m(_lo|_hi|_predicted)?", name)
        if found and kind is not None:
            label = f"{found[1]}{(found[2] or '').replace('_', ' ')}, {kind.display_unit}"
            shown[label] = (frame[name] / kind.display_scale).map("{:.4g}".format)
        elif name in {"static_load_N"}:
            shown["load, kN"] = frame[name] / 1e3
        elif name in {"static_load_direction_deg", "shaft_speed_Hz", "excitation_Hz", "pivots", "quality"}:
            shown[
                name.rpartition("_")[0].replace("_", " ") + f", {name.rpartition('_')[2]}" if "_" in name else name
            ] = frame[name]
    return pd.DataFrame(shown)


def shown_by(module: str, function: str) -> Any:
    """A function of a room above the result's own, looked up when it is asked for: no file imports upwards.

    Parameters
    ----------
    module : str
        Below `tpjb_ident`, e.g. ``"report.plots"``.
    function : str
        Of that module.
    """
    return getattr(importlib.import_module(f"tpjb_ident.{module}"), function)
