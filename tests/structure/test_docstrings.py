"""numpydoc where a user looks: faces and extension points have sections, everything else says why in a sentence.

A face is what a user calls (the names that the three packages hand on, and those of docs/api.md, with the public
methods of a class) or what a piece written by a user implements or is handed (`EXTENSION_POINTS`).
"""

import ast
import fnmatch
import functools
import re
from collections.abc import Iterator

from tests.structure.sources import ROOT, trees

HANDED_ON = ("tpjb_ident/__init__.py", "model/__init__.py", "rigdata/__init__.py", "docs/api.md")
#: File and name of what a user's own piece implements or is handed.
EXTENSION_POINTS = {
    "an effect": ("model/effects/kind.py:EffectKind", "model/setup.py:Setup"),
    "a pivot law": ("model/pivots.py:PivotLaw", "tpjb_ident/pivot/laws.py:Law"),
    "a film": ("model/film/reynolds.py:solve_film", "model/film/reynolds.py:FilmForces"),
    "a reader": ("rigdata/readers/formats/*.py:read_[!s]*", "rigdata/readers/*.py:Series"),
    "an estimator": ("tpjb_ident/estimators/r_matrix.py:PhasorTable",),
    "a term": ("tpjb_ident/estimate/term.py:Term",),
    "an export": tuple(f"tpjb_ident/exports/*.py:{n}" for n in ("write_*", "Chosen", "Export")),
    "workers": ("tpjb_ident/runtime/executors.py:Workers",),
    "a plot": ("tpjb_ident/report/plots/*.py:[!_]*",),
    "what a face returns": (
        "model/bearing.py:Pad",
        "model/bearing.py:Oil",
        "tpjb_ident/results/point_result.py:PointResult",
        "tpjb_ident/pivot/*.py:PivotSteps",
        "tpjb_ident/pivot/*.py:Hysteresis",
        "tpjb_ident/clearance/*.py:Locus",
        "tpjb_ident/clearance/*.py:LocusPoint",
        "tpjb_ident/clearance/*.py:ClearancePolygon",
    ),
}
#: Functions that fill a contract which a class tells once: `EffectKind`, `Format`.
CONTRACTS = ("model/effects/", "tpjb_ident/exports/")
SECTION = re.compile(r"^(Parameters|Attributes|Returns|Yields|Raises|Notes|References|Examples?)\n-{4,}$", re.MULTILINE)
Documented = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@functools.cache
def handed_on() -> frozenset[tuple[str, str]]:
    """Module and name of all that users import or read about."""
    pairs: set[tuple[str, str]] = set()
    for name in HANDED_ON:
        text, package = (ROOT / name).read_text(encoding="utf-8"), name.partition("/")[0]
        pairs |= set(re.findall(r"^::: ([\w.]+)\.(\w+)$", text, re.MULTILINE))
        for public, home in re.findall(r'^    "(\w+)": "([\w.]+)",$', text, re.MULTILINE):
            pairs.add((home if home.startswith(("tpjb_ident", "model", "rigdata")) else f"{package}.{home}", public))
    return frozenset(pairs)


def is_face(path: str, name: str) -> bool:
    """Tell whether a definition at the top of a file is one; a package that hands a name on stands for its files."""
    module = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    if any(name == public and f"{module}.".startswith(f"{home}.") for home, public in handed_on()):
        return True
    for points in EXTENSION_POINTS.values():
        for place, pattern in (point.split(":") for point in points):
            if fnmatch.fnmatch(path, place) and fnmatch.fnmatch(name, pattern):
                return True
    return False


def documented(body: list[ast.stmt], inside: str = "", public: bool = True) -> Iterator[tuple[str, Documented, bool]]:
    """Give the qualified name of every definition, inner ones too, and whether all parts of the name are public."""
    for node in body:
        if isinstance(node, Documented):
            shown = public and not node.name.startswith("_")
            yield f"{inside}{node.name}", node, shown
            yield from documented(node.body, f"{inside}{node.name}.", shown and isinstance(node, ast.ClassDef))


def sections(node: Documented) -> list[str]:
    return SECTION.findall(ast.get_docstring(node) or "")


def definitions() -> Iterator[tuple[str, str, Documented, bool]]:
    for path, tree in trees().items():
        for name, node, public in documented(tree.body):
            yield path, name, node, public and is_face(path, name.partition(".")[0])


def test_sections_stay_on_faces():
    assert [f"{path}:{name}" for path, name, node, face in definitions() if not face and sections(node)] == []


def test_faces_that_take_arguments_list_them():
    without = []
    for path, name, node, face in definitions():
        if not face or "." in name or path.startswith(CONTRACTS):
            continue
        parts = (
            [node, *(n for n in node.body if isinstance(n, Documented))] if isinstance(node, ast.ClassDef) else [node]
        )
        takes = isinstance(node, ast.FunctionDef) and bool(node.args.args or node.args.kwonlyargs)
        if takes and not any(section in ("Parameters", "Attributes") for part in parts for section in sections(part)):
            without.append(f"{path}:{name}")
    assert without == []


def test_every_name_is_somewhere():
    """A pattern that matches nothing guards nothing."""
    names = {(path, name) for path, name, _, _ in definitions() if "." not in name}
    for piece, points in EXTENSION_POINTS.items():
        for point in points:
            place, pattern = point.split(":")
            hits = [name for path, name in names if fnmatch.fnmatch(path, place) and fnmatch.fnmatch(name, pattern)]
            assert hits, f"{piece}: {point}"
