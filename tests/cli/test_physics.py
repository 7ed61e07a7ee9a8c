"""`--physics`: options of the model by name."""

from __future__ import annotations

import pytest

from model.growth import Growth
from model.options import Options
from tpjb_ident.cli.commands.predict import parse_physics
from tpjb_ident.errors import BadInputError


def test_nothing_said_is_the_papers_model():
    assert parse_physics(None, None) == Options()


def test_names_and_the_housing():
    found = parse_physics("conduction, journal,growth", "48 degC")
    assert found == Options(conduction=True, isothermal_journal=True, growth=Growth(housing=48.0))


@pytest.mark.parametrize(
    ("names", "housing", "message"),
    [
        ("conducton", None, "Did you mean 'conduction'"),
        ("zzz", None, "Use some of conduction"),
        (None, "48 degC", "without growth"),
        ("growth", "48 bar", "housing-temperature"),
        ("growth", "900 degC", "between -50 and 300"),
    ],
)
def test_mistakes_are_named(names, housing, message):
    with pytest.raises(BadInputError, match=message):
        parse_physics(names, housing)
