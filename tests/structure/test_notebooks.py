"""Notebooks: stored without outputs, each told in prose first, every one of them executed in CI."""

import ast
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "notebooks"
NOTEBOOKS = sorted(FOLDER.rglob("*.ipynb"))
STORIES = ("01_identify", "02_pivots", "03_model", "04_compare_reproduce_the_paper", "05_hidden_effect",
           "06_plan_a_campaign", "07_bring_your_own_data", "08_the_papers_own_case")  # fmt: skip


def cells(path: Path) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def source(cell: dict) -> str:
    return "".join(cell["source"])


def plain(code: str) -> str:
    """Code without IPython's own lines, so that Python can parse it."""
    return "\n".join(line for line in code.splitlines() if not line.startswith("%"))


def test_all_stories_are_there():
    assert [p.stem for p in NOTEBOOKS] == list(STORIES)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_is_told_in_prose_without_outputs_and_checks_what_it_claims(path):
    first, second, *_ = cells(path)
    assert (first["cell_type"], second["cell_type"]) == ("markdown", "code")
    assert source(first).startswith("# ")
    assert len(source(first)) > 300
    words = sum(len(source(c).split()) for c in cells(path) if c["cell_type"] == "markdown")
    assert words > 150
    code = [cell for cell in cells(path) if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    text = "\n".join(plain(source(cell)) for cell in code)
    assert any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(text)))
    assert not [place for place in ("../shared", "/work/", "truth/") if place in text]  # it needs the package alone


def test_ci_executes_the_folder_they_lie_in():
    runner = (ROOT / ".ci" / "notebooks.py").read_text(encoding="utf-8")
    assert 'parent / "notebooks"' in runner
    assert '.glob("*.ipynb")' in runner
    assert {p.parent for p in NOTEBOOKS} == {FOLDER}  # glob looks no deeper
    assert ".ci/notebooks.py" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
