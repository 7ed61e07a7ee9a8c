"""Names and descriptions from a stranger: no page runs them, no spreadsheet computes them, no terminal obeys them."""

import re
import shutil

import h5py
import pandas as pd
import pytest

import rigdata
from rigdata.problem import RigDataError
from tests.command_line import ended, tpjb
from tests.exports.test_export import table
from tests.manifests import manifest
from tests.report.tags import Page
from tpjb_ident.runtime.tables import safe_for_spreadsheets, write_table

TAGS = "<script>alert(1)</script><img src=x onerror=alert(2)><svg onload=alert(3)>"
NAMES = ["<script>x</script>", '"><img src=x onerror=y>', "=1+1", "\u202eabc", "\x1b[31mred", "javascript:alert(1)"]
FORMULAS = ["=1+1", "+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", '=HYPERLINK("http://x")', "=cmd|' /C calc'!A0"]


def faults_of(text):
    """What in a page would run, or load something, on behalf of a name."""
    page = Page(text, well_formed=False)
    found = [f"{tag} {a}" for tag, attributes in page.tags for a in attributes if a.startswith("on")]
    found += [tag for tag, _ in page.tags if tag in {"img", "iframe", "object", "embed", "base", "link", "form"}]
    links = [v or "" for _, a in page.tags for k, v in a.items() if k in {"href", "src", "xlink:href"}]
    found += [v for v in links if v.strip().lower().startswith(("javascript", "data:text", "http"))]
    found += ["script of a stranger" for script in page.scripts if "alert(" in script]
    return found


@pytest.fixture(scope="module")
def hostile(tmp_path_factory, small_campaign):
    """The small campaign with tags, formulas and marks in id, description, run names and channel names."""
    path = tmp_path_factory.mktemp("hostile") / "a<b>&'\"=1+1.h5"
    shutil.copy(small_campaign, path)
    entries = {"name": f"=1+1 {TAGS}", "id": f"=1+1 {TAGS}", "description": f"{TAGS} \u202e =HYPERLINK(1)"}
    with h5py.File(path, "r+") as file:
        for attribute, keys in (("manifest", ("id", "description")), ("bearing", ("name",))):
            text = file.attrs[attribute]
            for key in keys:
                line = f"{key} = '{entries[key]}'"
                text, count = re.subn(rf"^{key} = .*$", lambda _, line=line: line, text, count=1, flags=re.M)
                assert count == 1
            file.attrs[attribute] = text
    return path


@pytest.mark.slow
@pytest.mark.parametrize("command", ["compare", "identify", "locus", "check"])
def test_no_result_of_a_hostile_campaign_runs_anything(hostile, tmp_path, command):
    extra = ("--pivots", "rigid", "--thermal", "isothermal") if command == "compare" else ()
    result = tpjb(command, hostile, *extra, "--out", tmp_path / "out")
    assert result.exit_code in (0, 2, 3), result.output
    assert "\x1b" not in result.output
    assert "\u202e" not in result.output
    pages = list((tmp_path / "out").rglob("*.html")) + list((tmp_path / "out").rglob("*.svg"))
    assert pages or command != "compare"
    for page in pages:
        assert faults_of(page.read_text(encoding="utf-8")) == [], page.name
    for path in (tmp_path / "out").rglob("*.csv"):
        for column, values in pd.read_csv(path, dtype=str).items():
            cells = [column, *values.dropna()]
            assert not [c for c in cells if c.startswith(("=", "@", "\t", "\r")) or (c[:1] in "+-" and not _number(c))]


def _number(cell):
    try:
        float(cell)
        return True
    except ValueError:
        return False


def test_the_search_for_faults_finds_them():
    for bad in ("<p onclick=x>", "<img src=x>", "<a href='javascript:x'>", "<script>alert(1)</script>", TAGS):
        assert faults_of(bad)
    assert not faults_of("<p>&lt;script&gt;alert(1)&lt;/script&gt;</p><a href='#x'>x</a>")


@pytest.mark.parametrize("formula", FORMULAS)
def test_no_cell_or_heading_is_a_formula(tmp_path, formula):
    frame = pd.DataFrame({"run": [formula, "ok"], formula: [1.0, -2.0]})
    write_table(tmp_path, "t", frame)
    csv, parquet = tmp_path / "t.csv", tmp_path / "t.parquet"
    back = pd.read_csv(csv, dtype=str)
    assert back.iloc[0, 0] == back.columns[1] == "'" + formula.replace("\r", " ")
    assert back.iloc[1, 1] == "-2.0"  # numbers stay numbers
    assert pd.read_parquet(parquet).iloc[0, 0] == formula


def test_formulas_in_every_kind_of_text_column():
    column = pd.Series(["=1", "x"])
    for kind in (object, "string", "category"):
        safe = safe_for_spreadsheets(pd.DataFrame({"a": column.astype(kind)}))
        assert safe["a"].astype(str).tolist() == ["'=1", "x"], kind


def test_an_excel_file_holds_texts_not_formulas(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    write_table(tmp_path, "coefficients", table([(5000.0, 25.0)]).assign(method="=1+1", quality="@x"))
    ended(0, "export", tmp_path, "--to", "excel", "--out", tmp_path / "out")
    (path,) = (tmp_path / "out").glob("*.xlsx")
    for sheet in openpyxl.load_workbook(path):
        for row in sheet.iter_rows():
            assert not [c.coordinate for c in row if c.data_type == "f"]


@pytest.mark.parametrize("name", NAMES)
def test_a_strange_name_in_a_message_is_one_printable_line(tmp_path, name):
    folder = tmp_path / "c"
    folder.mkdir()
    quoted = name.replace("\\", "\\\\").replace('"', '\\"').replace("\x1b", "\\u001b")
    (folder / "campaign.toml").write_text(f'schema = "{quoted}"\nid = "{quoted}"\n"{quoted}" = 1\n', encoding="utf-8")
    with pytest.raises(RigDataError) as caught:
        rigdata.load_campaign(folder)
    for line in str(caught.value).splitlines():
        assert line.isprintable()
    result = ended(2, "check", folder, "--out", tmp_path / "out")
    assert "\x1b" not in result.output


@pytest.mark.parametrize("name", [*NAMES, "../x", "/x", "C:x", "a/b"])
def test_a_run_has_a_plain_name_or_none(tmp_path, name):
    run = {"id": name.replace(chr(27), "?"), "kind": "clearance", "file": "r.csv"}
    (tmp_path / "campaign.toml").write_text(manifest({}, run), encoding="utf-8")
    with pytest.raises(RigDataError, match=r"run id .* cannot be used"):
        rigdata.load_campaign(tmp_path)
