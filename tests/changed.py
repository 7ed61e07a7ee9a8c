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
    """What one file says of others: `uses` are dotted names, `gives` where a package's names live."""

    uses: set[str] = field(default_factory=set)
    words: set[str] = field(default_factory=set)
    gives: dict[str, str] = field(default_factory=dict)
    fixtures: dict[str, set[str]] = field(default_factory=dict)


def changed_files(revision: str, root: Path = ROOT) -> list[str]:
    """Files that differ from `revision`, deleted and not yet added ones too (relative, with slashes)."""
    lists = (["diff", "--name-only", "--no-renames", revision, "--"], ["ls-files", "--others", "--exclude-standard"])
    found = [subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True) for words in lists]
    return sorted({line for done in found for line in done.stdout.splitlines()})


def module_name(path: str) -> str:
    """Dotted name of a source (relative, with slashes)."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _dotted(node: ast.AST) -> str:
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def _imported(nodes: list[ast.AST]) -> tuple[set[str], dict[str, str]]:
    """Dotted names that are imported or reached by an attribute; what each imported name stands for."""
    uses: set[str] = set()
    stands_for: dict[str, str] = {}
    for node in nodes:
        if isinstance(node, ast.Import):
            uses.update(a.name for a in node.names)
            stands_for.update({a.asname or a.name.split(".")[0]: (a.asname and a.name) or "" for a in node.names})
        elif isinstance(node, ast.ImportFrom) and node.module:
            uses.update(f"{node.module}.{a.name}" for a in node.names)
            stands_for.update({a.asname or a.name: f"{node.module}.{a.name}" for a in node.names})
    for node in nodes:
        if isinstance(node, ast.Attribute) and (name := _dotted(node)):
            first, _, rest = name.partition(".")
            if first in stands_for:
                uses.add(f"{stands_for[first] or first}.{rest}")
    return uses, stands_for


def _strings(nodes: Iterable[ast.AST]) -> set[str]:
    return {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def read_source(text: str, name: str) -> Source:
    """What the source of the module `name` says of others."""
    nodes = list(ast.walk(ast.parse(text)))
    source = Source()
    source.uses, stands_for = _imported(nodes)
    strings = _strings(nodes)
    source.words = {w for s in strings if len(s) < 200 for w in s.split("/")}
    source.uses |= {found for s in strings if len(s) < 2000 for found in NAME.findall(s) if "." in found}
    if "tpjb_ident" in strings:  # an argument of `python -m`
        source.uses.add("tpjb_ident.__main__")
    for node in nodes:
        if isinstance(node, ast.Call) and _dotted(node.func).endswith("import_module"):
            source.uses |= {s.removesuffix(".") + ".*" for s in _strings(ast.walk(node)) if s.startswith(TOPS)}
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values):
                if isinstance(key, ast.Constant) and isinstance(value, ast.Constant) and isinstance(value.value, str):
                    home = value.value
                    source.gives[str(key.value)] = home if home.startswith(TOPS) else f"{name}.{home}"
        if isinstance(node, ast.FunctionDef) and any("fixture" in ast.unparse(d) for d in node.decorator_list):
            source.fixtures[node.name] = _imported(list(ast.walk(node)))[0]
    source.gives |= {short: full for short, full in stands_for.items() if full}
    return source


class ImportGraph:
    """Every source of the checkout and whom it uses."""

    def __init__(self, root: Path = ROOT) -> None:
        paths = (p for top in TOPS for p in sorted((root / top).rglob("*.py")) if "__pycache__" not in p.parts)
        texts = {p.relative_to(root).as_posix(): p.read_text(encoding="utf-8") for p in paths}
        self.sources = {path: read_source(text, module_name(path)) for path, text in texts.items()}
        self.modules = {module_name(path): path for path in texts}
        self._above: dict[str, set[str]] = {}
        for path, source in self.sources.items():
            for target in self._targets(path, source, texts[path]):
                self._above.setdefault(target, set()).add(path)

    def _targets(self, path: str, source: Source, text: str) -> Iterator[str]:
        if path.endswith("/__init__.py"):  # names given on first use are their users' affair
            given = set(source.gives.values())
            eager = {u for u in source.uses if u not in given or self._is_eager(u, text)}
            uses = {u for u in eager if not u.endswith(".*") or not source.gives}
        else:
            uses = set(source.uses)
        if path.startswith("tests/"):
            for folder in Path(path).parents:
                common = self.sources.get(f"{folder.as_posix()}/conftest.py")
                if common is not None:
                    uses |= {u for name, used in common.fixtures.items() if name in text for u in used}
        for name in uses:
            yield from self._files(name)

    @staticmethod
    def _is_eager(name: str, text: str) -> bool:
        """Tell whether a package's own file imports `name` as it is imported, not on first use."""
        owner = name.rpartition(".")[0]
        return bool(re.search(rf"^from {re.escape(owner)} import|^import {re.escape(name)}", text, re.MULTILINE))

    def _files(self, name: str) -> Iterator[str]:
        """Files that importing the dotted `name` reads, one that is gone among them."""
        if name.endswith(".*"):
            yield from (p for module, p in self.modules.items() if f"{module}.".startswith(name[:-1]))
            return
        parts = name.split(".")
        for n in range(1, len(parts) + 1):
            module = ".".join(parts[:n])
            path = self.modules.get(module)
            if path is not None:
                yield path
                if path.endswith("/__init__.py") and n < len(parts) and parts[0] != "tests":
                    home = self.sources[path].gives.get(parts[n])
                    if home is not None and home != name and module != home:
                        yield from self._files(home)
            elif parts[0] in TOPS:  # an attribute, or a file that is gone
                yield module.replace(".", "/") + ".py"

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
