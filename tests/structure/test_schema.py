"""One schema of columns: the documentation lists it, and the tables hold nothing beside it."""

import re
from pathlib import Path

import pandas as pd
import pytest

from tpjb_ident import schema

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")


#: Units as people write them, where a name cannot.
WRITTEN = {"N_per_m": "N/m", "Ns_per_m": "N s/m", "m3_per_s": "m^3/s"}


def headed(name: str) -> str:
    """Text of the section whose heading names a table first."""
    found = re.search(rf"^## `{name}`.*?\n(.*?)(?=^## |\Z)", PAGE, flags=re.M | re.S)
    assert found, f"docs/results.md has no section `{name}`"
    return found[1]


def markdown(table: str) -> str:
    """Rows of the documentation's table of one file: name, unit, meaning."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    for column in schema.TABLES[table]:
        dots = " .. `" + column.name.replace("{e}", "yy") + "`" if "{e}" in column.name else ""
        names = [f"`{column.name.replace('{e}', 'xx')}`{dots}", *(f"`{ending}`" for ending in column.endings)]
        rows.append(f"| {', '.join(names)} | {WRITTEN.get(column.unit, column.unit)} | {column.meaning} |")
    return "\n".join(rows)


@pytest.mark.parametrize("table", sorted(set(schema.TABLES) - {"estimators", "frf_estimators", "clearance_runs"}))
def test_the_documentation_lists_the_columns_of_the_schema(table):
    """Mend a failure by pasting what `markdown(table)` gives."""
    assert markdown(table) in headed(table)


def test_every_ending_is_explained():
    endings = {column.name: column.meaning for column in schema.LISTED["@endings"]}
    used = {ending for columns in schema.TABLES.values() for column in columns for ending in column.endings}
    assert used <= set(endings)
    for ending, meaning in endings.items():
        assert f"| `{ending}` | {meaning} |" in PAGE


def test_a_unit_in_a_name_is_the_column_s_unit():
    for columns in schema.TABLES.values():
        for column in columns:
            if column.unit and not column.name.startswith("x_m_") and not column.name.startswith("y_m_"):
                assert column.name.endswith(f"_{column.unit}"), column.name


def unknown_columns(table: str, names: list[str]) -> list[str]:
    """Names that the schema does not know in a table."""
    known = re.compile("|".join(column.pattern() for column in schema.TABLES[table]))
    return [name for name in names if not known.fullmatch(name)]


@pytest.mark.parametrize("column", ["kxx_N_per_mm", "temperature_K_2", "pad3_load", "kxz_N_per_m"])
def test_a_name_that_is_none_is_found(column):
    assert unknown_columns("coefficients", [column]) == [column]


@pytest.mark.slow
@pytest.mark.parametrize("results", ["identified", "located"])
def test_tables_on_disk_hold_columns_of_the_schema_only(results, request):
    tables = sorted(request.getfixturevalue(results).glob("*.csv"))
    assert tables
    for path in tables:
        assert unknown_columns(path.stem, list(pd.read_csv(path, nrows=1))) == [], path.name
