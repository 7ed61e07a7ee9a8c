"""The site: pages of the notebooks and pictures are those of today, equations are typeset, the tutorial works."""

import base64
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.command_line import ended
from tests.rigs.laboratories import fill_in
from tpjb_ident.report import plots

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def script(name: str):
    """A script of the documentation as a module."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_gallery_shows_every_plot_and_the_call_that_makes_it():
    text = (DOCS / "plots.md").read_text("utf-8")
    shown = re.findall(
        r"^## (\w+)\n.*?```python\nti\.plots\.(\w+)\(.*?!\[\w+\]\(gallery/(\w+)\.png\)", text, re.S | re.M
    )
    assert [a for a, _, _ in shown] == [b for _, b, _ in shown] == [c for _, _, c in shown]
    assert sorted(a for a, _, _ in shown) == sorted(plots.__all__)
    assert all((DOCS / "gallery" / f"{name}.png").stat().st_size > 3000 for name in plots.__all__)


def notebook(path: Path, code: str, outputs: list) -> Path:
    cells = [{"cell_type": "markdown", "source": ["# Story, [page](../docs/theory.md)\n", "[next](02_pivots.ipynb)"]}]
    cells.append({"cell_type": "code", "source": [code], "outputs": outputs})
    path.write_text(json.dumps({"cells": cells}), "utf-8")
    return path


def test_the_page_of_a_notebook_shows_the_outputs_of_an_executed_copy(tmp_path):
    bare = notebook(tmp_path / "01_story.ipynb", "draw(1)", [])
    picture = {"output_type": "display_data", "data": {"image/png": base64.b64encode(b"picture").decode()}}
    printed = {"output_type": "stream", "name": "stdout", "text": ["\x1b[31mred\n"]}
    executed = notebook(tmp_path / "executed.ipynb", "draw(1)", [printed, picture])
    page = script("site_hooks").page
    text, pictures = page(bare, executed)
    assert text.startswith("# Story, [page](../theory.md)\n[next](02_pivots.md)\n")
    assert "```python\ndraw(1)\n```\n\n```text\nred\n```\n\n![Figure 1](01_story-1.png)" in text
    assert pictures == {"01_story-1.png": b"picture"}
    for stale in (notebook(tmp_path / "old.ipynb", "draw(2)", [printed, picture]), tmp_path / "none.ipynb"):
        text, pictures = page(bare, stale)
        assert "draw(1)" in text
        assert "red" not in text
        assert pictures == {}


@pytest.mark.parametrize("path", sorted((ROOT / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem)
def test_the_page_of_a_notebook_holds_all_its_cells(path):
    text, _ = script("site_hooks").page(path, DOCS / "none.ipynb")
    code = [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert text.count("```python\n") == len(code)
    assert all("".join(cell["source"]) in text for cell in code)


def test_equations_become_mathml_that_needs_no_network():
    pytest.importorskip("latex2mathml", reason="the extra docs is not installed")
    text = (DOCS / "theory.md").read_text("utf-8")
    html = script("site_hooks").on_page_markdown(text)
    assert html.count("<math") == text.count("```math") >= 14
    assert "```math" not in html
    assert "\\" not in "".join(re.findall(r"<math.*?</math>", html))  # no command that was not understood


def holds(printed: str, line: str) -> bool:
    """Whether all words of a line are in a printed one, in their order."""
    words = iter(printed.split())
    return all(word in words for word in line.split())


@pytest.mark.slow
def test_the_tutorial_leads_to_a_report(tmp_path, monkeypatch):
    text = (DOCS / "guide" / "tutorial.md").read_text("utf-8")
    (tmp_path / "model").symlink_to(ROOT / "model", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    shown = ""
    for language, block in re.findall(r"^```(sh|toml|text)\n(.*?)^```", text, re.S | re.M):
        if language == "text":  # what the command above it prints, to the last digit; columns alike stand in its title
            for line in filter(lambda line: line.strip("-"), block.splitlines()):
                assert any(holds(printed, line) for printed in shown.splitlines()) or "; exc. 25 Hz" in line, line
            continue
        if language == "toml":
            tables = tomllib.loads(block)
            edits = {("housing", k): v for k, v in tables["housing"].items()}
            edits |= {(c, k): str(v) for c, entries in tables["channels"].items() for k, v in entries.items()}
            manifest = Path("records/campaign.toml")
            manifest.write_text(fill_in(manifest.read_text("utf-8"), edits), "utf-8")
            assert "??" not in re.sub(r"#.*", "", manifest.read_text("utf-8"))
            continue
        for line in block.splitlines():
            words = line.split()
            if words[0] == "cp":
                source, target = Path(words[-2]), Path(words[-1])
                (shutil.copytree if source.is_dir() else shutil.copy)(source, target)
            else:
                shown = ended(0, *words[1:]).stdout
    assert "</html>" in Path("report/report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built once; a warning ends it."""
    for module in ("mkdocstrings", "latex2mathml"):
        pytest.importorskip(module, reason="the extra docs is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.slow
def test_the_site_shows_notebooks_pictures_and_equations(site):
    assert "<math" in (site / "theory.html").read_text("utf-8")
    notebooks = sorted(site.glob("notebooks/*.html"))
    assert [page.stem for page in notebooks] == sorted(path.stem for path in (ROOT / "notebooks").glob("*.ipynb"))
    assert (site / "plots.html").read_text("utf-8").count("<img ") == (DOCS / "plots.md").read_text("utf-8").count("![")
    for page in (*notebooks, site / "plots.html"):
        html = page.read_text("utf-8")
        pictures = re.findall(r'<img [^>]*src="([^"]+)"', html)
        assert all((page.parent / name).resolve().exists() for name in pictures)
        assert not re.search(r'(?:src|href)="https?://[^"]+\.(?:js|css|woff2?)"', html)
