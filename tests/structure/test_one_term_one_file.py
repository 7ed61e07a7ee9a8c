"""A source of systematic error is one file: the solve, and the path to it, know no term by name but where listed."""

import ast
import dataclasses

import numpy as np
import pytest

from rigdata.arrays import ComplexArray
from tests.estimate.block_cases import Case, away, made, solved
from tests.seeds import seeds
from tests.structure.sources import imports_and_calls, texts, trees
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import Additive, Parameter, Term
from tpjb_ident.terms.registry import TERMS

ROOMS = ("tpjb_ident/estimate/", "tpjb_ident/identification/", "tpjb_ident/phasors/")
#: Terms that code outside their files asks for: clocks are put right before windows are averaged, and before the
#: transform of a band, where how much runs' gains scatter is learnt from them. The check of a rig asks the housing's
#: what accelerometers of a single run should show. Of the terms one stands on another.
CLASSES = {
    "tpjb_ident/check/rig_fit.py": {"Housing"},
    "tpjb_ident/identification/campaign_solution.py": {"Clock"},
    "tpjb_ident/identification/band_blocks.py": {"RunGain"},
    "tpjb_ident/terms/load.py": {"LoadTurn"},
}
#: What differs from run to run is of the random part.
NAMES = {"tpjb_ident/identification/campaign_solution.py": {"load direction", "load miss"}}
#: Columns of the blocks that have the name of a term.
COLUMNS = {field.name for field in dataclasses.fields(Blocks)}


def imported_terms(source: str) -> set[str]:
    classes = {term.__name__ for term in TERMS}
    found = set()
    for node in imports_and_calls(source):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tpjb_ident.terms"):
            found |= {alias.name for alias in node.names} & classes
    return found


def test_no_term_s_class_is_asked_for_outside_its_file_and_the_registry():
    found = {path: imported_terms(text) for path, text in texts().items() if path != "tpjb_ident/terms/registry.py"}
    assert {path: classes for path, classes in found.items() if classes} == CLASSES


def test_no_term_s_name_stands_outside_its_file():
    names = {term.name for term in TERMS} - COLUMNS
    assert {"load direction", "clock", "housing"} <= names
    found: dict[str, set[str]] = {}
    for path, tree in trees().items():
        if not path.startswith(ROOMS):
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and node.value in names:
                found.setdefault(path, set()).add(node.value)
    assert found == NAMES


def test_every_term_is_a_file_with_a_name_of_its_own():
    assert len({term.name for term in TERMS}) == len(TERMS)
    assert len({term.__module__ for term in TERMS}) == len(TERMS)
    assert all(issubclass(term, Term) and term.__doc__ and term.name for term in TERMS)


class Crosstalk(Additive):
    """A share of the second cell's force that the first one reads."""

    name = "crosstalk"

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        self.parameters = (Parameter("second cell in the first", "1", 0.05),)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """The second cell's reading, in the first one's row."""
        first, second = self.rig.pick("force")
        columns = self.no_columns(blocks)
        columns[:, first, 0] = state.reading(self.rig, blocks)[:, second]
        return columns


@pytest.mark.parametrize("seed", seeds(3))
def test_a_user_s_own_term_is_found_with_the_others(seed):
    rig, blocks, truth = made(Case(crosstalk=0.03, hertz=(60.0,)), seed)
    solution = solved(rig, blocks, truth, Crosstalk(rig, blocks))
    found = solution.fitted["crosstalk"]
    assert found.estimated.all()
    assert found.value[0] == pytest.approx(0.03, abs=4 * found.deviation[0])
    assert found.deviation[0] < 0.01
    assert np.abs(away(solution, truth)).max() < 4
    assert "crosstalk" in solution.shares
    assert np.abs(solved(rig, blocks, truth).h / truth - 1)[:, 0, 1].min() > 0.02
