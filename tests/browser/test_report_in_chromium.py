"""The report as a reader meets it: wide and narrow, light and dark, with and without JavaScript, printed."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.installed_wheel import shipped

pytestmark = pytest.mark.slow

#: Contrast of WCAG 2 AA for text of ordinary size; larger text (24 px, or 18.66 px bold) needs 3.
CONTRAST = """
(() => {
  const parse = (c) => c.match(/[\\d.]+/g).map(Number);
  const lum = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (e) => {
    for (let at = e; at; at = at.parentElement) {
      const c = parse(getComputedStyle(at).backgroundColor);
      if (c.length < 4 || c[3] > 0.99) return c;
    }
    return [255, 255, 255];
  };
  const bad = [];
  const seen = document.querySelectorAll("h1, h2, p, li, a, caption, th, td, button, figcaption, svg text, svg tspan");
  for (const e of seen) {
    if (!e.textContent.trim()) continue;
    const style = getComputedStyle(e);
    const ink = parse(e.closest("svg") ? (style.fill === "none" ? style.color : style.fill) : style.color);
    const [a, b] = [lum(ink), lum(ground(e.closest("figure, section, header, footer, nav, main") || e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && parseInt(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5)) bad.push(`${e.tagName} ${e.textContent.trim().slice(0, 30)}: ${ratio.toFixed(2)}`);
  }
  return [seen.length, bad];
})()
"""
OVERFLOW = """
[...document.querySelectorAll("body *")].filter((e) => !e.closest(".scroll, .drawing"))
  .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
  .map((e) => e.tagName + " " + e.textContent.trim().slice(0, 40))
"""


@pytest.fixture(scope="module")
def report(session_folder):
    """Report of `tpjb demo`."""
    return shipped(session_folder).report


@pytest.fixture
def tab(chromium, report):
    """A tab that shows it."""
    with chromium() as tab:
        tab.size(1280)
        tab.open(report.as_uri())
        yield tab


def test_it_renders_without_errors_and_loads_nothing(tab, report):
    assert tab.logged == []
    assert [url for url in tab.requested if url != report.as_uri()] == []
    assert tab.js("document.querySelectorAll('figure svg').length") > 10
    assert tab.js("[...document.querySelectorAll('figure svg')].every((s) => s.getBoundingClientRect().height > 80)")


@pytest.mark.parametrize("width", [360, 768, 1280])
def test_nothing_runs_over_the_edge(tab, width):
    tab.size(width, 800)
    assert tab.js("document.documentElement.scrollWidth") <= width
    assert tab.js(OVERFLOW) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_has_contrast(tab, scheme):
    tab.prefer(scheme)
    dark = tab.js("parseFloat(getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0]) < 128")
    assert dark == (scheme == "dark")
    looked_at, bad = tab.js(CONTRAST)
    assert looked_at > 300
    assert bad == []


def test_a_screen_reader_finds_names_everywhere(tab):
    nodes = tab.accessible()
    named = {"image", "region", "navigation", "table", "button", "link", "heading"}
    nameless = [n["role"]["value"] for n in nodes
                if n["role"]["value"] in named and not n.get("name", {}).get("value", "").strip()]  # fmt: skip
    assert nameless == []
    roles = [n["role"]["value"] for n in nodes]
    assert roles.count("image") == tab.js("document.querySelectorAll('figure svg').length")
    assert {"main", "navigation", "heading"} <= set(roles)
    assert tab.js("document.documentElement.lang") == "en"


def test_tables_sort_by_number_and_back(tab):
    first = (
        "[...document.querySelectorAll('#s7 table, section table')].find((t) => t.caption.textContent === 'Predicted')"
    )
    column = f"[...{first}.tBodies[0].rows].map((r) => parseFloat(r.cells[2].textContent.replace('\\u2212', '-')))"
    before = tab.js(column)
    button = f"{first}.tHead.rows[0].cells[2].querySelector('button')"
    tab.js(f"{button}.click()")
    assert tab.js(column) == sorted(before)
    assert tab.js(f"{first}.tHead.rows[0].cells[2].getAttribute('aria-sort')") == "ascending"
    tab.js(f"{button}.click()")
    assert tab.js(column) == sorted(before, reverse=True)
    tab.js(f"{button}.focus(); {button}.click()")
    assert tab.js(column) == before
    assert tab.logged == []


def test_it_is_complete_without_javascript(chromium, report):
    with chromium() as tab:
        tab.open(report.as_uri())
        with_script = tab.js("document.querySelector('main').innerText")
    html = report.read_text(encoding="utf-8")
    body = re.sub(r"<(script|style)\b.*?</\1>", "", html, flags=re.S)
    plain = re.sub(r"<[^>]+>", " ", body)
    words = set(re.findall(r"[A-Za-z]{4,}", with_script))
    assert words <= set(re.findall(r"[A-Za-z]{4,}", plain))
    with chromium(javascript=False) as tab:
        tab.size(1280)
        tab.open(report.as_uri())
        assert tab.logged == []


def test_points_tell_their_values_and_text_is_text(tab):
    titles = tab.js("[...document.querySelectorAll('figure svg use title')].map((t) => t.textContent)")
    assert len(titles) > 100
    assert any(re.fullmatch(r"measured, 95 %: kxx [\d.]+ ± [\d.]+ MN/m at static load 5 kN", t) for t in titles)
    words = tab.js("[...document.querySelectorAll('#kxx-over-load svg text')].map((t) => t.textContent)")
    assert "static load, kN" in words


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (390, 844)])
def test_the_first_screen_says_what_how_good_and_how_sure(tab, width, height):
    """What was tested, the verdict with its largest deviation, and K and C with intervals: without a scroll."""
    tab.size(width, height)
    shown = tab.js(
        "[...document.querySelectorAll('h1, .tested div, .first, .next, .answer td, .answer figure svg')]"
        f".filter((e) => e.getBoundingClientRect().bottom <= {height}).map((e) => e.textContent.trim()).join('|')"
    )
    for words in ("22 Hz (1320 rpm)", "2.5 to 7.5 kN", "58 (42 dynamic", "0-peak", "The records are computed",
                  "largest single deviation", "inside their interval", "tpjb init", "66.00\u00a0±",
                  "26 of 28"):  # fmt: skip
        assert words in shown, words
    # and no column of it is cut
    wide = "[...document.querySelectorAll('.answer .scroll')].filter((e) => e.scrollWidth > e.clientWidth + 1).length"
    assert tab.js(wide) == 0


def test_every_picture_names_its_curves_once(tab):
    """Each can be cut out of the page and still be read."""
    figures = tab.js("document.querySelectorAll('figure svg').length")
    labels = tab.js(
        "[...document.querySelectorAll('figure svg text')]"
        ".filter((t) => getComputedStyle(t).visibility !== 'hidden').map((t) => t.textContent)"
    )
    assert 2 < labels.count("Kirk pivots") <= figures
    assert labels.count("deviation, %") >= 4


def test_a_printed_page_is_signed_numbered_and_legible(tab, tmp_path):
    pdf = shutil.which("pdftotext")
    for name, size in (("a4", (8.27, 11.69)), ("letter", (8.5, 11.0))):
        tab.pdf(tmp_path / f"{name}.pdf", *size)
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "a4.pdf").read_bytes())) <= 10
    if pdf is None:
        pytest.skip("no pdftotext")
    for name in ("a4", "letter"):
        text = subprocess.run([pdf, "-layout", tmp_path / f"{name}.pdf", "-"], capture_output=True, text=True).stdout
        pages = text.split("\f")[:-1]
        assert len(pages) <= 11
        for number, page in enumerate(pages, start=1):
            assert f"Page {number} of {len(pages)}" in page
            assert "Rocker-backed" in page
            assert "0-peak" in page
        assert "Checked by" in pages[-1]


#: Texts smaller than 6 pt (8 px), in a window as wide as A4 between its margins.
SMALL = """
[...document.querySelectorAll("body *")].filter((e) => e.getClientRects().length && !e.closest("title, script, style"))
  .filter((e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()))
  .map((e) => {
    const svg = e.closest("svg");
    const scale = svg ? svg.getBoundingClientRect().width / svg.viewBox.baseVal.width : 1;
    return [e.textContent.trim().slice(0, 30), scale * parseFloat(getComputedStyle(e).fontSize)];
  }).filter(([, size]) => size < 8)
"""


def test_no_printed_text_is_under_six_points(tab):
    tab.call("Emulation.setEmulatedMedia", media="print")
    tab.size(695, 1000)
    assert tab.js(SMALL) == []


def test_a_hostile_campaign_stays_text(chromium, tmp_path):
    from tpjb_ident.report.page import Page, Section, Table, render_page

    bad = "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
    section = Section(bad, [bad], tables=[Table(bad, [bad, "n"], [[bad, "1"]] * 4)])
    page = Page(bad, bad, [bad, bad], sections=[section], settings={bad: bad}, inputs={bad: bad})
    path = Path(tmp_path) / "bad.html"
    path.write_text(render_page(page, {}), encoding="utf-8")
    with chromium() as tab:
        tab.size(360)
        tab.open(path.as_uri())
        assert "owned" in tab.js("document.querySelector('h1').textContent")
        assert tab.js("document.title") != "owned"
        assert tab.js("document.querySelectorAll('main img, main script').length") == 0
        assert tab.js("document.documentElement.scrollWidth") <= 360
        assert tab.logged == []
