"""Every condition is in one registry: its name, how grave it is, what it means."""

import ast
import pickle

import pytest

from tests.structure.sources import imports_and_calls, texts
from tpjb_ident.conditions import KINDS, Condition, UnknownConditionError, merged, sentences, untrusted


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
