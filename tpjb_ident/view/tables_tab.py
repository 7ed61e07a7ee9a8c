"""Tables: the result tables of an output folder, as they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

MOST_ROWS = 5000


def tables_tab(tables: Mapping[str, pd.DataFrame]) -> Any:
    """Build the tab.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        By name.
    """
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, DataTable, Select, TableColumn

    pick = Select(title="table", options=list(tables), value=next(iter(tables)), name="table", width=320)
    source = ColumnDataSource({})
    grid = DataTable(source=source, columns=[], height=560, sizing_mode="stretch_width", reorderable=False, name="grid")

    def update() -> None:
        frame = tables[pick.value].head(MOST_ROWS)
        source.data = {str(c): [_cell(v) for v in frame[c]] for c in frame.columns}
        grid.columns = [TableColumn(field=str(c), title=printable(c)) for c in frame.columns]

    pick.on_change("value", lambda attr, old, new: update())
    update()
    return column(pick, grid, sizing_mode="stretch_width")


def _cell(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else printable(value)
