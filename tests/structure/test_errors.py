"""Every refusal of a package derives from its one base, which the command line knows."""

import ast

import pytest

from rigdata.near_names import nearest_name
from rigdata.problem import RigDataError, RigError
from rigdata.units import UnitError
from tests.structure.sources import statements, trees
from tpjb_ident.errors import TpjbError
from tpjb_ident.estimators.rlm import ComplexInputError

#: Classes that are no refusals: a mistake of the code, and an answer that is not to be trusted.
NO_REFUSALS = {"UnknownConditionError", "NotTrustedError"}


@pytest.mark.parametrize(
    ("package", "base"), [("rigdata", "RigError"), ("model", "ModelError"), ("tpjb_ident", "TpjbError")]
)
def test_every_error_class_of_a_package_has_its_one_base(package, base):
    bases = {}
    for tree in (tree for path, tree in trees().items() if path.startswith(f"{package}/")):
        for node in statements(tree):
            if isinstance(node, ast.ClassDef) and node.name.endswith("Error") and node.bases:
                bases[node.name] = {getattr(b, "id", "") for b in node.bases}
    assert base in bases
    strangers = {n for n, of in bases.items() if n not in {base, *NO_REFUSALS} and not of & set(bases)}
    assert strangers == set()


def test_a_caller_may_catch_them_as_value_errors():
    assert issubclass(TpjbError, ValueError)
    assert issubclass(RigError, ValueError)
    assert issubclass(RigDataError, RigError)
    assert issubclass(UnitError, RigError)
    assert issubclass(ComplexInputError, (TypeError, TpjbError))


@pytest.mark.parametrize(
    ("name", "known", "near"),
    [("kirck", ["rigid", "kirk"], "kirk"), ("q", ["rigid", "kirk"], None), (7, ["7a"], "7a"), ("x" * 99, [], None)],
)
def test_the_nearest_known_name(name, known, near):
    assert nearest_name(name, known) == near
