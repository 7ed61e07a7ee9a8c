"""The house as it is laid out: no circles, rooms that know only what they may, files and functions that fit a screen.

Exceptions are named or counted, and may only become fewer: the function or file is made smaller, no limit larger.
"""

import ast
import functools
from collections import Counter
from collections.abc import Iterator

import pytest

from tests.structure.sources import ROOT, statements, texts, trees

FILES_A_FOLDER, LINES_A_FILE, LINES_A_FUNCTION, PARAMETERS = 20, 450, 60, 6
#: Folders with more: the catalogue of effects, and three that are a file or two over.
FULL_FOLDERS = {"model/effects"}
#: Functions that may be long: the model's front door, every argument a name of the field.
LONG_FUNCTIONS = {"model/predict.py:predict"}
#: How many there may be: these numbers may only fall (today 0 and 3).
FILES_TOO_LONG, FUNCTIONS_WITH_MANY_PARAMETERS = 0, 3
#: What each room of `tpjb_ident` may import of the others; single files (errors, arrays, ...) are free to all.
MAY_IMPORT = {
    "runtime": set(),
    "estimate": {"rigdata"},
    "terms": {"rigdata", "estimate"},
    "phasors": {"rigdata"},
    "check": {"rigdata", "phasors", "estimate", "terms", "pivot", "clearance"},  # what their own reading refuses
    "pivot": {"rigdata", "runtime", "phasors", "estimate"},  # its statistics
    "clearance": {"rigdata", "runtime", "phasors", "estimate", "pivot"},  # its statistics
    "estimators": {"rigdata", "estimate"},
    "runs": {"rigdata", "runtime", "phasors", "check", "estimate", "estimators"},
    "bands": {"rigdata", "phasors", "check", "estimate", "estimators", "runs"},
    "results": {"rigdata", "phasors", "estimate", "terms", "estimators", "runs"},
    "identification": {"rigdata", "runtime", "phasors", "check", "estimate", "terms", "estimators", "runs", "bands",
                       "results"},
    "exports": {"results", "runtime"},
    "compare": {"rigdata", "model", "estimators", "results", "identification", "pivot", "clearance", "runtime"},
    "diagnosis": {"rigdata", "model", "runs", "results", "identification", "terms", "pivot", "clearance", "compare",
                  "runtime"},
    "watch": {"rigdata", "check", "runs", "results", "identification", "pivot", "clearance", "runtime"},
    "report": {"rigdata", "estimators", "results", "pivot", "clearance", "compare", "diagnosis", "runtime", "watch"},
    "view": {"rigdata", "results", "compare", "report", "runtime"},
    "cli": {"rigdata", "model", "phasors", "check", "estimators", "runs", "results", "identification", "pivot",
            "clearance", "compare", "diagnosis", "report", "exports", "view", "watch", "runtime"},
}  # fmt: skip
#: What a result may import inside the methods that show it: its picture, its table, its sentences.
SHOWS = ("plot", "to_dataframe", "to_frame", "summary")
SHOWN_BY = ("tpjb_ident/report/plots/", "tpjb_ident/report/diagnosis_page.py",
            "tpjb_ident/compare/summary.py", "tpjb_ident/pivot/tables.py")  # fmt: skip

Function = ast.FunctionDef | ast.AsyncFunctionDef


def imported_files(tree: ast.AST, files: dict[str, str]) -> set[str]:
    """Files (values of `files`, by dotted name) that a tree imports at any depth, types and `SHOWN_BY` apart."""
    found = set()
    methods = [s for s in statements(tree) if isinstance(s, ast.FunctionDef) and s.name in SHOWS]
    showing = {node for method in methods for node in method.body}
    for node in statements(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [n for a in node.names for n in (f"{node.module}.{a.name}", str(node.module))]
        elif isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        imported = [files[n] for n in names if n in files]
        found.update(f for f in imported if not (node in showing and f.startswith(SHOWN_BY)))
    return found


@functools.cache
def imports() -> dict[str, set[str]]:
    """Which files each file imports; a package's own file only where it is meant itself."""
    dotted = {p.removesuffix(".py").removesuffix("/__init__").replace("/", "."): p for p in trees()}
    found = {path: imported_files(tree, dotted) - {path} for path, tree in trees().items()}
    # "from package import module" runs the package's file too, but does not ask it for anything
    return {path: {f for f in to if not f.endswith("/__init__.py") or asks(path, f)} for path, to in found.items()}


def asks(path: str, package_file: str) -> bool:
    """Tell whether `path` takes a name from a package's own file, not one of its modules."""
    package = package_file.removesuffix("/__init__.py")
    taken = [n for n in statements(trees()[path]) if isinstance(n, ast.ImportFrom)]
    names = [a.name for n in taken if n.module == package.replace("/", ".") for a in n.names]
    return any(f"{package}/{n}.py" not in trees() and f"{package}/{n}/__init__.py" not in trees() for n in names)


def a_circle(edges: dict[str, set[str]]) -> list[str]:
    """One circle of a graph, or none."""
    done: set[str] = set()

    def walk(node: str, path: list[str]) -> list[str]:
        if node in path:
            return [*path[path.index(node) :], node]
        if node not in done:
            for other in sorted(edges.get(node, ())):
                if circle := walk(other, [*path, node]):
                    return circle
            done.add(node)
        return []

    return next((circle for node in sorted(edges) if (circle := walk(node, []))), [])


def room(path: str) -> str:
    """Room of a file: what a wall stands around."""
    parts = path.split("/")
    return parts[0] if parts[0] != "tpjb_ident" else parts[1]


def test_a_circle_is_seen():
    assert a_circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert a_circle({"a": {"b", "c"}, "b": {"c"}}) == []


def test_no_files_import_each_other_in_a_circle():
    assert a_circle(imports()) == []


def test_no_folders_import_each_other_in_a_circle():
    """Every folder is a room; a file at the top of a package is one of its own, an `__init__` only hands names on."""
    edges: dict[str, set[str]] = {}
    for path, to in imports().items():
        if not path.endswith("__init__.py"):
            here = folder(path)
            edges.setdefault(here, set()).update({folder(t) for t in to if not t.endswith("__init__.py")} - {here})
    assert a_circle(edges) == []


def folder(path: str) -> str:
    """Folder of a file, the file itself where it stands at the top of a package."""
    return path.rpartition("/")[0] if path.count("/") > 1 else path


def test_rooms_know_only_what_they_may():
    free = {room(p) for p in trees() if p.count("/") == 1}
    found = []
    for path, to in imports().items():
        here = room(path)
        if not path.startswith("tpjb_ident/") or here in free:
            continue
        assert here in MAY_IMPORT, f"{here}: a new room; say in {__name__} what it may import"
        found += [f"{path} imports {t}" for t in to if room(t) not in {here, *free, *MAY_IMPORT[here]}]
    assert found == []


def test_rooms_that_may_import_each_other_make_no_circle():
    assert a_circle(MAY_IMPORT) == []


def test_a_folder_shows_at_most_twenty_files():
    files = [p.relative_to(ROOT) for top in ("rigdata", "model", "tpjb_ident") for p in (ROOT / top).rglob("*.py")]
    count = Counter(f.parent.as_posix() for f in files if f.name != "__init__.py")
    full = {folder for folder, n in count.items() if n > FILES_A_FOLDER}
    assert full <= FULL_FOLDERS, f"over {FILES_A_FOLDER} files: {sorted(full - FULL_FOLDERS)}"


def test_files_are_short_enough_to_be_read():
    lines = {path: len(text.splitlines()) for path, text in texts().items()}
    long = [path for path, n in lines.items() if n > LINES_A_FILE]
    assert len(long) <= FILES_TOO_LONG, long


def functions() -> Iterator[tuple[str, Function]]:
    for path, tree in trees().items():
        for node in statements(tree):
            if isinstance(node, Function):
                yield path, node


def is_compiled(node: Function) -> bool:
    """Tell whether numba compiles it: a kernel takes arrays, not objects, and stands whole where its loops are."""
    return any(ast.unparse(d) in ("compiled", "inner") or "njit" in ast.unparse(d) for d in node.decorator_list)


def parameters(node: Function) -> list[str]:
    a = node.args
    return [p.arg for p in (*a.posonlyargs, *a.args, *a.kwonlyargs) if p.arg not in ("self", "cls")]


def test_functions_fit_a_screen():
    long = [f"{path}:{f.name}" for path, f in functions()
            if (f.end_lineno or 0) - f.lineno >= LINES_A_FUNCTION and not is_compiled(f)]  # fmt: skip
    assert set(long) <= LONG_FUNCTIONS, long


def test_functions_take_at_most_six_parameters():
    many = [
        f"{path}:{f.name}"
        for path, f in functions()
        if len(parameters(f)) > PARAMETERS and not is_compiled(f) and not path.startswith("tpjb_ident/cli/")
    ]
    assert len(many) <= FUNCTIONS_WITH_MANY_PARAMETERS, many


@pytest.mark.parametrize(("source", "long"), [("def f(a, b):\n    pass", 2), ("def f(self, *, a):\n    pass", 1)])
def test_parameters_are_counted(source, long):
    assert len(parameters(ast.parse(source).body[0])) == long
