"""Documentation and notebooks: links lead somewhere, code and command lines run, stories are told in prose."""

import ast
import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from model.effects import registry
from tests.command_line import ended
from tests.structure.test_examples import computed_once  # noqa: F401 (for its module)

ROOT = Path(__file__).parents[2]
WALK = ROOT / "tpjb_ident" / "identification" / "README.md"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", WALK, *sorted((ROOT / "docs").rglob("*.md"))]
#: Blocks that describe files of a user, so they are checked for being Python and are not run.
NEEDS_FILES_OF_YOUR_OWN = ("rocker-A",)
LANGUAGES = {"python", "toml", "sh", "text", "json", "math"}


def blocks():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for i, match in enumerate(re.finditer(r"^```(\w*)\n(.*?)^```", text, flags=re.S | re.M), start=1):
            yield pytest.param(match[1], match[2], id=f"{page.relative_to(ROOT).as_posix()}:{match[1] or 'plain'}{i}")


BLOCKS = list(blocks())


def of(*languages):
    return [p for p in BLOCKS if p.values[0] in languages]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_lead_somewhere_and_files_that_a_page_names_exist(page):
    """A file: as a path from the checkout or as the end of one; NAME and the like stand for the reader's own."""
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)):
        if not target.startswith(("http", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), target
    named = re.findall(r"`([a-z_.]+/[\w./]*\.py)[^`]*`", text)
    folders = re.findall(r"`((?:tests|model|rigdata|tpjb_ident|docs)/[\w/]*)/`", text)
    for name in {*folders, *(name for name in named if not re.search(r"\b[A-Z]{4,}\.py", name))}:
        assert any(list(ROOT.glob(f"{above}{name}")) for above in ("", "*/", "*/*/")), name


def test_the_site_lists_pages_that_exist_and_the_whole_guide():
    listed = set(re.findall(r":\s+(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), flags=re.M))
    pages = {p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")}
    notebooks = {f"notebooks/{p.stem}.md" for p in (ROOT / "notebooks").glob("*.ipynb")}  # made by docs/site_hooks.py
    assert listed == pages | notebooks
    assert {p for p in pages if p.startswith("guide/")} <= listed


def test_troubleshooting_names_every_condition():
    from tpjb_ident.conditions import KINDS

    text = (ROOT / "docs" / "guide" / "troubleshooting.md").read_text(encoding="utf-8")
    by_line = {name for name in KINDS if name.endswith(" on excitation line")}  # one row for many lines
    assert {name for name in set(KINDS) - by_line if f"`{name}`" not in text} == set()


@pytest.mark.parametrize(("language", "text"), [p for p in BLOCKS if not p.values[0]] or [pytest.param("", "")])
def test_blocks_without_a_language_are_pictures(language, text):
    assert "import " not in text
    assert not re.search(r"^(tpjb|python3?|pip) ", text, flags=re.M)


def test_every_language_is_one_that_is_tested():
    assert {p.values[0] for p in BLOCKS} <= LANGUAGES | {""}
    assert len(of("python")) >= 5
    assert len(of("sh")) >= 3


def test_toml_is_toml_and_the_described_campaign_is_understood():
    from rigdata.manifest.manifest import parse_manifest

    assert all(tomllib.loads(p.values[1]) for p in of("toml"))
    text = (ROOT / "docs" / "campaigns.md").read_text(encoding="utf-8")
    assert parse_manifest(re.search(r"```toml\n(.*?)```", text, flags=re.S)[1]).runs


@pytest.mark.slow
@pytest.mark.parametrize(("language", "text"), of("python"))
def test_python_runs_as_it_stands(language, text, desk, monkeypatch, capsys):
    ast.parse(text)
    if any(word in text for word in NEEDS_FILES_OF_YOUR_OWN) or text.startswith("ti.plots."):
        return  # calls of the gallery: `tests/report` draws them
    monkeypatch.chdir(desk)
    monkeypatch.setattr(registry, "_registered", {})
    exec(compile(text, "block", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


@pytest.mark.slow
def test_the_gallery_runs_from_its_first_block_on_and_writes_nothing(desk, monkeypatch):
    """Each of its calls takes what the first block made of the demo."""
    monkeypatch.chdir(desk)
    names: dict = {}
    for block in (p.values[1] for p in of("python") if p.id.startswith("docs/plots.md")):
        exec(compile(block, "block", "exec"), names)
    assert not list(desk.glob("*.png"))


@pytest.mark.parametrize(("language", "text"), of("sh"))
def test_command_lines_have_commands_and_options_that_exist(language, text):
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["tpjb"] and len(words) > 1:
            shown = ended(0, words[1], "--help")
            for word in words[2:]:
                if word.startswith("--"):
                    assert word in shown.stdout, line


def test_the_readme_s_two_commands_name_what_exists():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for command in ("tpjb_ident demo", "tests"):
        assert f"`python3 {command}`" in readme
        assert f"`py {command}`" in readme
        assert (ROOT / command.split()[0] / "__main__.py").exists()


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
