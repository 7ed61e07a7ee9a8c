"""Every condition is in one registry, every refusal of a package derives from its one base."""

import ast
import pickle

import pytest

from rigdata.near_names import nearest_name
from rigdata.problem import RigDataError, RigError
from rigdata.units import UnitError
from tests.structure.sources import imports_and_calls, statements, texts, trees
from tpjb_ident.conditions import KINDS, Condition, UnknownConditionError, merged, sentences, untrusted
from tpjb_ident.errors import TpjbError
from tpjb_ident.estimators.estimate import ComplexInputError


def stated_names(source):
    """Names that a module states in calls of `Condition(name, ..)`, and in rows of `holding((test, name, ..), ..)`."""
    for node in imports_and_calls(source):
        called = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
        named = node.args[:1] if called == "Condition" else []
        if called == "holding":
            named = [row.elts[1] for row in node.args if isinstance(row, ast.Tuple)]
        yield from (name.value for name in named if isinstance(getattr(name, "value", None), str))


def test_every_condition_of_the_code_is_in_the_registry_and_the_registry_holds_no_other():
    code = [text for path, text in texts().items() if path.startswith("tpjb_ident/")]
    stated = {name for source in code for name in stated_names(source)}
    assert len(stated) > 50
    assert stated - set(KINDS) == set()
    by_line = {name for name in KINDS if name.endswith(" on excitation line")}  # named after the line
    assert {name for name in set(KINDS) - by_line if f'"{name}"' not in "".join(code)} == set()


def test_a_condition_has_one_severity_and_says_what_to_do():
    assert {kind.severity for kind in KINDS.values()} == {"error", "warning", "note"}
    assert all(kind.meaning.endswith(".") for kind in KINDS.values())
    assert Condition("ill-conditioned").severity == "error"
    assert Condition("large-amplitude", "7 %").severity == "warning"
    assert Condition("no-centre").severity == "note"
    assert "mains frequency" in Condition("mains on excitation line").meaning


def test_an_unknown_name_is_refused_and_the_nearest_is_named():
    with pytest.raises(UnknownConditionError, match=r"'ill-conditoned' is not known\. Did you mean 'ill-conditioned'"):
        Condition("ill-conditoned")
    with pytest.raises(UnknownConditionError, match=r"condition_kinds\.csv lists them"):
        Condition("qqq")


def test_only_errors_forbid_trust():
    mixed = (Condition("no-centre"), Condition("zero-scale", "29 of 40"), Condition("misfit"))
    assert untrusted(mixed) == ("zero-scale",)
    assert sentences(untrusted(mixed)) == ("zero-scale: 29 of 40",)
    assert untrusted(()) == ()
    assert merged(mixed, (Condition("misfit", "again"),)) == ("no-centre", "zero-scale", "misfit")


def test_conditions_compare_by_name_and_survive_pickling():
    condition = Condition("low-coherence", "coherence 0.5 < 0.9")
    again = pickle.loads(pickle.dumps(condition))
    assert (again, again.detail, again.severity) == ("low-coherence", condition.detail, "error")


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
