"""Which test files lie above a change, by the imports: what ``python3 tests --changed [REV]`` runs.

Standard library only, nothing is imported: every source is parsed. A file lies above another if it imports it, at any
depth of its functions; names that a package gives on first use lead to the file they live in, names in strings ("python
-m", code for another process, `monkeypatch`) count as imports. Where the imports do not tell (data, settings), more is
run rather than less.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOPS = ("rigdata", "model", "tpjb_ident", "tests")
#: What changes every test, or may.
EVERYTHING = ("pyproject.toml", "tests/conftest.py", "tests/__main__.py")
#: These read sources, documents and settings as text, whatever changed.
READ_EVERYTHING = "tests/structure/"
NAME = re.compile(rf"\b(?:{'|'.join(TOPS)})(?:\.\w+)*\b")


@dataclass
class Source:
    """What one file says of others, as dotted names."""

    imports: set[str]
    strings: set[str] = field(default_factory=set)  #: names that stand in its strings
    words: set[str] = field(default_factory=set)  #: parts of the paths in them
    homes: dict[str, str] = field(default_factory=dict)  #: where the names are that a package gives on first use
    fixtures: dict[str, set[str]] = field(default_factory=dict)  #: what each of its fixtures imports


def changed_files(revision: str, root: Path = ROOT) -> list[str]:
    """Files that differ from `revision`, deleted and not yet added ones too (relative, with slashes)."""
    lists = (["diff", "--name-only", "--no-renames", revision, "--"], ["ls-files", "--others", "--exclude-standard"])
    found = [subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True) for words in lists]
    return sorted({line for done in found for line in done.stdout.splitlines()})


def module_name(path: str) -> str:
    """Dotted name of a source (relative, with slashes)."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _imported(tree: ast.AST) -> set[str]:
    """Dotted names that are imported at any depth."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return found


def read_source(text: str, name: str) -> Source:
    """What the source of the module `name` says of others."""
    tree = ast.parse(text)
    source = Source(_imported(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            source.words.update(node.value.split("/") if len(node.value) < 200 else ())
            names = NAME.findall(node.value) if len(node.value) < 2000 else []
            source.strings.update(found for found in names if "." in found)
            if node.value == "tpjb_ident":  # an argument of `python -m`
                source.strings.add("tpjb_ident.__main__")
            if node.value.startswith(TOPS) and node.value.endswith("."):  # import_module(f"model.effects.{name}")
                source.strings.add(node.value + "*")
        elif isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values):
                if isinstance(key, ast.Constant) and isinstance(value, ast.Constant) and isinstance(value.value, str):
                    home = value.value if value.value.startswith(TOPS) else f"{name}.{value.value}"
                    source.homes[str(key.value)] = f"{home}.{key.value}"
        elif isinstance(node, ast.FunctionDef) and any("fixture" in ast.unparse(d) for d in node.decorator_list):
            source.fixtures[node.name] = _imported(node)
    return source


class ImportGraph:
    """Every source of the checkout and whom it uses."""

    def __init__(self, root: Path = ROOT) -> None:
        paths = (p for top in TOPS for p in sorted((root / top).rglob("*.py")) if "__pycache__" not in p.parts)
        texts = {p.relative_to(root).as_posix(): p.read_text(encoding="utf-8") for p in paths}
        self.sources = {path: read_source(text, module_name(path)) for path, text in texts.items()}
        self.modules = {module_name(path): path for path in texts}
        self._above: dict[str, set[str]] = {}
        for path, text in texts.items():
            for name in self._uses(path, text):
                for target in self._files(name):
                    self._above.setdefault(target, set()).add(path)

    def _uses(self, path: str, text: str) -> set[str]:
        """Dotted names that a source uses; what a package gives on first use is its users' affair."""
        source = self.sources[path]
        uses = source.imports | (set() if source.homes and path.endswith("/__init__.py") else source.strings)
        for folder in Path(path).parents if path.startswith("tests/") else ():
            common = self.sources.get(f"{folder.as_posix()}/conftest.py")
            if common is not None:
                uses = uses.union(*(used for name, used in common.fixtures.items() if name in text))
        return uses

    def _files(self, name: str) -> Iterator[str]:
        """Files that importing the dotted `name` reads, one that is gone among them."""
        if name.endswith(".*"):
            yield from (p for module, p in self.modules.items() if f"{module}.".startswith(name[:-1]))
            return
        parts = name.split(".")
        for n in range(1, len(parts) + 1):
            module = ".".join(parts[:n])
            path = self.modules.get(module, module.replace(".", "/") + ".py")
            yield path
            if path.endswith("/__init__.py") and parts[0] != "tests":
                homes = self.sources[path].homes
                asked = homes.values() if n == len(parts) else [homes[parts[n]]] if parts[n] in homes else []
                for home in asked:
                    if not home.startswith(f"{module}.{home.rpartition('.')[2]}"):  # a file of the name it gives
                        yield from self._files(home)

    def above(self, files: Iterable[str]) -> set[str]:
        """Sources that use any of `files`, directly or through others, and these themselves."""
        found: set[str] = set()
        waiting = list(files)
        while waiting:
            path = waiting.pop()
            if path not in found:
                found.add(path)
                waiting += self._above.get(path, ())
        return found

    def touched(self, path: str) -> set[str]:
        """Sources that a change of `path` touches directly: itself, or who names a data file."""
        if path.endswith(".py"):
            return {path}
        name, folder = path.rpartition("/")[2], path.rpartition("/")[0]
        users = {p for p, s in self.sources.items() if name in s.words or name.partition(".")[0] in s.words}
        beside = {p for p in self.sources if folder.startswith(TOPS) and p.startswith(f"{folder}/")}
        if not users | beside and path.startswith(TOPS):
            return {p for p in self.sources if p.startswith(path.split("/")[0] + "/")}
        return users | beside


def lying_above(files: Iterable[str], root: Path = ROOT) -> list[str]:
    """Arguments for pytest: the test files that a change of `files` may touch; all tests where that cannot be told."""
    files = list(files)
    if not files:
        return []
    if any(f in EVERYTHING for f in files):
        return ["tests"]
    graph = ImportGraph(root)
    touched = set().union(*(graph.touched(f) for f in files))
    above = graph.above(touched)
    for f in files:  # a folder's conftest, and what is no source, belong to the tests beside it
        if f.startswith("tests/") and (f.endswith("/conftest.py") or not f.endswith(".py")):
            above |= {p for p in graph.sources if p.startswith(f.rpartition("/")[0] + "/")}
    kept = {p for p in above | set(graph.sources) if p in above or p.startswith(READ_EVERYTHING)}
    return sorted(p for p in kept if p.rpartition("/")[2].startswith("test_") and (root / p).is_file())


def chosen(arguments: list[str]) -> list[str]:
    """Replace ``--changed [REV]`` among the arguments by the test files that lie above the change; say how many."""
    at = arguments.index("--changed")
    rest = arguments[at + 1 :]
    given = bool(rest) and not rest[0].startswith("-") and not Path(rest[0].partition("::")[0]).exists()
    revision = rest[0] if given else "HEAD"
    try:
        files = changed_files(revision)
    except (OSError, subprocess.CalledProcessError) as error:
        said = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
        sys.exit(f"--changed {revision}: git cannot tell what changed ({said[0] if said else 'no reason given'})")
    tests = lying_above(files)
    if not tests:
        sys.exit(f"--changed {revision}: nothing changed, no test to run.")
    what = "all tests" if tests == ["tests"] else f"{len(tests)} test files"
    print(f"--changed {revision}: {len(files)} files changed, {what} lie above them", flush=True)
    return [*arguments[:at], *tests, *rest[given:]]
