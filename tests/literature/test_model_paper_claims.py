"""The paper's claims (Lubricants 2019, 7, 61) as far as its text bears them; table: `tests/literature/paper_claims.py`.

Tolerances are those of sentences ("about 200 %", "2-3 times") read off figures, wide on purpose. Where the model cannot
follow, the test says what it does instead, so that a change of the model shows.
"""

import numpy as np
import pytest

from tests.literature import paper_claims as paper
from tests.literature.paper_claims import CXX, CYY, KXX, KYY


def test_kirks_rocker_is_about_thirteen_hundred_newtons_per_micrometre():  # claims 2, 3
    for load in (1000.0, 4000.0, 8000.0):
        assert load / paper.give("rocker", False, load) == pytest.approx(1.3e9, rel=0.12)
    # Fig. 11: 4 kN over 8 um on pad #1; pad #5 the softest of all
    assert paper.give("rocker", True, 4000.0) == pytest.approx(8e-6, rel=0.1)
    assert paper.give("rocker", True, 4000.0, 5) == max(paper.give("rocker", True, 4000.0, k) for k in range(1, 6))


def test_spheres_are_much_softer_than_rockers():  # claim 5
    for load in (1000.0, 8000.0):
        assert paper.give("spherical", False, load) > 4.0 * paper.give("rocker", False, load)


@pytest.mark.slow
def test_soft_pivots_enlarge_the_locus():  # claim 7
    with_kirk, with_measured = paper.locus_sizes()
    assert 1.05 < with_measured / with_kirk < 1.3


@pytest.mark.slow
def test_growth_of_stiffness_with_load():  # claim 8: "nearly 200 %", "about 50 %"
    up = paper.growth(paper.measured("rocker"))
    assert up[KYY] == pytest.approx(2.0, abs=0.4)
    assert up[KXX] == pytest.approx(0.5, abs=0.1)
    # stiff pivots let kyy grow half as much again
    assert paper.growth(paper.kirk("rocker"))[KYY] > 3.0
    assert paper.growth(paper.measured("spherical"))[KXX] == pytest.approx(0.5, abs=0.1)


def test_stiffness_grows_about_linearly():  # claim 8
    for name in ("rocker", "spherical"):
        for column in (KXX, KYY):
            values = paper.measured(name)[:, column]
            line = np.polyval(np.polyfit(paper.LOADS, values, 1), paper.LOADS)
            assert np.abs(values - line).max() < 0.08 * values.max()


def test_rocker_against_spherical():  # claims 9, 11
    ratio = paper.measured("rocker") / paper.measured("spherical")
    assert 1.7 < ratio[0, KYY] < ratio[-1, KYY] < 3.5
    assert 5.0 < ratio[-1, CYY] < 10.0  # "about 6"
    sides = paper.measured("rocker", paper.wider_sides(20e-6)) / paper.measured("spherical")
    assert sides[-1, CXX] == pytest.approx(2.5, rel=0.2)


def test_damping_hardly_depends_on_load_but_the_spherical_cyy():  # claim 10
    up = paper.growth(paper.measured("rocker"))
    assert abs(up[CXX]) < 0.15
    assert abs(up[CYY]) < 0.15
    assert paper.growth(paper.kirk("rocker"))[CYY] > 0.5
    ball = paper.measured("spherical")[:, CYY]
    assert ball[0] == pytest.approx(1.01e5, rel=0.35)
    assert ball[-1] == pytest.approx(0.724e5, rel=0.35)
    assert (np.diff(ball) < 0.0).all()


@pytest.mark.slow
def test_pivots_alone_do_not_lower_kxx_by_the_paper_s_amount_but_wider_sides_do():  # claim 12
    assert np.abs(paper.over("rocker", (), KXX)).max() < 0.08
    wide = [paper.over("rocker", paper.wider_sides(d), KXX) for d in (10e-6, 15e-6, 20e-6)]
    assert wide[0].max() < 0.8 < wide[1].min() < wide[2].min()  # "more or less 80 %" lies between


def test_measured_pivots_lower_kyy_more_at_high_load():  # claim 13
    under = 1.0 - 1.0 / (1.0 + paper.over("rocker", (), KYY))
    assert (np.diff(under) > 0.0).all()
    assert under[0] < 0.1
    assert 0.2 < under[-1] < 0.5


def test_pivots_act_on_damping_first():  # claim 14
    kyy, cyy = paper.over("rocker", (), KYY), paper.over("rocker", (), CYY)
    assert (cyy > 2.0 * kyy).all()
    assert cyy[-1] == pytest.approx(1.0, abs=0.3)
    assert paper.over("rocker", paper.wider_sides(20e-6), CXX)[-1] == pytest.approx(1.0, abs=0.3)


def test_spherical_bearing_shows_the_sizes_of_the_rocker():  # claim 15
    assert paper.over("spherical", (), KXX) == pytest.approx(0.8, abs=0.25)
    assert (paper.over("spherical", (), CYY) > 1.8).all()


@pytest.mark.slow
def test_the_results_hold_every_claim_with_its_verdict(checkout):
    claims = paper.all_claims()
    assert [c.number for c in claims] == list(range(1, 17))
    assert {c.verdict for c in claims} <= {"yes", "in part", "no", "not of the model"}
    page = (checkout / "tests" / "studies" / "RESULTS.md").read_text(encoding="utf-8")
    section = page.split("<!-- claims: begin -->")[1].split("<!-- claims: end -->")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip() for cell in row] for row in rows]
    assert [(int(c[0]), c[1], c[3]) for c in cells] == [(c.number, c.says, c.verdict) for c in claims]
