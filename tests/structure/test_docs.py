"""Documentation: every link leads somewhere, every code block runs, every command line is one."""

import ast
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.command_line import ended

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
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
def test_python_runs_as_it_stands(language, text, desk):
    ast.parse(text)
    if any(word in text for word in NEEDS_FILES_OF_YOUR_OWN) or text.startswith("ti.plots."):
        return  # calls of the gallery: `tests/report` draws them
    done = subprocess.run([sys.executable, "-W", "error", "-P", "-c", text], cwd=desk, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout


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
