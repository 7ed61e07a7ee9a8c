"""The report: self-contained, escaped, complete; numbers as a reader wants them, panels with what they show."""

import base64
import hashlib
import math
import re
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import tpjb_ident.report
from rigdata.operating_point import OperatingPoint
from rigdata.problem import refuse
from tests.report.plot_cases import comparison, locus
from tests.report.tags import Page
from tpjb_ident.report import page as report_page
from tpjb_ident.report.drawing.picture import MODEL_STYLES, add_legend, longest_series, new_picture
from tpjb_ident.report.figure import Panel, save_panels, svg_text
from tpjb_ident.report.page import Section, Table, render_page, render_section
from tpjb_ident.report.sections import _run_matrix, coefficient_sections, position_panels
from tpjb_ident.rounding import deviation, fixed, percent, signed, with_interval

ENTRIES = ("xx", "xy", "yx", "yy")
HOSTILE = "<script>alert(1)</script>\"'& <img src=x onerror=alert(2)> $\\frac{a}{b}$ \x1b[31m\u202e"


@pytest.fixture(scope="module")
def page_and_svg(tmp_path_factory):
    figure, axes = new_picture("static load, kN", "kxx, MN/m")
    axes.plot([1, 2, 3], [1, 4, 9], color="#0072b2", label=r"pivot <b> & \$5")
    axes.plot([1, 2, 3], [1, 2, 3], marker="o", clip_on=True)
    add_legend(axes)
    other, axes = new_picture("x", "y")
    axes.plot([0, 1], [1, 0], marker="s")
    panels = [Panel("one", f"first {HOSTILE}", figure), Panel("two", "second", other)]
    page = report_page.Page(
        title=HOSTILE,
        subtitle=HOSTILE,
        sentences=[HOSTILE, HOSTILE],
        then=HOSTILE,
        key_table=Table(HOSTILE, [HOSTILE, "n"], [[HOSTILE, "1"]]),
        sections=[Section(HOSTILE, notes=[HOSTILE], panels=panels, tables=[Table("t", ["a"], [[HOSTILE]])])],
        settings={HOSTILE: HOSTILE},
        inputs={HOSTILE: "0" * 64},
    )
    folder = tmp_path_factory.mktemp("figures") / "figures"
    texts = save_panels(panels, folder)
    return render_page(page, texts), texts, folder


def parsed(text):
    return Page(text).tags


def test_nothing_from_outside_becomes_markup(page_and_svg):
    tags = parsed(page_and_svg[0])
    assert not [t for t, _ in tags if t in ("img", "iframe", "object", "link", "b")]
    assert [a for t, a in tags if t == "script"] == [{}]  # our own, held by its hash
    assert not [a for _, attrs in tags for a in attrs if a.startswith("on")]
    assert page_and_svg[0].count("&lt;script&gt;") >= 10
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f\u202a-\u202e]", page_and_svg[0])


def test_nothing_is_loaded_from_anywhere(page_and_svg):
    for tag, attrs in parsed(page_and_svg[0]):
        for name in ("src", "href", "xlink:href", "data", "action"):
            value = attrs.get(name)
            assert value is None or value.startswith("#"), (tag, name, value)
    assert not re.search(r"@import|url\((?!#)", page_and_svg[0])
    assert "default-src 'none'" in page_and_svg[0]


def test_ids_are_unique_and_every_reference_has_its_target(page_and_svg):
    text = page_and_svg[0]
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    targets = set(re.findall(r'(?:href="|url\()#([^")]+)', text))
    assert targets
    assert targets <= set(ids)


def test_figures_follow_the_page_but_files_keep_their_colours(page_and_svg):
    text, _, folder = page_and_svg
    figures = text[text.index("<figure") :]
    assert "var(--blue)" in figures
    assert "#0072b2" not in figures
    file = (folder / "one.svg").read_text(encoding="utf-8")
    assert "#0072b2" in file
    assert 'fill="white"' in file
    assert (folder / "one.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_text_in_figures_is_text(page_and_svg):
    file = (page_and_svg[2] / "one.svg").read_text(encoding="utf-8")
    assert "static load, kN</text>" in file
    assert "&lt;b&gt;" in file


def test_the_same_figure_gives_the_same_bytes_and_leaves_no_global_setting(page_and_svg):
    before = dict(matplotlib.rcParams)
    figure, axes = new_picture("x", "y")
    axes.plot([0, 1], [1, 0], marker="s")
    assert svg_text(Panel("two", "second", figure).figure, "two") == page_and_svg[1]["two"]
    assert dict(matplotlib.rcParams) == before


def test_a_section_alone_is_as_safe_and_brings_its_style():
    figure, _ = new_picture(HOSTILE.partition("$")[0], "y")
    text = render_section(
        Section(HOSTILE, [HOSTILE], [Panel("p", HOSTILE, figure)], [Table(HOSTILE, ["a"], [[HOSTILE]])])
    )
    tags = parsed(text)
    assert not [t for t, attrs in tags if t in ("img", "script") or any(a.startswith("on") for a in attrs)]
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f\u202a-\u202e]", text)
    assert ":host" in text
    assert "prefers-color-scheme: dark" in text
    assert text.count('<figure id="p"') == 1


def test_the_only_script_is_ours_and_the_policy_lets_no_other_run(page_and_svg):
    (script,) = re.findall(r"<script>(.*?)</script>", page_and_svg[0], flags=re.S)
    source = Path(tpjb_ident.report.__file__).parent / "templates" / "sort.js"
    assert script.strip() == source.read_text(encoding="utf-8").strip()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in page_and_svg[0]


def test_markers_carry_their_values(page_and_svg):
    _, texts, _ = page_and_svg
    assert texts["one"].count("<title>kxx ") == 3
    assert "<title>kxx 2 MN/m at static load 2 kN</title>" in texts["one"]
    assert texts["two"].count("<title>") == 2


def test_a_title_in_the_running_head_cannot_leave_its_string():
    page = report_page.Page(title='x"; } body { display: none } </style><script>', subtitle="", sentences=[""])
    style = render_page(page, {}).split("<style>")[1].split("</style>")[0]
    (head,) = re.findall(r'@top-left \{ content: "([^"]*)"', style)
    assert re.fullmatch(r"(?:[A-Za-z0-9]|\\[0-9a-f]{6})+", head)
    assert "display: none }" not in style


def test_what_was_tested_stands_before_the_verdict():
    html = render_page(
        report_page.Page("t", "", ["The verdict."], facts={"Shaft": "22 Hz (1320 rpm)"}, flags="No flags."), {}
    )
    assert html.index("22 Hz (1320 rpm)") < html.index("The verdict.") < html.index("No flags.")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((163.2841e6, 162.0e6, 164.6e6, 1e6), "163.3 ± 1.3"),
        ((-0.4849e6, -1.04e6, 0.07e6, 1e6), "−0.48 ± 0.56"),
        ((652.1e6, 640e6, 664e6, 1e6), "652 ± 12"),
        ((0.00001e6, -0.5e6, 0.5e6, 1e6), "0.00 ± 0.50"),
        ((66.4, 0.0, 294.7), "66 (0 to 295)"),
        ((5.0, math.nan, math.nan), "5"),
        ((math.nan, 1.0, 2.0), "no answer"),
    ],
)
def test_digits_follow_the_interval(arguments, expected):
    assert with_interval(*arguments) == expected


def test_signs():
    assert signed(0.04) == "0.0"
    assert signed(-0.04) == "0.0"
    assert signed(1.25) == "+1.2"
    assert signed(-1.26) == "−1.3"
    assert signed(math.nan) == "–"
    assert percent(-0.123) == "−12.3\N{NO-BREAK SPACE}%"
    assert [deviation(share).replace("\N{NO-BREAK SPACE}", " ") for share in (2.9, 3.5, -131.5, math.nan)] == [
        "+290.0 %", "4.5 times", "−130 times", "–"
    ]  # fmt: skip
    assert fixed(math.inf) == "–"


#: Six loads at one frequency, in no order.
LOADED = comparison().query("excitation_Hz == 25.0")[::-1]


def coefficient_panels(table):
    return {panel.name: panel for section in coefficient_sections(table) for panel in section.panels}


def test_the_longest_series_is_taken():
    over_load, over_frequency = (longest_series(comparison(), axis) for axis in ("load", "frequency"))
    assert set(over_load["excitation_Hz"]) == {25.0}
    assert over_load["static_load_N"].nunique() == 6
    assert set(over_frequency["static_load_N"]) == {5e3}
    assert over_frequency["excitation_Hz"].nunique() == 4


def test_nothing_is_drawn_over_what_does_not_vary():
    assert set(coefficient_panels(LOADED)) == {f"{part}{entry}-over-load" for part in "kc" for entry in ENTRIES}
    assert coefficient_panels(LOADED[:1]) == {}


def test_measured_points_have_their_intervals_and_predictions_their_lines():
    axes, _ = coefficient_panels(LOADED)["kyy-over-load"].figure.axes
    rigid = LOADED.query("pivots == 'rigid'").sort_values("static_load_N")
    lines = {line.get_label(): line for line in axes.get_lines()}
    drawn = np.column_stack([rigid["static_load_N"] / 1e3, rigid["kyy_N_per_m_predicted"] / 1e6])
    assert np.allclose(lines["rigid pivots"].get_xydata(), drawn)
    (bars,) = axes.containers
    ends = np.array([segment[:, 1] for segment in bars[2][0].get_segments()])
    assert np.allclose(np.sort(ends, axis=0), rigid[["kyy_N_per_m_lo", "kyy_N_per_m_hi"]] / 1e6)
    value = LOADED["kyy_N_per_m"]
    wide = LOADED.assign(kyy_N_per_m_lo=0.8 * value, kyy_N_per_m_hi=1.2 * value)
    assert len(coefficient_panels(wide)["kyy-over-load"].figure.axes) == 1  # no panel of deviations that say nothing


@pytest.mark.parametrize("least", [-1e6, 1e5])
def test_marks_at_or_below_zero_are_whole(least):
    value = LOADED["kyy_N_per_m"].where(LOADED["static_load_N"] > LOADED["static_load_N"].min(), least)
    table = LOADED.assign(kyy_N_per_m=value, kyy_N_per_m_lo=0.5 * value, kyy_N_per_m_hi=1.5 * value)
    low, high = coefficient_panels(table)["kyy-over-load"].figure.axes[0].get_ylim()
    assert low < least / 1e6 - 0.05 * (high - low)


@pytest.mark.parametrize(("factor", "arrow"), [(2.0, r"$\uparrow$"), (0.5, r"$\downarrow$")])
def test_an_arrow_shows_where_a_prediction_out_of_reach_lies(factor, arrow):
    far = LOADED["kyy_N_per_m_predicted"].where(LOADED["pivots"] != "rigid", factor * LOADED["kyy_N_per_m"])
    table = LOADED.assign(kyy_N_per_m_predicted=far)
    _, deviations = coefficient_panels(table)["kyy-over-load"].figure.axes
    arrows = [line for line in deviations.lines if line.get_marker() == arrow]
    rigid = [line.get_xdata()[0] for line in arrows if line.get_color() == MODEL_STYLES["rigid"]["color"]]
    assert sorted(rigid) == pytest.approx(sorted(LOADED["static_load_N"].unique() / 1e3))


def test_a_record_that_cannot_be_read_has_no_rate_in_the_table_of_runs():
    class Broken:
        kind, point = "dynamic", OperatingPoint(5000.0, -math.pi / 2)

        @property
        def sample_rate(self):
            raise refuse("a.csv", "", "is empty", "Copy it again")

    assert _run_matrix([Broken(), Broken()]).rows == [["dynamic", "5", "-90", "0 (0)", "–", "–", "2"]]


def test_positions_need_something_to_show():
    drawn = (np.radians([-90.0, -18.0, 54.0, 126.0, 198.0]), np.full(5, 80e-6))
    assert position_panels(None, drawn, None, {}) == []
    circle = 40e-6 * np.column_stack([np.cos([0, 2, 4]), np.sin([0, 2, 4])])
    (panel,) = position_panels(None, drawn, locus(3), {"rigid": circle})
    labels = {line.get_label() for line in panel.figure.axes[0].get_lines()}
    assert labels == {"clearance, drawing", "rigid pivots", "locus, measured"}
